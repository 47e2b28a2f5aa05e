"""Loads on the grain of a run, coefficients, and verdict."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Floats, spatial
from ..geometry.placement import Placement
from ..results.errorbars import NO_GRAIN, Loads, SafetyBar
from ..results.loads import Coefficients, Forces, Torques
from ..scene import Scene
from ..scene.grains import mass_and_inertia, orientation_of
from ..setup.setup import Setup
from .state import Run

if TYPE_CHECKING:
    from ..contact import Contacts, Load
    from ..contact.rocking import Rocking
    from ..contact.verdict import Verdict

ROCKS = "rocks to another rest"  # mode of motion
RENEWED = (
    "this uses the load of the first pose; in the second pose the load may differ by about {drift:.0%}{more}: to "
    "check, run a scene with {keys} and settle = false, and see whether the flow's load holds the grain (without the "
    "flow it would roll back)"
)

OTHER_CONTACTS = ", or more, since a contact has opened or closed"


def loads(run: Run, surface: bool, speed: float = 1.0) -> tuple[Forces, Torques]:
    """Forces and torques on the grain for velocities in units of `speed`, with the surface integral if `surface`."""
    scene, probe = run.scene, run.probe
    assert probe is not None
    flow = probe.resultant()
    if run.turbulence is not None and (mean := run.turbulence.mean_load()) is not None:
        flow = replace(flow, force=mean[0], torque=mean[1])
    check = probe.surface_resultant() if surface else flow
    (buoyancy, weight), unit = weights(scene), speed**2
    placement = scene.placement if run.grain is None else run.grain.state.placement
    assert placement is not None
    more = run.fluid.load_on_displaced(placement)
    force = Forces(unit * (flow.force + more[0]), unit * (check.force + more[0]), buoyancy, weight)
    torque = Torques(unit * (flow.torque + more[1]), unit * (check.torque + more[1]), flow.about)
    return force, torque


def loads_of_run(run: Run, force: Forces | None = None, torque: Torques | None = None) -> Loads:
    """Loads of a run, computed if not passed, and the other quantities with error estimates. Collective."""
    from ..mesh.sampling import centrelines

    others: dict[str, Any] = {}
    if run.grain is not None:
        state = run.grain.state
        others["place"] = np.concatenate([state.place, state.orientation])
    elevations = None if run.surface is None else run.surface.elevations
    if elevations is not None:
        others |= {"elevation": elevations, "level": elevations.values[-1]}
    if run.scene.has_centrelines:
        extremes = centrelines(run.scene.domain, run.fluid).values()
        others["centreline"] = np.array([extreme.value for extreme in extremes])
    walls = run.wall_report()
    spans = run.separated() if walls is None else walls.backward
    if spans is not None:
        others["separated"] = np.reshape(spans, (-1, 2))
    if run.probe is None:
        shear = {} if walls is None else {"shear_velocity": walls.shear_velocities}
        return Loads(NO_GRAIN, others | shear)
    if force is None or torque is None:
        force, torque = loads(run, surface=False)
    computed = Loads(np.concatenate([force.plain, torque.plain]), others)
    return computed.with_spread(0.0 if walls is None else walls.spread, run.scene.grain.size)


def weights(scene: Scene) -> tuple[Floats, Floats]:
    """Buoyancy and weight (3,) of the scene's grain."""
    gravity = spatial(scene.gravity_vector)
    return -scene.grain.volume * gravity, (scene.mass or 0.0) * gravity


def coefficients(run: Run, force: Forces, torque: Torques) -> Coefficients:
    """Drag, lift and moment coefficients."""
    scene = run.scene
    velocity, length = scene.reference_velocity, scene.grain.size
    area = length if scene.gdim == 2 else 0.25 * np.pi * length**2
    unit = 0.5 * velocity**2 * area
    drag, lift = force.flow[[0, scene.up]] / unit
    moment = torque.flow[2 if scene.gdim == 2 else 1] / (unit * length)
    return Coefficients(drag, lift, moment, velocity, length)


def judged(run: Run, force: Forces, torque: Torques) -> dict[str, Any] | None:
    """Verdict of both criteria as plain data; None without contacts."""
    scene = run.scene
    if run.contacts is None or scene.contact is None or scene.mass is None:
        return None
    with run.accounts.ledger.stage("contact"):
        verdict = verdict_of(scene, scene.placement, run.contacts, force, torque)
    if scene.time is not None:
        verdict["first_motion"] = run.first_motion
    return verdict


def verdict_of(
    scene: Scene, placement: Placement | None, contacts: Contacts, force: Forces, torque: Torques
) -> dict[str, Any]:
    """Verdict of both criteria on a placed grain under loads, as plain data."""
    load = load_of(placement, force, torque)
    return verdict_on(scene, contacts, load, placement).to_dict()


def find_contacts(scene: Scene) -> Contacts:
    """Contacts of the resting grain with the bed."""
    return Setup(scene).contacts


def load_of(placement: Placement | None, force: Forces, torque: Torques) -> Load:
    """Load on the contacts: the flow's force and torque, and the submerged weight at the centre of mass.

    placement: of the grain in contact with the bed, without the gap
    """
    from ..contact import Load

    assert placement is not None
    return Load(force.flow, torque.flow, force.weight + force.buoyancy, spatial(placement.centre))


def verdict_on(
    scene: Scene, contacts: Contacts, load: Load, placement: Placement | None
) -> Verdict:
    """Verdict of both criteria on a scene's grain, placed, under a load."""
    from ..contact import judge

    assert scene.body is not None and scene.contact is not None
    return judge(load, contacts, scene.contact.law, mass_and_inertia(scene.body, placement))


def followed(scene: Scene, load: Load) -> Rocking | None:
    """Equilibria of a scene's grain as the flow's load grows up to `load` and beyond; None without any.

    The first is close to the scene's placement.
    """
    from ..contact.rocking import follow

    body, contact, bed = scene.body, scene.contact, scene.bed
    assert body is not None and contact is not None and scene.placement is not None
    if body.shape in ("disc", "sphere") and bed is not None and bed.kind in ("flat", "inclined"):
        return None
    inert = mass_and_inertia(body, scene.placement)
    return follow(scene.grain, scene.bed_shape, scene.placement, load, contact.law, inert)


def with_rocking(verdict: dict[str, Any], rocking: Rocking) -> dict[str, Any]:
    """The verdict on a grain that rocks before it leaves its pocket, or without leaving it."""
    factor = rocking.critical
    paper = verdict["sentence"].partition("; ")[2]
    return verdict | {
        "moves": rocking.leaves,
        "mode": rocking.mode if rocking.leaves else ROCKS,
        "sentence": f"{rocking.sentence}; {paper}",
        "safety_factor": factor if math.isfinite(factor) else None,
        "safety_status": "ROCKS",
        "rocking": rocking.to_dict(),
        "note": RENEWED.format(
            drift=rocking.drift(rocking.last),
            more=OTHER_CONTACTS
            if len(rocking.last.contacts) != len(rocking.rests[0].contacts)
            else "",
            keys=standing(rocking.last.placement),
        ),
    }


def bar_with_rocking(bar: SafetyBar, factor: float | None, share: float, drift: float) -> SafetyBar:
    """The bar of a rocking grain, computed with a frozen load: nothing is certain.

    Args:
        factor: the safety factor, None for an infinite one.
        share: relative error of the load.
        drift: relative change of the load between the first and the last pose.
    """
    value, error = math.inf if factor is None else factor, share + drift
    low, high = value / (1.0 + error), value / (1.0 - error) if error < 1.0 else math.inf
    return replace(
        bar,
        value=value,
        low=low,
        high=high,
        certain=False,
        rests=False,
        frozen=drift,
    )


def standing(placement: Placement) -> str:
    """The scene's keys for a placement."""
    if placement.gdim == 2:
        angle = math.degrees(placement.angle) % 360.0
        return f"body.x = {placement.centre[0]:.10g} and body.angle = {angle:.6g}"
    x, y, _ = placement.centre
    about = ", ".join(f"{angle:.6g}" for angle in orientation_of(placement))
    return f"body.x = {x:.10g}, body.y = {y:.10g} and body.orientation = [{about}]"


def may_rock(verdict: dict[str, Any]) -> bool:
    """Whether the contacts balance the weight but no load of the flow, so that another equilibrium may exist."""
    return verdict["moves"] and verdict["safety_status"] == "NO_RESERVE"

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


def load_on_grain(run: Run, speed: float = 1.0) -> Floats:
    """Force and torque (6,) of the flow on the grain for velocities in units of `speed`. Collective."""
    assert run.probe is not None
    load = None if run.turbulence is None else run.turbulence.mean_load()
    if load is None:
        load = run.probe.resultant().load
    return np.asarray(speed**2 * (load + _on_displaced(run)))


def forces_and_torques(run: Run) -> tuple[Forces, Torques]:
    """Forces and torques on the grain, with the surface integral as a check. Collective."""
    assert run.probe is not None
    load, probe = load_on_grain(run), run.probe
    check = probe.surface_resultant().load + _on_displaced(run)
    force = Forces(load[:3], check[:3], load[:3], *weights(run.scene))
    return force, Torques(load[3:], check[3:], load[3:], probe.about)


def _on_displaced(run: Run) -> Floats:
    placement = run.scene.placement if run.grain is None else run.grain.state.placement
    assert placement is not None
    return run.fluid.load_on_displaced(placement).ravel()


def loads_of_run(run: Run, load: Floats | None = None) -> Loads:
    """Load (6,) of a run, computed if not passed, and the other quantities with error estimates. Collective."""
    from ..mesh.sampling import centrelines

    others: dict[str, Any] = {}
    if run.grain is not None:
        state = run.grain.state
        place = np.concatenate([state.place, state.orientation])
        others |= {"place": place, "velocity": state.velocity, "spin": state.spin}
    if run.surface is not None and (elevations := run.surface.elevations) is not None:
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
    computed = Loads(load_on_grain(run) if load is None else load, others)
    return computed.with_spread(0.0 if walls is None else walls.spread, run.scene.grain.size)


def weights(scene: Scene) -> tuple[Floats, Floats]:
    """Buoyancy and weight (3,) of the scene's grain."""
    gravity = spatial(scene.gravity_vector)
    return -scene.grain.volume * gravity, (scene.mass or 0.0) * gravity


def coefficients(run: Run, load: Floats) -> Coefficients:
    """Drag, lift and moment coefficients of a load (6,)."""
    scene = run.scene
    velocity, length = scene.reference_velocity, scene.grain.size
    area = length if scene.gdim == 2 else 0.25 * np.pi * length**2
    unit = 0.5 * velocity**2 * area
    drag, lift = load[[0, scene.up]] / unit
    moment = load[5 if scene.gdim == 2 else 4] / (unit * length)
    return Coefficients(drag, lift, moment, velocity, length)


def judged(run: Run, load: Floats) -> dict[str, Any] | None:
    """Verdict of both criteria on a load (6,) of the flow as plain data; None without contacts."""
    scene = run.scene
    if run.contacts is None or scene.contact is None or scene.mass is None:
        return None
    with run.accounts.ledger.stage("contact"):
        acting = load_of(scene, load)
        verdict = verdict_on(scene, run.contacts, acting, scene.placement).to_dict()
    if scene.time is not None:
        verdict["first_motion"] = run.first_motion
    return verdict


def load_of(scene: Scene, load: Floats, placement: Placement | None = None) -> Load:
    """Load on the contacts: the flow's (6,), and the submerged weight at the centre of mass.

    placement: of the grain in contact with the bed, without the gap; default: the scene's
    """
    from ..contact import Load

    placement = placement or scene.placement
    assert placement is not None
    buoyancy, weight = weights(scene)
    return Load(load[:3], load[3:], weight + buoyancy, spatial(placement.centre))


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


def bar_with_rocking(bar: SafetyBar, factor: float, share: float, drift: float) -> SafetyBar:
    """The bar of a rocking grain, computed with a frozen load: nothing is certain.

    Args:
        factor: the safety factor.
        share: relative error of the load.
        drift: relative change of the load between the first and the last pose.
    """
    error = share + drift
    low, high = factor / (1.0 + error), factor / (1.0 - error) if error < 1.0 else math.inf
    return replace(bar, value=factor, low=low, high=high, certain=False, rests=False, frozen=drift)


def standing(placement: Placement) -> str:
    """The scene's keys for a placement."""
    if placement.gdim == 2:
        angle = math.degrees(placement.angle) % 360.0
        return f"body.x = {placement.centre[0]:.10g} and body.angle = {angle:.6g}"
    x, y, _ = placement.centre
    angles = np.round(orientation_of(placement), 6) + 0.0  # without round-off, and its sign
    about = ", ".join(f"{angle:g}" for angle in angles)
    return f"body.x = {x:.10g}, body.y = {y:.10g} and body.orientation = [{about}]"


def may_rock(verdict: dict[str, Any]) -> bool:
    """Whether the contacts balance the weight but no load of the flow, so that another equilibrium may exist."""
    return verdict["moves"] and verdict["safety_status"] == "NO_RESERVE"

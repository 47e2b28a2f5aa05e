"""Loads on the grain of a run, coefficients, and verdict."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Floats, spatial
from ..results.errorbars import NO_GRAIN, Loads, longest_first
from ..results.loads import Coefficients, Forces, Torques
from ..scene import Scene
from .state import Run

if TYPE_CHECKING:
    from ..contact import Contacts
    from ..geometry.placement import Placement


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
        others["separated"] = longest_first(spans)
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
    from ..results.contact_verdict import load_of, verdict_on

    load = load_of(placement, force, torque)
    return verdict_on(scene, contacts, load, placement).to_dict()

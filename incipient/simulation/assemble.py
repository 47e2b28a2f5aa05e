"""From a computed flow to the result: loads on the grain, verdict, error bars, and what all of it has cost.

Every function is collective but those said not to be.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import spatial
from ..errors import IncipientError
from ..planning.effects import EffectName
from ..results.cost_of_effects import cost_of_effects
from ..results.loads import Coefficients, Couples, Forces
from ..results.result import Result, gap_of
from ..results.timing import peak_memory_mib

if TYPE_CHECKING:
    from ..contact import Contacts
    from ..results.errorbars import ErrorBars
    from ..results.left_out import Omission
    from ..scene import Scene
    from .simulate import Simulation

# What a result says of error bars that are still to come; a run that is stopped leaves it so.
TO_COME = "not computed: the run goes on, or was stopped while they were"


def outcome(simulation: Simulation, status: str = "complete", error: str = "") -> Result:
    """What the flow at hand says, without what has to be estimated: see `with_estimates`."""
    from ..mesh.sampling import centrelines

    scene, travel = simulation.scene, simulation.trajectory
    with simulation.stage("tractions"):
        force = couple = verdict = None
        contacts, trajectory = simulation.contacts, None if travel is None else travel.summary()
        if simulation.probe is not None:
            force, couple = loads(simulation, surface=True)
            if status == "complete":
                verdict = judged(simulation, force, couple)
            if travel is not None and trajectory is not None and travel.coupling.met:
                from .landing import landing

                landed = landing(scene, travel.state, travel.clearance(), force, couple)
                contacts, verdict = landed.contacts, landed.verdict
                trajectory["ended"]["without_verdict"] = landed.why_not
        gap = None if travel is not None else gap_of(simulation.layout, simulation.domain)
        lines = centrelines(scene, simulation.fluid)
        cells = _cell_reynolds(simulation)
    return Result(
        title=scene.title,
        plan=simulation.plan,
        scene=scene.model_dump(mode="json"),
        force=force,
        couple=couple,
        coefficients=None if force is None or couple is None else coefficients(scene, force, couple),
        grain=_grain(simulation),
        gap=gap,
        contacts=_contacts(contacts),
        verdict=verdict,
        trajectory=trajectory,
        centrelines=lines,
        measured_cell_reynolds=cells,
        cost=cost(simulation),
        status=status,
        error=error,
        without_error_bars=TO_COME if status == "complete" and has_error_bars(scene) else "",
        velocity=simulation.fluid.velocity,
        pressure=simulation.fluid.pressure,
    )


def has_error_bars(scene: Scene) -> bool:
    """Whether the result of a scene is to have error bars. Not collective."""
    return scene.numerics.error_bars and scene.body is not None


def with_estimates(simulation: Simulation, result: Result) -> Result:
    """A complete result with its error bars, and with what the effects left out would have changed.

    Where one of them fails the result says why; nothing is raised.
    """
    bars, why = _error_bars(simulation, result)
    return replace(
        result,
        error_bars=bars,
        without_error_bars=why,
        omitted=_omissions(simulation, result),
        cost=cost(simulation),
    )


def _error_bars(simulation: Simulation, result: Result) -> tuple[ErrorBars | None, str]:
    """The error bars, or why there are none; neither where none are wanted."""
    if not has_error_bars(simulation.scene):
        return None, ""
    assert result.force is not None and result.couple is not None
    from ..accuracy.errorbars import error_bars

    with simulation.stage("error bars"):
        try:
            return error_bars(simulation, result.force, result.couple), ""
        except IncipientError as error:
            return None, f"not computed: {error}"


def _omissions(simulation: Simulation, result: Result) -> tuple[Omission, ...]:
    from ..results.left_out import Omission
    from .left_out import omissions

    with simulation.stage("omitted effects"):
        try:
            return omissions(simulation, result.force, result.couple, result.verdict)
        except IncipientError as error:
            return (Omission("effects named by the plan", None, f"not estimated: {error}", False),)


# -- loads and verdict --------------------------------------------------------------------------------


def loads(simulation: Simulation, surface: bool, speed: float = 1.0) -> tuple[Forces, Couples]:
    """Forces and couples on the grain for speeds in units of `speed`; the surface integral where asked for."""
    scene, probe = simulation.scene, simulation.probe
    assert probe is not None and scene.grain is not None
    flow = probe.resultant()
    check = probe.surface_resultant() if surface else flow
    gravity, unit = spatial(scene.gravity_vector), speed**2
    buoyancy, weight = -scene.grain.volume * gravity, (scene.mass or 0.0) * gravity
    force = Forces(unit * flow.force, unit * check.force, buoyancy, weight)
    couple = Couples(unit * flow.couple, unit * check.couple, flow.about)
    if simulation.trajectory is None:
        return force, couple
    x, y, turning = simulation.trajectory.repulsion()
    pushed, twisted = np.array([x, y, 0.0]), np.array([0.0, 0.0, turning])
    return replace(force, repulsion=pushed), replace(couple, repulsion=twisted)


def coefficients(scene: Scene, force: Forces, couple: Couples) -> Coefficients:
    """Drag, lift and moment coefficients of the loads on the scene's grain. Not collective."""
    assert scene.grain is not None
    velocity, length = scene.reference_velocity, scene.grain.size
    unit = 0.5 * velocity**2 * length
    drag, lift = force.flow[:2] / unit
    return Coefficients(drag, lift, couple.flow[2] / (unit * length), velocity, length)


def judged(simulation: Simulation, force: Forces, couple: Couples) -> dict[str, Any] | None:
    """The verdict of both judges in plain data, None where there is nothing to judge. Not collective."""
    if simulation.contacts is None:
        return None
    with simulation.ledger.stage("contact"):
        from ..results.verdict import judge

        verdict = judge(simulation.scene, simulation.contacts, force, couple)
    if verdict is not None and simulation.scene.time is not None:
        verdict["first_motion"] = simulation.first_motion
    return verdict


# -- the rest -----------------------------------------------------------------------------------------


def cost(simulation: Simulation) -> dict[str, Any]:
    """Wall time by stage and effect, unknowns, iterations, memory, versions."""
    from .. import compat

    mesh, statistics = simulation.domain.mesh, simulation.fluid.solver.statistics
    iterations = {
        **simulation.iterations,
        "factorisations": statistics.factorisations,
        "krylov": statistics.krylov_iterations,
    }
    return {
        "wall_time": simulation.ledger.to_dict(),
        "effects": cost_of_effects(simulation),
        "unknowns": simulation.fluid.space.unknowns,
        "cells": mesh.topology.index_map(mesh.topology.dim).size_global,
        "iterations": iterations,
        "peak_memory_mib": sum(simulation.comm.allgather(peak_memory_mib())),
        "ranks": simulation.comm.size,
        "versions": compat.versions(),
    }


def _cell_reynolds(simulation: Simulation) -> float | None:
    """The largest Reynolds number of a cell, None where there is no convection."""
    if not simulation.plan.has(EffectName.INERTIA):
        return None
    from ..planning.stabilisation import measured_cell_reynolds

    return measured_cell_reynolds(simulation.fluid)


def _contacts(contacts: Contacts | None) -> list[dict[str, Any]]:
    """Contacts as plain data: point, outward normal of the grain, area (0 for a point). Not collective."""
    if contacts is None:
        return []
    areas = np.zeros(len(contacts.points)) if contacts.areas is None else contacts.areas
    rows = zip(contacts.points, contacts.normals, areas, strict=True)
    return [{"point": list(p), "normal": list(n), "area": float(a)} for p, n, a in rows]


def _grain(simulation: Simulation) -> dict[str, Any] | None:
    """Place of the grain at rest and where the flow was computed, and its size. Not collective."""
    layout, grain = simulation.layout, simulation.scene.grain
    resting, placement = layout.resting, layout.placement
    if simulation.trajectory is not None:
        resting = placement = simulation.trajectory.state.placement
    if resting is None or placement is None or grain is None:
        return None
    return {
        "centre": resting.centre,
        "computed_centre": placement.centre,
        "angle": resting.angle,
        "size": grain.size,
        "volume": grain.volume,
    }

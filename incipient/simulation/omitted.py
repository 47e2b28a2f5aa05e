"""Estimated changes of a result by effects that its run leaves out. Every function is collective."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import spatial
from ..parallel import largest
from ..planning.effects import (
    REMEDY,
    Decision,
    EffectName,
    accuracy_asked,
    shedding,
    transition,
)
from ..results.accuracy import Omission

if TYPE_CHECKING:
    from ..results.result import Result
    from .state import Run


def without_inertia(run: Run, result: Result, decision: Decision) -> Omission | None:
    """Dual-weighted convection, or Oseen's term without error bars."""
    if decision.expected == 0.0:
        return None
    remedy = "set fluid.inertia = true and effects.inertia = true"
    if not run.scene.numerics.error_bars:
        how = "at most, from Oseen's term"
        return Omission(decision.name, decision.expected, how, False, remedy)
    from ..forms.terms import convection
    from .missing_term import weighted

    where = run.fluid.reference_map
    return weighted(run, result, decision.name, lambda v, w: convection(v, v, w, where), remedy)


def without_unsteadiness(run: Run, result: Result, decision: Decision) -> Omission | None:
    """Risk of vortex shedding, or the dual-weighted time derivative of quasi-steady flow."""
    name = decision.name
    if run.scene.time is None:
        risk = shedding(run.setup)
        return Omission(name, None, risk, True, "add a section [time]") if risk else None
    remedy, transient = 'set effects.unsteadiness = "auto"', run.transient
    if not run.scene.numerics.error_bars or transient is None or not transient.past:
        how = "history force, pressure gradient and added mass, leading terms"
        return Omission(name, decision.expected, how, False, remedy)
    from ..forms.terms import inertia
    from .missing_term import weighted

    before, rate, fluid = transient.past[0], run.fluid.velocity, run.fluid
    values, length = fluid.state.x.array - before.state, fluid.time - before.time
    rate.x.array[:] = values[fluid.space.velocity_map] / length
    return weighted(run, result, name, lambda v, w: inertia(rate, w, fluid.reference_map), remedy)


def without_gravity(run: Run, result: Result, decision: Decision) -> Omission | None:
    """The submerged weight over the load, where the scene leaves gravity out."""
    scene, force = run.scene, result.force
    if not decision.forced or scene.gravity is None or scene.grain is None or force is None:
        return None
    excess = (scene.mass or 0.0) - scene.grain.volume
    change = excess * scene.gravity.acceleration * spatial(scene.gravity_direction)
    relative = float(np.linalg.norm(change)) / max(float(np.linalg.norm(force.flow)), 1e-300)
    how, remedy = "weight and buoyancy, exact", 'set effects.gravity = "auto"'
    return Omission(decision.name, relative, how, False, remedy, change, np.zeros(3))


def without_contact(run: Run, result: Result, decision: Decision) -> Omission | None:
    """The missing verdict, where the scene leaves contact out."""
    if not decision.forced:
        return None
    return Omission(decision.name, None, "without it there is no verdict", False)


def without_motion(run: Run, result: Result, decision: Decision) -> Omission | None:
    """What is said of a held grain that would move."""
    verdict = result.verdict or {}
    since, rocking = verdict.get("first_motion"), verdict.get("rocking")
    if since is None:
        return None
    does = "moves" if rocking is None or rocking["leaves"] else "rocks"
    pose = "" if rocking is None else "; this time and the history are judged in the first pose"
    how = f"the grain {does} from t = {since:.4g} on, but was held{pose}"
    return Omission(decision.name, None, how, False)


def without_free_surface(run: Run, result: Result, decision: Decision) -> Omission | None:
    """Rise of a surface by the pressure under a rigid lid, relative to the depth."""
    if decision.expected is None:
        return None
    scene = run.scene
    rise = rise_under_lid(run) / run.setup.base_flow.depth
    may_be = scene.domain.kind == "box" or scene.flow.below_surface
    remedy = (
        'domain.top = "free-surface"' if may_be and not scene.is_averaged else "a deeper channel"
    )
    if rise > 1.0:
        how = f"the pressure under the lid is that of {rise:.2g} depths, as after an impulse"
        return Omission(decision.name, None, how, True, remedy)
    how = "of the depth, from the pressure under the lid over gravity"
    return Omission(decision.name, rise, how, False, remedy)


def rise_under_lid(run: Run) -> float:
    """Largest pressure head under the lid, relative to the outflow or, in a closed domain, the mean. Collective."""
    from .. import compat

    scene, fluid, comm = run.scene, run.fluid, run.comm
    space, gravity = fluid.space.pressure, scene.gravity_vector
    nodes = compat.nodes_on(space, fluid.domain.facets_of(run.setup.sides.top))
    own = nodes[nodes < space.dofmap.index_map.size_local]
    away = space.tabulate_dof_coordinates()[own, 0] - scene.domain.right
    # The omitted hydrostatic pressure varies along an inclined lid.
    heads = (fluid.pressure.x.array[own] + gravity[0] * away) / abs(gravity[scene.up])
    if fluid.constraints.closed:
        total, count = comm.allreduce(np.array([heads.sum(), len(heads)]))
        heads -= total / max(count, 1)
    return largest(comm, np.abs(heads))


def without_turbulence(run: Run, result: Result, decision: Decision) -> Omission | None:
    """Absent fluctuations of a mean profile, or a laminar flow that may be turbulent."""
    scene = run.scene
    if scene.flow.kind == "log-law":
        how = "gusts, and mixing in the wake; the base flow is the mean of a turbulent flow"
        remedy = "loads are those of the mean flow, gusts exceed them"
        return Omission(decision.name, None, how, True, remedy)
    how, remedy = transition(run.setup), f"the flow computed is the laminar one; {REMEDY}"
    return Omission(decision.name, None, how, True, remedy) if how else None


# By effect, where something can be said of it, in the order of plans.
LEFT_OUT: dict[EffectName, Callable[[Run, Result, Decision], Omission | None]] = {
    "inertia": without_inertia,
    "unsteadiness": without_unsteadiness,
    "gravity": without_gravity,
    "contact": without_contact,
    "free body": without_motion,
    "free surface": without_free_surface,
    "turbulence": without_turbulence,
}


def omissions(run: Run, result: Result) -> tuple[Omission, ...]:
    """Omitted effects that the scene has, with their estimated changes."""
    accuracy = accuracy_asked(run.scene.numerics)
    absent = [decision for decision in run.plan.effects if not decision.present]
    changes = [
        LEFT_OUT[decision.name](run, result, decision)
        for decision in absent
        if decision.name in LEFT_OUT
    ]
    return tuple(
        replace(change, exceeds=change.exceeds if (r := change.relative) is None else r > accuracy)
        for change in changes
        if change is not None
    )

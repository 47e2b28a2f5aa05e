"""Estimated changes of a result by effects that its run leaves out. Every function is collective.

A missing term T changes force and torque by -T(v)(z), with the computed flow v and the dual solution z of force or
torque (Becker & Rannacher 2001, Acta Numerica 10, 1; Oden & Prudhomme 2002, J. Comput. Phys. 182, 496). A large
estimate shows only that the effect matters.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import ufl

from .. import compat
from ..arrays import Floats, spatial
from ..fluid import Fluid
from ..fluid.flow import EXACT
from ..forms import terms
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
from ..results.loads import whole

if TYPE_CHECKING:
    from ..results.result import Result
    from .state import Run

Term = Callable[[Any, Any], Any]  # velocity and its test function to the integrand, both UFL

# Residual of dual solutions, for an error of a thousandth, measured in 3-D.
ROUGH = 1e-4


def without_inertia(run: Run, result: Result, decision: Decision) -> Omission | None:
    """Dual-weighted convection, or Oseen's term without error bars."""
    if decision.expected == 0.0:
        return None
    remedy = "set fluid.inertia = true and effects.inertia = true"
    if not run.scene.numerics.error_bars:
        how = "at most, from Oseen's term"
        return Omission(decision.name, decision.expected, how, False, remedy)
    where = run.fluid.reference_map
    return weighted(
        run, result, decision.name, lambda v, w: terms.convection(v, v, w, where), remedy
    )


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
    before, rate, fluid = transient.past[0], run.fluid.velocity, run.fluid
    values, length = fluid.state.x.array - before.state, fluid.time - before.time
    rate.x.array[:] = values[fluid.space.velocity_map] / length
    return weighted(
        run, result, name, lambda v, w: terms.inertia(rate, w, fluid.reference_map), remedy
    )


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
    none = Omission(decision.name, None, "without it there is no verdict", False)
    return none if decision.forced else None


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
    how, is_large = "of the depth, from the pressure under the lid over gravity", rise > 1.0
    if is_large:
        how = f"the pressure under the lid is that of {rise:.2g} depths, as after an impulse"
    return Omission(decision.name, None if is_large else rise, how, is_large, remedy)


def rise_under_lid(run: Run) -> float:
    """Largest pressure head under the lid, relative to the outflow or, in a closed domain, the mean. Collective."""
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
    how, remedy = transition(run.setup), f"the flow computed is the laminar one; {REMEDY}"
    if run.scene.flow.kind == "log-law":
        how = "gusts, and mixing in the wake; the base flow is the mean of a turbulent flow"
        remedy = "loads are those of the mean flow, gusts exceed them"
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
    known = [decision for decision in run.plan.effects if decision.name in LEFT_OUT]
    changes = [LEFT_OUT[effect.name](run, result, effect) for effect in known if not effect.present]
    return tuple(
        replace(change, exceeds=change.exceeds if (r := change.relative) is None else r > accuracy)
        for change in changes
        if change is not None
    )


# -- first-order changes by a missing term ----------------------------------------------------------


def weighted(run: Run, result: Result, name: str, term: Term, remedy: str) -> Omission:
    """Change of force and torque by a missing term, or of the velocity without a grain. Collective."""
    # The lower-order flow, with an assembled matrix, is accurate enough.
    force, torque, fluid = result.force, result.torque, run.fluid.coarse or run.fluid
    with_factors_of_steady_flow(fluid)
    (v, _), (w, _) = ufl.split(fluid.state), ufl.TestFunctions(fluid.space.mixed)
    tested = compat.owned_entries(compat.form(term(v, w) * fluid.space.quadrature()))
    if force is None or torque is None:
        how = "of the velocity on average, linear"
        return Omission(name, change_of_velocity(fluid, tested), how, False, remedy)
    about = torque.about[: fluid.space.gdim]
    forces, torques = np.split(change_of_loads(fluid, tested, about), 2)
    # A torque that vanishes by symmetry is scaled with half the grain's size times the force.
    size = float(np.linalg.norm(force.flow))
    arm = max(float(np.linalg.norm(torque.flow)), 0.5 * run.scene.grain.size * size)
    sizes = float(np.linalg.norm(forces)), float(np.linalg.norm(torques))
    relative = max(sizes[0] / max(size, 1e-300), sizes[1] / max(arm, 1e-300))
    return Omission(name, relative, "dual-weighted, linear", False, remedy, forces, torques)


def with_factors_of_steady_flow(fluid: Fluid) -> None:
    """Factorise the fluid's steady equations, linearised about its unchanged state. Collective."""
    if fluid.model.linear and not fluid.model.unsteady:
        return
    fluid.discretise_time((0.0, 0.0, 0.0), (1.0, 0.0))
    fluid.linearise()
    fluid.renew_factors()


def change_of_loads(fluid: Fluid, tested: Floats, about: Floats) -> Floats:
    """First-order change of force and torque (6,) on the grain by a missing term. Collective.

    Args:
        fluid: solved, with its steady equations factorised.
        tested: owned entries of the term's vector, on the left-hand side of the momentum equation.
        about: reference point (gdim,) of the torque.
    """
    from ..coupled.tractions import rigid_motion, shares_of_the_whole  # not without a grain

    shares = shares_of_the_whole(fluid)
    mine = np.zeros(len(shares))
    for k in np.flatnonzero(shares):
        motion = rigid_motion(fluid, "body", about, np.diag(shares)[k])
        mine[k] = tested @ fluid.dual(motion, ROUGH)[: len(tested)]
    return whole(-fluid.domain.comm.allreduce(mine))


def change_of_velocity(fluid: Fluid, tested: Floats) -> float:
    """First-order relative change of the velocity by a missing term, root mean square. Collective."""
    matrix = fluid.solver.matrix
    right, change = matrix.createVecLeft(), matrix.createVecRight()
    right.setArray(tested)
    compat.set_zero(right, fluid.constraints.dirichlet)
    fluid.solver.solve(right, change, EXACT)
    relative = fluid.relative(change.array_r)
    for held in (right, change):
        held.destroy()
    return relative

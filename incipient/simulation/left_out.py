"""What the effects left out would have changed, estimated from the flow that was computed.

A term T that is missing in the equations changes force and couple, to first order, by -T(v)(z): the term at the
computed flow v, tested with the solution z of the dual problem of force or couple (Becker & Rannacher 2001, Acta
Numerica 10, 1; Oden & Prudhomme 2002, J. Comput. Phys. 182, 496, for errors of models). On the same elements that
is one assembly, and a linear solution for each of force and couple. Of the second order in the
term nothing is known: an estimate that is not small says that the effect matters, not by how much.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Floats, spatial
from ..planning.effects import EffectName, accuracy_asked
from ..planning.transition import REMEDY, transition
from ..results.left_out import Omission
from ..scene.open_channel import STREAMS

if TYPE_CHECKING:
    from ..fluid import Fluid
    from ..planning.effects import Effect
    from ..results.loads import Couples, Forces
    from .state import Run

Term = Callable[[Any, Any], Any]  # velocity and its test function to the integrand, both UFL

# Residual of the dual solutions of what is said in two digits: a thousandth of them, where it was measured in space.
ROUGH = 1e-4


def omissions(
    run: Run, force: Forces | None, couple: Couples | None, verdict: dict[str, Any] | None
) -> tuple[Omission, ...]:
    """The effects of the plan that were left out though the scene has them, and what they would change. Collective."""
    accuracy, found = accuracy_asked(run.scene), []
    for effect in run.plan.effects:
        if effect.present:
            continue
        for one in _ESTIMATES.get(effect.name, _nothing)(run, effect, force, couple, verdict):
            unknown = one.relative is None and one.exceeds
            too_much = one.relative is not None and one.relative > accuracy
            found.append(_replaced(one, unknown or too_much))
    return tuple(found)


def _replaced(one: Omission, exceeds: bool) -> Omission:
    return Omission(one.name, one.relative, one.how, exceeds, one.remedy, one.force, one.couple)


# -- one effect each --------------------------------------------------------------------------------


def _nothing(*given: Any) -> Iterator[Omission]:
    return iter(())


def _inertia(run: Run, effect: Effect, *loads: Any) -> Iterator[Omission]:
    scene, remedy = run.scene, "set fluid.inertia = true and effects.inertia = true"
    if effect.expected == 0.0:
        return
    if not scene.numerics.error_bars:
        yield Omission(effect.name, effect.expected, "by Oseen's term, at most", False, remedy)
        return
    yield _weighted(run, effect.name, _convection, remedy, *loads[:2])


def _unsteadiness(run: Run, effect: Effect, *loads: Any) -> Iterator[Omission]:
    scene = run.scene
    if scene.time is None:
        _, _, risk = effect.reason.partition("; ")
        if risk:
            yield Omission(effect.name, None, risk, True, "add a section [time]")
        return
    remedy = 'set effects.unsteadiness = "auto"'
    transient = run.time_stepper
    if not scene.numerics.error_bars or transient is None or not transient.past:
        how = "history force, pressure gradient and added mass, leading terms"
        yield Omission(effect.name, effect.expected, how, False, remedy)
        return
    before = transient.past[0]
    rate = run.fluid.velocity
    values = run.fluid.state.x.array - before.state
    length = run.fluid.time - before.time
    rate.x.array[:] = values[run.fluid.space.velocity_map] / length
    yield _weighted(run, effect.name, _rate(rate), remedy, *loads[:2])


def _gravity(run: Run, effect: Effect, force: Forces | None, *rest: Any) -> Iterator[Omission]:
    """Weight and buoyancy, which need no estimate."""
    scene = run.scene
    if not effect.forced or scene.gravity is None or scene.grain is None or force is None:
        return
    excess = (scene.mass or 0.0) - scene.grain.volume
    change = excess * scene.gravity.acceleration * spatial(scene.gravity_direction)
    relative = _ratio(change, force.flow)
    remedy = 'set effects.gravity = "auto"'
    yield Omission(effect.name, relative, "weight and buoyancy, exact", False, remedy, change, np.zeros(3))


def _contact(run: Run, effect: Effect, *loads: Any) -> Iterator[Omission]:
    if effect.forced:
        yield Omission(effect.name, None, "there is no verdict without it", False)


def _free_body(
    run: Run, effect: Effect, force: Any, couple: Any, verdict: dict[str, Any] | None
) -> Iterator[Omission]:
    """A grain that is held in time though it would have begun to move."""
    since = None if verdict is None else verdict.get("first_motion")
    if since is not None:
        yield Omission(effect.name, None, f"the grain moves from t = {since:.4g} on, but was held", False)


def _free_surface(run: Run, effect: Effect, *loads: Any) -> Iterator[Omission]:
    """What the pressure under a rigid lid would raise, or lower, a surface by, of the depth."""
    if effect.expected is not None:
        rise = _rise_under_lid(run) / (run.scene.domain.ceiling - run.scene.datum)
        how = "of the depth, by the pressure under the lid over gravity"
        may_be = run.scene.domain.kind == "box" or run.scene.flow.kind in STREAMS
        may_be = may_be and not run.scene.is_turbulent
        remedy = 'domain.top = "free-surface"' if may_be else "a deeper channel"
        if rise > 1.0:
            how = f"the pressure under the lid is that of {rise:.2g} depths, as after an impulse"
            yield Omission(effect.name, None, how, True, remedy)
            return
        yield Omission(effect.name, rise, how, False, remedy)


def _rise_under_lid(run: Run) -> float:
    """The largest size of the pressure's head at the nodes under the lid; zero at the outflow, or in the mean."""
    from mpi4py import MPI

    from ..fluid.space import boundary_blocks
    from ..planning.cells import side_names

    scene, fluid, comm = run.scene, run.fluid, run.comm
    space, gravity = fluid.space.pressure, scene.gravity_vector
    nodes = boundary_blocks(space, fluid.domain.facets_of(side_names(scene)[2]))
    own = nodes[nodes < space.dofmap.index_map.size_local]
    away = space.tabulate_dof_coordinates()[own, 0] - scene.domain.right
    # The hydrostatic part that the pressure does not have changes along a lid that is inclined.
    heads = (fluid.pressure.x.array[own] + gravity[0] * away) / abs(gravity[scene.up])
    if fluid.constraints.closed:
        total, count = comm.allreduce(np.array([heads.sum(), len(heads)]))
        heads -= total / max(count, 1)
    return float(comm.allreduce(float(np.abs(heads).max(initial=0.0)), op=MPI.MAX))


def _turbulence(run: Run, effect: Effect, *loads: Any) -> Iterator[Omission]:
    numbers, scene = run.plan.numbers, run.scene
    if scene.flow.kind == "log-law":
        how = "gusts, and mixing in the wake; the stream is the mean of a turbulent one"
        yield Omission(effect.name, None, how, True, "loads are those of the mean stream, gusts exceed them")
    elif numbers is not None and (found := transition(scene, numbers)):
        how = f"{found.number} {found.value:.4g} is above {found.least:g}"
        yield Omission(effect.name, None, how, True, f"the flow computed is the laminar one; {REMEDY}")


_ESTIMATES: dict[EffectName, Callable[..., Iterator[Omission]]] = {
    EffectName.INERTIA: _inertia,
    EffectName.UNSTEADINESS: _unsteadiness,
    EffectName.GRAVITY: _gravity,
    EffectName.CONTACT: _contact,
    EffectName.FREE_BODY: _free_body,
    EffectName.FREE_SURFACE: _free_surface,
    EffectName.TURBULENCE: _turbulence,
}


# -- terms weighted with dual solutions -------------------------------------------------------------


def _convection(v: Any, w: Any) -> Any:
    from ..forms.terms import convection

    return convection(v, v, w)


def _rate(rate: Any) -> Term:
    from ..forms.terms import inertia

    return lambda v, w: inertia(rate, w)


def _weighted(
    run: Run, name: str, term: Term, remedy: str, force: Forces | None, couple: Couples | None
) -> Omission:
    """The change of force and couple by a missing term; without a grain, that of the velocity."""
    # To first order the flow of lower order does, whose matrix is there.
    fluid, grain = run.fluid.coarse or run.fluid, run.scene.grain
    with_factors_of_steady_flow(fluid)
    if force is None or couple is None or grain is None:
        how = "of the velocity in the mean, linear"
        return Omission(name, change_of_velocity(fluid, term), how, False, remedy)
    forces, couples = change_of_loads(fluid, term, "body", couple.about[: fluid.space.gdim].tolist())
    # A couple may vanish by symmetry: it then is compared with half the grain's size times the force.
    arm = 0.5 * grain.size * float(np.linalg.norm(force.flow))
    of_couple = float(np.linalg.norm(couples)) / max(float(np.linalg.norm(couple.flow)), arm, 1e-300)
    relative = max(_ratio(forces, force.flow), of_couple)
    return Omission(name, relative, "dual-weighted, linear", False, remedy, forces, couples)


def with_factors_of_steady_flow(fluid: Fluid) -> None:
    """Let the fluid's factors be those of its steady equations, linearised about its state. Collective.

    The state stays; of an unsteady fluid the next step sets everything anew.
    """
    if fluid.model.linear and not fluid.model.unsteady:
        return
    state = fluid.state.x.array.copy()
    fluid.discretise_time((0.0, 0.0, 0.0), (1.0, 0.0))
    fluid.correct()
    fluid.state.x.array[:] = state
    fluid.renew_factors()


def change_of_loads(fluid: Fluid, term: Term, boundary: str, about: Sequence[float]) -> tuple[Floats, Floats]:
    """The change of force (3,) and couple (3,) on a boundary by a missing term, to first order. Collective.

    Args:
        fluid: solved, with factors of its steady equations at hand.
        term: the integrand, on the left-hand side of the momentum equation.
        about: point (gdim,) that the couple refers to.
    """
    from ..coupled.tractions import shares_of_the_whole

    tested, gdim = _tested(fluid, term), fluid.space.gdim
    shares = shares_of_the_whole(fluid.domain)
    size, owned, mine = len(shares), len(tested), np.zeros(len(shares))
    for k in np.flatnonzero(shares):
        goal = shares[k] * np.eye(size)[k]
        motion = _rigid_motion(fluid, boundary, about, goal)
        mine[k] = tested @ fluid.dual(motion, ROUGH)[:owned]
    changes = -fluid.domain.comm.allreduce(mine)
    force, couple = np.zeros(3), np.zeros(3)
    force[:gdim] = changes[:gdim]
    couple[-(size - gdim) :] = changes[gdim:]
    return force, couple


def change_of_velocity(fluid: Fluid, term: Term) -> float:
    """The mean change of the velocity by a missing term, relative to it, to first order. Collective."""
    from .. import compat
    from ..fluid.flow import EXACT

    matrix = fluid.solver.matrix
    right, change = matrix.createVecLeft(), matrix.createVecRight()
    right.setArray(_tested(fluid, term))
    compat.set_zero(right, fluid.constraints.dirichlet)
    fluid.solver.solve(right, change, EXACT)
    size = fluid.squared_velocities(change.array_r)
    whole = fluid.squared_velocities(fluid.state.x.array)
    for held in (right, change):
        held.destroy()
    return float(np.sqrt(size / whole)) if whole else 0.0


def _tested(fluid: Fluid, term: Term) -> Floats:
    """(owned unknowns,) the term at the fluid's state against every test function."""
    import ufl

    from .. import compat
    from ..compat import PETSc, petsc

    v, _ = ufl.split(fluid.state)
    w, _ = ufl.TestFunctions(fluid.space.mixed)
    vector = petsc.assemble_vector(compat.form(term(v, w) * fluid.space.quadrature()))
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    values = vector.array_r.copy()
    vector.destroy()
    return np.asarray(values)


def _rigid_motion(fluid: Fluid, boundary: str, about: Sequence[float], goal: Floats) -> Floats:
    """(local unknowns,) a rigid motion (3 or 6,) of the boundary about a point, zero elsewhere."""
    from ..body.state import turned
    from ..fluid.space import boundary_blocks

    space, gdim = fluid.space, fluid.space.gdim
    blocks = boundary_blocks(space.velocity, fluid.domain.facets_of(boundary))
    arms = fluid.constraints.points[blocks, :gdim] - np.asarray(about, dtype=float)
    values = np.zeros_like(fluid.state.x.array)
    values[space.velocity_map.reshape(-1, gdim)[blocks]] = goal[:gdim] + turned(goal[gdim:], arms)
    return values


def _ratio(change: Floats, whole: Floats) -> float:
    return float(np.linalg.norm(change)) / max(float(np.linalg.norm(whole)), 1e-300)

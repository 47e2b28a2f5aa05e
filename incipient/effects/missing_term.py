"""First-order change of a computed flow by a term that is missing in the equations.

A term T changes force and torque by -T(v)(z): the term at the computed flow v, tested with the solution z of the dual
problem of force or torque (Becker & Rannacher 2001, Acta Numerica 10, 1; Oden & Prudhomme 2002, J. Comput. Phys. 182,
496, for errors of models). On the same elements that is one assembly, and a linear solution for each of force and
torque. Nothing is known of the second order in the term: an estimate that is not small says that the effect matters,
not by how much.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import ufl

from .. import compat
from ..arrays import Floats
from ..compat import PETSc, petsc
from ..coupled.tractions import rigid_motion, shares_of_the_whole
from ..fluid import Fluid
from ..fluid.flow import EXACT
from ..results.left_out import Omission
from .effect import Solved

Term = Callable[[Any, Any], Any]  # velocity and its test function to the integrand, both UFL

# Residual of the dual solutions of estimates of two digits: an error of a thousandth, measured in 3-D.
ROUGH = 1e-4


def weighted(solved: Solved, name: str, term: Term, remedy: str) -> Omission:
    """The change of force and torque by a missing term; without a grain, that of the velocity. Collective."""
    # The lower-order flow, whose matrix is assembled, is accurate enough to first order.
    run, force, torque = solved.run, solved.force, solved.torque
    fluid, grain = run.fluid.coarse or run.fluid, run.scene.grain
    with_factors_of_steady_flow(fluid)
    if force is None or torque is None or grain is None:
        how = "of the velocity on average, linear"
        return Omission(name, change_of_velocity(fluid, term), how, False, remedy)
    forces, torques = change_of_loads(
        fluid, term, "body", torque.about[: fluid.space.gdim].tolist()
    )
    # A torque may vanish because of symmetry: it is then compared with half the grain's size times the force.
    arm = 0.5 * grain.size * float(np.linalg.norm(force.flow))
    relative_torque = float(np.linalg.norm(torques)) / max(
        float(np.linalg.norm(torque.flow)), arm, 1e-300
    )
    relative = max(_ratio(forces, force.flow), relative_torque)
    return Omission(name, relative, "dual-weighted, linear", False, remedy, forces, torques)


def with_factors_of_steady_flow(fluid: Fluid) -> None:
    """Factorise the fluid's steady equations, linearised about its state. Collective.

    The state stays; of an unsteady fluid the next step sets everything again.
    """
    if fluid.model.linear and not fluid.model.unsteady:
        return
    state = fluid.state.x.array.copy()
    fluid.discretise_time((0.0, 0.0, 0.0), (1.0, 0.0))
    fluid.correct()
    fluid.state.x.array[:] = state
    fluid.renew_factors()


def change_of_loads(
    fluid: Fluid, term: Term, boundary: str, about: Sequence[float]
) -> tuple[Floats, Floats]:
    """The change of force (3,) and torque (3,) on a boundary by a missing term, to first order. Collective.

    Args:
        fluid: solved, with its steady equations factorised.
        term: the integrand, on the left-hand side of the momentum equation.
        about: point (gdim,) that the torque refers to.
    """
    tested, gdim = _tested(fluid, term), fluid.space.gdim
    shares = shares_of_the_whole(fluid.domain)
    size, owned, mine = len(shares), len(tested), np.zeros(len(shares))
    for k in np.flatnonzero(shares):
        goal = shares[k] * np.eye(size)[k]
        motion = rigid_motion(fluid, boundary, about, goal)
        mine[k] = tested @ fluid.dual(motion, ROUGH)[:owned]
    changes = -fluid.domain.comm.allreduce(mine)
    force, torque = np.zeros(3), np.zeros(3)
    force[:gdim] = changes[:gdim]
    torque[-(size - gdim) :] = changes[gdim:]
    return force, torque


def change_of_velocity(fluid: Fluid, term: Term) -> float:
    """The mean change of the velocity by a missing term, relative to it, to first order. Collective."""
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
    v, _ = ufl.split(fluid.state)
    w, _ = ufl.TestFunctions(fluid.space.mixed)
    vector = petsc.assemble_vector(compat.form(term(v, w) * fluid.space.quadrature()))
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    values = vector.array_r.copy()
    vector.destroy()
    return np.asarray(values)


def _ratio(change: Floats, whole: Floats) -> float:
    return float(np.linalg.norm(change)) / max(float(np.linalg.norm(whole)), 1e-300)

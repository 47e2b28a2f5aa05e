"""First-order change of a computed flow by a term missing in the equations.

A term T changes force and torque by -T(v)(z), with the computed flow v and the dual solution z of
force or torque (Becker & Rannacher 2001, Acta Numerica 10, 1; Oden & Prudhomme 2002, J. Comput.
Phys. 182, 496). A large estimate shows only that the effect matters.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import ufl

from .. import compat
from ..arrays import Floats
from ..coupled.tractions import rigid_motion, shares_of_the_whole
from ..fluid import Fluid
from ..fluid.flow import EXACT
from ..results.accuracy import Omission
from ..results.loads import whole

if TYPE_CHECKING:
    from ..results.result import Result
    from .state import Run

Term = Callable[[Any, Any], Any]  # velocity and its test function to the integrand, both UFL

# Residual of dual solutions, for an error of a thousandth, measured in 3-D.
ROUGH = 1e-4


def weighted(run: Run, result: Result, name: str, term: Term, remedy: str) -> Omission:
    """Change of force and torque by a missing term, or of the velocity without a grain. Collective."""
    # The lower-order flow, with an assembled matrix, is accurate enough.
    force, torque, fluid = result.force, result.torque, run.fluid.coarse or run.fluid
    with_factors_of_steady_flow(fluid)
    if force is None or torque is None:
        how = "of the velocity on average, linear"
        return Omission(name, change_of_velocity(fluid, term), how, False, remedy)
    about = torque.about[: fluid.space.gdim]
    forces, torques = np.split(change_of_loads(fluid, term, "body", about), 2)
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


def change_of_loads(fluid: Fluid, term: Term, boundary: str, about: Floats) -> Floats:
    """First-order change of force and torque (6,) on a boundary by a missing term. Collective.

    Args:
        fluid: solved, with its steady equations factorised.
        term: integrand on the left-hand side of the momentum equation.
        about: reference point (gdim,) of the torque.
    """
    tested, shares = _tested(fluid, term), shares_of_the_whole(fluid)
    mine = np.zeros(len(shares))
    for k in np.flatnonzero(shares):
        motion = rigid_motion(fluid, boundary, about, np.diag(shares)[k])
        mine[k] = tested @ fluid.dual(motion, ROUGH)[: len(tested)]
    return whole(-fluid.domain.comm.allreduce(mine))


def change_of_velocity(fluid: Fluid, term: Term) -> float:
    """First-order relative change of the velocity by a missing term, root mean square. Collective."""
    matrix = fluid.solver.matrix
    right, change = matrix.createVecLeft(), matrix.createVecRight()
    right.setArray(_tested(fluid, term))
    compat.set_zero(right, fluid.constraints.dirichlet)
    fluid.solver.solve(right, change, EXACT)
    relative = fluid.relative(change.array_r)
    for held in (right, change):
        held.destroy()
    return relative


def _tested(fluid: Fluid, term: Term) -> Floats:
    v, _ = ufl.split(fluid.state)
    w, _ = ufl.TestFunctions(fluid.space.mixed)
    return compat.owned_entries(compat.form(term(v, w) * fluid.space.quadrature()))

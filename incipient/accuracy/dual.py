"""How far a steady force and torque are from converged: the dual-weighted residual, goal by goal.

The computed flow is put into elements of the next-higher order on the same mesh. One Newton correction there, with
fresh factors, gives force and torque as they would be with that order: the difference is the estimated error.
The same number is minus the residual of the computed flow weighted with the solution of the dual problem, the
sensitivity of the goal to forces anywhere in the fluid (Becker and Rannacher 2001). The weighted residual,
split by the hat functions of the mesh (Richter and Wick 2015), says where the error comes from.

What neither sees: the geometry of curved boundaries, which both orders share, and whatever the scene
leaves out.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from .. import compat
from ..arrays import Floats
from ..compat import petsc
from ..coupled.tractions import Resultant, TractionProbe, rigid_motion, shares_of_the_whole
from ..fluid import Fluid
from ..fluid.flow import enriched
from ..fluid.solvers.two_level import ROUGH
from ..fluid.space import boundary_blocks
from ..results.errorbars import Loads
from .terms import SAFETY

LEAST_TORQUE = 0.1  # of what the force at the boundary would turn by: smaller changes do not count


class GoalErrors:
    """Estimated errors of the force and torque on a boundary. Every method is collective.

    Holds PETSc objects: use it as a context manager.

    Args:
        fluid: the solved steady flow; left as it is.
        boundary: whose force and torque are looked at.
        about: point (gdim,) that torques refer to.
    """

    def __init__(self, fluid: Fluid, boundary: str, about: Sequence[float]):
        self.fluid = fluid
        self.computed = TractionProbe(fluid, boundary, about).resultant()
        self._boundary, self._about = boundary, np.asarray(about, dtype=float)
        self.finer = enriched(fluid)
        with ExitStack() as on_failure:
            on_failure.push(self.finer)
            self.finer.interpolate(fluid)
            self._before = self.finer.state.x.array.copy()
            self.finer.correct()
            self.improved: Resultant = TractionProbe(self.finer, boundary, about).resultant()
            on_failure.pop_all()

    def __enter__(self) -> GoalErrors:
        return self

    def __exit__(self, *exception: Any) -> None:
        self.finer.__exit__(*exception)

    @property
    def allowance(self) -> float:
        """What an estimate is to be multiplied with where it stands for a bound, as it does in error bars."""
        return SAFETY if self.fluid.space.gdim == 3 else 1.0

    @property
    def force(self) -> Floats:
        """(3,) computed force less that of the finer elements."""
        return self.computed.force - self.improved.force

    @property
    def torque(self) -> Floats:
        """(3,) computed torque less that of the finer elements."""
        return self.computed.torque - self.improved.torque

    def loads(self, unit: float) -> Loads:
        """Force and torque with the estimated errors taken away, in a unit of the fluid's loads."""
        return Loads(unit * self.improved.force, unit * self.improved.torque)

    @property
    def is_upwinded(self) -> bool:
        """Whether the flow is upwinded where its correction is not, so that one may not be enough."""
        return self.fluid.model.upwind and self.finer.model.exact

    def correct_again(self) -> float:
        """Make one more correction; how much of all that is corrected by now it was, the more of force and torque.

        The residual is that without upwinding, the Jacobian that with it: a correction leaves some of what upwinding
        changes, and the next one tells how much. `force` and `torque` then are those of both. A torque that hardly
        changes, against the force at the boundary's largest distance, tells nothing.
        """
        before = self.improved
        self.finer.correct()
        self.improved = TractionProbe(self.finer, self._boundary, self._about.tolist()).resultant()
        last, both = (
            float(np.linalg.norm(vector))
            for vector in (before.force - self.improved.force, self.force)
        )
        torques = before.torque - self.improved.torque, self.torque
        turned_last, turned_both = (float(np.linalg.norm(vector)) for vector in torques)
        least = max(LEAST_TORQUE * both * self._reach, 1e-300)
        return max(last / max(both, 1e-300), turned_last / max(turned_both, least))

    @property
    def _reach(self) -> float:
        """The largest distance of the boundary from what torques refer to. Collective."""
        space = self.finer.space
        blocks = boundary_blocks(space.velocity, self.fluid.domain.facets_of(self._boundary))
        arms = self.finer.constraints.points[blocks, : space.gdim] - self._about
        mine = float(np.linalg.norm(arms, axis=1).max(initial=0.0))
        return float(self.fluid.domain.comm.allreduce(mine, op=MPI.MAX))

    def shares(self, goal: Floats) -> Floats:
        """What each local vertex of the mesh contributes to the error of a goal: (vertices, ghosts included).

        `goal` (k,), k = 3 in 2-D and 6 in 3-D, weights force and torque: the goal is their sum. The
        contributions of all owned vertices add up to the error up to what the correction leaves of it.
        """
        finer, corrected = self.finer, self.finer.state.x.array.copy()
        hats, weight, residual = finer.kept("shares", self._weighted_residual)
        self._weigh(goal, weight)
        finer.state.x.array[:] = self._before
        vector = petsc.assemble_vector(residual)
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        shares = dolfinx.fem.Function(hats)
        shares.x.array[: vector.getLocalSize()] = vector.array_r
        shares.x.scatter_forward()
        vector.destroy()
        finer.state.x.array[:] = corrected
        return np.asarray(shares.x.array)

    def _weighted_residual(self) -> tuple[Any, Any, Any]:
        """Linear elements, a weight in the finer ones, and the residual weighted with it by hat functions."""
        hats = compat.space(self.fluid.domain.mesh, ("Lagrange", 1))
        weight = dolfinx.fem.Function(self.finer.space.mixed)
        hat, (w, q) = ufl.TestFunction(hats), ufl.split(weight)
        residual = self.finer.residual_form(hat * w, hat * q, upwind=not self.finer.model.exact)
        return hats, weight, compat.form(residual)

    def _weigh(self, goal: Floats, weight: Any) -> None:
        """Make the weight the dual solution with the goal's boundary values, less its part in the flow's elements."""
        finer = self.finer
        goal = goal * shares_of_the_whole(finer.domain)
        motion = rigid_motion(finer, self._boundary, self._about, goal)
        weight.x.array[:] = finer.dual(motion, ROUGH)
        weight.x.scatter_forward()
        here, there = self.fluid.space, finer.space
        for coarse, space, mine in (
            (here.velocity, there.velocity, there.velocity_map),
            (here.pressure, there.pressure, there.pressure_map),
        ):
            part, function = dolfinx.fem.Function(space), dolfinx.fem.Function(coarse)
            part.x.array[:] = weight.x.array[mine]
            function.interpolate(part)
            part.interpolate(function)
            weight.x.array[mine] -= part.x.array

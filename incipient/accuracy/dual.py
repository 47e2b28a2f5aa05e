"""Discretisation errors of steady force and torque by dual-weighted residuals (Becker and Rannacher 2001).

One Newton update from the computed flow, in elements of the next-higher order on the same mesh, equals minus the
dual-weighted residual, whose localisation by hat functions (Richter and Wick 2015) gives the contributions of cells.
Errors of curved boundaries and of modelling are not included.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI

from .. import compat
from ..arrays import Floats
from ..coupled.tractions import Resultant, TractionProbe, rigid_motion, shares_of_the_whole
from ..fluid import Fluid
from ..fluid.flow import enriched
from ..fluid.solvers.two_level import ROUGH
from ..fluid.space import boundary_blocks
from ..parallel import Comm
from ..planning.layout import coarse_sizes
from ..results.errorbars import Loads
from ..scene import Scene
from ..simulation.build import prepared
from ..simulation.steady import loads_at, unit_of
from .terms import SAFETY

COARSER_CELLS = 1.5  # factor on the cells of the run with improved loads
LEAST_TORQUE = (
    0.1  # of the force change times the boundary's radius: smaller changes of torque are ignored
)


class GoalErrors:
    """Estimated errors of the force and torque on a boundary. Context manager; every method is collective.

    Args:
        fluid: the solved steady flow, unchanged.
        about: reference point (gdim,) of torques.
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
        return SAFETY if self.fluid.space.gdim == 3 else 1.0

    @property
    def force(self) -> Floats:
        """Computed force less that of the finer elements, (3,)."""
        return self.computed.force - self.improved.force

    @property
    def torque(self) -> Floats:
        """Computed torque less that of the finer elements, (3,)."""
        return self.computed.torque - self.improved.torque

    def loads(self, unit: float) -> Loads:
        return Loads(unit * self.improved.force, unit * self.improved.torque)

    @property
    def is_upwinded(self) -> bool:
        """Whether the flow is upwinded but its update is not: one update may not suffice."""
        return self.fluid.model.upwind and self.finer.coarse is not None

    def correct_again(self) -> float:
        """Make a second Newton update, included in `force` and `torque`; returns its fraction of the total change.

        The residual is without upwinding, the Jacobian with it. Small changes of torque are ignored.
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
        space = self.finer.space
        blocks = boundary_blocks(space.velocity, self.fluid.domain.facets_of(self._boundary))
        arms = self.finer.constraints.points[blocks, : space.gdim] - self._about
        mine = float(np.linalg.norm(arms, axis=1).max(initial=0.0))
        return float(self.fluid.domain.comm.allreduce(mine, op=MPI.MAX))

    def shares(self, goal: Floats) -> Floats:
        """Contributions (vertices, ghosts included) of local vertices to the error of a goal.

        goal: (k,), k = 3 in 2-D and 6 in 3-D, weights of force and torque

        Those of owned vertices add up to the error, less the remainder of the Newton update.
        """
        finer, corrected = self.finer, self.finer.state.x.array.copy()
        hats, weight, residual = finer.kept("shares", self._weighted_residual)
        self._weigh(goal, weight)
        finer.state.x.array[:] = self._before
        entries, shares = compat.owned_entries(residual), dolfinx.fem.Function(hats)
        shares.x.array[: len(entries)] = entries
        shares.x.scatter_forward()
        finer.state.x.array[:] = corrected
        return np.asarray(shares.x.array)

    def _weighted_residual(self) -> tuple[Any, Any, Any]:
        hats = compat.space(self.fluid.domain.mesh, ("Lagrange", 1))
        weight = dolfinx.fem.Function(self.finer.space.mixed)
        hat, (w, q) = ufl.TestFunction(hats), ufl.split(weight)
        residual = self.finer.residual_form(hat * w, hat * q, upwind=self.finer.coarse is None)
        return hats, weight, compat.form(residual)

    def _weigh(self, goal: Floats, weight: Any) -> None:
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


def improved_loads(scene: Scene, comm: Comm, speed: float = 1.0) -> Loads:
    """Force and torque of a steady flow on coarser cells, less their estimated errors. Collective."""
    sizing = partial(coarse_sizes, COARSER_CELLS, None)
    with prepared(scene, comm, sizing=sizing, speed=speed) as run:
        loads_at(run, speed)
        assert run.layout.placement is not None
        with GoalErrors(run.fluid, "body", run.layout.placement.centre) as goals:
            if goals.is_upwinded:
                goals.correct_again()
            return goals.loads(unit_of(run, speed))

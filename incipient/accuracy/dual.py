"""Discretisation errors of steady force and torque by dual-weighted residuals (Becker and Rannacher 2001).

One Newton update from the computed flow, in elements of the next-higher order on the same mesh, equals minus the
dual-weighted residual, whose localisation by hat functions (Richter and Wick 2015) gives the contributions of cells.
Errors of curved boundaries and of modelling are not included.

A cell of size h contributes h^(2k + d) to the error of a force in smooth flow, with the velocity's order k and the
dimension d. Equal contributions need the fewest cells (Becker and Rannacher 2001): h_new = h (c / share)^(1 / (2k +
d)), with c from the target error.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import Any

import dolfinx
import numpy as np
import ufl

from .. import compat
from ..arrays import Floats, Integers
from ..coupled.tractions import TractionProbe, rigid_motion, shares_of_the_whole
from ..fluid import Fluid
from ..fluid.flow import enriched
from ..fluid.solvers.two_level import ROUGH
from ..meshes import SizeField
from ..meshes.layers import evened
from ..parallel import Comm, joined
from ..planning.meshing import STEEPEST, coarse_sizes
from ..results.errorbars import Loads, Term
from ..scene import Scene
from ..simulation.build import prepared
from ..simulation.state import Run
from ..simulation.steady import loads_at, unit_of
from .terms import SAFETY

# Range of the size relative to the old one: contributions do not predict those of much smaller cells.
SMALLEST, LARGEST = 0.2, 2.0


@contextmanager
def goal_errors(
    fluid: Fluid, boundary: str, about: Sequence[float], unit: float = 1.0
) -> Iterator[GoalErrors]:
    """Estimate errors of the force and torque on a boundary. Collective.

    Args:
        fluid: the solved steady flow, unchanged.
        about: reference point (gdim,) of torques.
        unit: of the loads (`unit_of`).
    """
    with enriched(fluid) as finer:
        finer.interpolate(fluid)
        yield GoalErrors(fluid, finer, boundary, about, unit)


def errors_of_run(run: Run, speed: float = 1.0) -> AbstractContextManager[GoalErrors]:
    """Errors on the grain of a run."""
    assert run.layout.placement is not None
    return goal_errors(run.fluid, "body", run.layout.placement.centre, unit_of(run, speed))


class GoalErrors:
    """Estimates by a Newton update in finer elements; methods are collective."""

    def __init__(
        self, fluid: Fluid, finer: Fluid, boundary: str, about: Sequence[float], unit: float
    ):
        self.fluid, self.finer, self.unit = fluid, finer, unit
        self.allowance = SAFETY if fluid.space.gdim == 3 else 1.0
        # Whether the flow is upwinded but its update is not: one update may not suffice.
        self.is_upwinded = fluid.model.upwind and finer.coarse is not None
        self._boundary, self._about = boundary, np.asarray(about, dtype=float)
        self.computed = self._loads(fluid)
        self._before = finer.state.x.array.copy()
        finer.correct()
        self.improved = self._loads(finer)

    def _loads(self, fluid: Fluid) -> Loads:
        resultant = TractionProbe(fluid, self._boundary, self._about.tolist()).resultant()
        return Loads(self.unit * resultant.load)

    @property
    def error(self) -> Floats:
        """Computed force and torque (6,) less those of the finer elements."""
        return self.computed.load - self.improved.load

    def correct_again(self) -> float:
        """Make a second Newton update, included in `error`; returns its fraction of the force's change.

        The residual is without upwinding, the Jacobian with it.
        """
        before = self.improved
        self.finer.correct()
        self.improved = self._loads(self.finer)
        last, both = before.force - self.improved.force, self.error[:3]
        return float(np.linalg.norm(last)) / max(float(np.linalg.norm(both)), 1e-300)

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
        goal = self.unit * goal * shares_of_the_whole(finer)
        motion = rigid_motion(finer, self._boundary, self._about, goal)
        weight.x.array[:] = finer.dual(motion, ROUGH)
        weight.x.scatter_forward()
        parts = zip(self.fluid.space.parts, finer.space.parts, strict=True)
        for (coarse, _), (space, mine) in parts:
            part, function = dolfinx.fem.Function(space), dolfinx.fem.Function(coarse)
            part.x.array[:] = weight.x.array[mine]
            function.interpolate(part)
            part.interpolate(function)
            weight.x.array[mine] -= part.x.array


def improved_loads(scene: Scene, comm: Comm, speed: float = 1.0) -> Loads:
    """Force and torque of a steady flow on cells 1.5 times as large, less their estimated errors. Collective."""
    sizing = partial(coarse_sizes, 1.5, None)
    with prepared(scene, comm, sizing=sizing, speed=speed) as run:
        loads_at(run, speed)
        with errors_of_run(run, speed) as goals:
            if goals.is_upwinded:
                goals.correct_again()
            return goals.improved


def by_dual(goals: GoalErrors) -> Term:
    """The term of dual-weighted estimates, with their safety factor. Collective."""
    left, doubt = goals.correct_again() if goals.is_upwinded else 0.0, ""
    if left > 0.5:  # at half the geometric series is twice the first correction
        doubt = (
            f"upwinding changes the load strongly: the second of two corrections is {left:.0%} of both; use a smaller "
            "numerics.mesh_size"
        )
    error = goals.allowance * np.abs(goals.error)
    return Term("discretisation", error, "dual-weighted residual, next-higher order", doubt=doubt)


def by_both(term: Term, goals: GoalErrors, beside: Loads) -> Term:
    """The term corrected by its estimates, unless these and loads from other cells differ by more than the error."""
    apart = goals.improved.load - beside.load
    corrected = term.corrected(-goals.error, goals.allowance * np.abs(apart))
    if goals.allowance > 1.0 and np.linalg.norm(corrected.force) > np.linalg.norm(term.force):
        return term
    return replace(corrected, how=f"{term.how}, on larger cells as well")


# -- cell sizes ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Shares:
    """Mesh of simplices and contributions of its vertices to an error; complete on rank 0, elsewhere empty.

    points (n, gdim), cells (m, gdim + 1), errors (n,) not negative
    """

    points: Floats
    cells: Integers
    errors: Floats

    @property
    def dimension(self) -> int:
        return int(self.points.shape[1])

    @property
    def sizes(self) -> Floats:
        """Cell size (n,) around each vertex: side of a regular simplex of the mean volume."""
        corners, d = self.points[self.cells], self.dimension
        contents = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))  # volumes times d!
        sides = (contents * np.sqrt(2.0**d / (d + 1.0))) ** (1.0 / d)
        return _mean_around(self.cells, sides, len(self.points))


def gathered(mesh: Any, parts: list[Floats]) -> Shares:
    """Root sum of squares of the contributions (local vertices,) to several goals. Collective.

    Vertices are numbered as in linear elements (`dual.GoalErrors.shares`).
    """
    comm, hats = mesh.comm, compat.space(mesh, ("Lagrange", 1))
    nodes = hats.dofmap.index_map
    owned = nodes.size_local
    numbers = nodes.local_to_global(np.arange(owned + nodes.num_ghosts, dtype=np.int32))
    cells = mesh.topology.index_map(mesh.topology.dim).size_local
    errors = np.sqrt(np.sum(np.square(parts), axis=0))
    return Shares(
        joined(comm, hats.tabulate_dof_coordinates()[:owned, : mesh.geometry.dim]),
        joined(comm, numbers[compat.cell_dofs(hats)[:cells]]).astype(np.int64),
        joined(comm, errors[:owned]),
    )


def resized(
    shares: Shares, order: int, relative: float, comm: Comm
) -> tuple[SizeField | None, float]:
    """Cell sizes expected to reduce the sum of contributions to a fraction `relative`. Collective.

    Returns the size field (None except on rank 0), and the number of cells relative to this mesh; `order` is that of
    the velocity on the new mesh.
    """
    field, more = None, 1.0
    if comm.rank == 0:
        before, around = shares.sizes, shares.errors[shares.cells].mean(axis=1)
        smooth = _mean_around(shares.cells, around, len(shares.points))
        errors = np.maximum(smooth, 1e-3 * smooth.mean())
        factors = _factors(errors, order, relative, shares.dimension)
        sizes = _gently_growing(shares, before * factors)
        field = SizeField(shares.points, shares.cells, sizes)
        more = float(np.mean(((before / sizes) ** shares.dimension)[shares.cells]))
    return field, comm.bcast(more, root=0)


def _factors(errors: Floats, order: int, relative: float, dimension: int) -> Floats:
    rate, level = 2 * order, 1.0
    shape = (errors.mean() / errors) ** (1.0 / (rate + dimension))
    for _ in range(20):  # for the sum of bounded contributions
        factors = np.clip(level * shape, SMALLEST, LARGEST)
        left = np.sum(errors * factors**rate) / np.sum(errors)
        level *= (relative / left) ** (1.0 / rate)
    return factors


def _gently_growing(shares: Shares, sizes: Floats) -> Floats:
    pairs = combinations(range(shares.dimension + 1), 2)
    edges = np.vstack([shares.cells[:, pair] for pair in pairs])
    lengths = np.linalg.norm(np.subtract(*shares.points[edges.T]), axis=1)
    return evened(sizes, edges, STEEPEST * lengths)


def _mean_around(cells: Integers, values: Floats, vertices: int) -> Floats:
    rows, each = cells.ravel(), np.repeat(values, cells.shape[1])
    sums = np.bincount(rows, each, minlength=vertices)
    return sums / np.maximum(np.bincount(rows, minlength=vertices), 1)

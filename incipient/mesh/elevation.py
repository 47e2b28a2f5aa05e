"""Vertical displacement of a mesh below a free surface.

A node's rise w solves LEVELLING w_xx + w_yy = 0 on the initial mesh: the elevation on the surface, zero on the bed and
on bodies, free along the sides. Cells fold at slopes of 1/sqrt(LEVELLING). Nodes keep their horizontal positions, so
that the matrix of the kinematic condition is constant.
"""

from __future__ import annotations

from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from .. import compat
from ..arrays import Floats
from ..forms.surface import below
from ..parallel import Owner
from .domain import Domain

LEVELLING = 0.04  # weight of the horizontal slopes of the rise against the vertical one


class RisingDisplacement(Owner):
    """The displacement of a mesh by the elevation of its surface. Holds PETSc objects; all is collective.

    Args:
        domain: with its initial mesh and level surface.
        space: scalar functions on the mesh's own nodes.
        boundary: name of the surface.
        held: names of the boundaries with fixed nodes.
        pinned: names of the boundaries at which the surface's nodes are fixed.
        still: height of the still level; None: the initial height of the surface.

    Attributes:
        nodes: local nodes of `space` on the surface, ascending; the first `owned` are this rank's.
        raised: initial height of the surface above the still level.
    """

    def __init__(
        self,
        domain: Domain,
        space: Any,
        boundary: str,
        held: tuple[str, ...],
        pinned: tuple[str, ...] = (),
        still: float | None = None,
    ):
        super().__init__()
        self.domain, self.space, self.boundary = domain, space, boundary
        facets = domain.facets_of(boundary)
        self.nodes = np.sort(compat.nodes_on(space, facets))
        self.owned = int(np.searchsorted(self.nodes, space.dofmap.index_map.size_local))
        self.raised = 0.0 if still is None else self._raised_above(still)
        self._rows = np.zeros(len(domain.mesh.geometry.x), dtype=np.int64)
        self._rows[compat.geometry_dofs(domain.mesh)] = compat.cell_dofs(space)
        fixed = [compat.nodes_on(space, domain.facets_of(name)) for name in held]
        fixed_nodes = np.concatenate([self.nodes, *fixed])
        u, q = ufl.TrialFunction(space), ufl.TestFunction(space)
        self._work, self._values = dolfinx.fem.Function(space), dolfinx.fem.Function(space)
        self._views = [self.holding(compat.vec_view(each)) for each in (self._work, self._values)]
        slopes = [u.dx(axis) * q.dx(axis) for axis in range(domain.gdim)]
        levelling = (LEVELLING * sum(slopes[:-1]) + slopes[-1]) * ufl.dx
        self._stiffness = self.holding(compat.matrix_of(compat.form(levelling)))
        self._inner = np.setdiff1d(np.arange(space.dofmap.index_map.size_local), fixed_nodes)
        self._spread = self.holding(Factors(self._stiffness, self._numbers(self._inner)))
        area = below(u, q, ufl.FacetNormal(domain.mesh)) * domain.measure(boundary)
        self.area = self.holding(compat.matrix_of(compat.form(area)))
        ends = [compat.nodes_on(space, domain.facets_of(name)) for name in pinned]
        own = self.nodes[: self.owned]
        self._free = np.setdiff1d(own, np.concatenate([np.empty(0, dtype=np.int32), *ends])).astype(
            np.int32
        )
        self._averaged = self.holding(self.factors(self.area))
        level = np.zeros_like(self._values.x.array)
        level[self.nodes] = 1.0
        self._level = self._nearest(level) if pinned else level
        self._extent = self.mean(self._level)

    def at(self, elevation: Floats) -> Floats:
        """Displacements (n, 3) of the mesh's nodes under elevations (local nodes of the space,)."""
        rise = np.zeros_like(elevation)
        rise[self.nodes] = elevation[self.nodes] - self.raised
        pulled = self.times(self._stiffness, rise)
        values = self._values.x.array
        values[self._inner] = self._spread.solve(-pulled.array_r[self._inner])
        self._values.x.scatter_forward()
        moved = np.zeros((len(self._rows), 3))
        moved[:, self.domain.gdim - 1] = values[self._rows]
        return moved

    def elevation_of(self, tested: Any) -> Floats:
        """The elevation h (local nodes,) with given int q h (n . up) ds (PETSc vector), zero where pinned."""
        return self.solved(self._averaged, tested)

    def factors(self, matrix: Any) -> Factors:
        return Factors(matrix, self._numbers(self._free))

    def times(self, matrix: Any, elevation: Floats) -> Any:
        """A matrix times an elevation (local nodes,), a PETSc vector that the next call overwrites."""
        self._values.x.array[:] = elevation
        matrix.mult(self._views[1], self._views[0])
        return self._views[0]

    def solved(self, factors: Factors, tested: Any) -> Floats:
        values = self._values.x.array
        solution = factors.solve(tested.array_r[self._free])
        values[:] = 0.0
        values[self._free] = solution
        self._values.x.scatter_forward()
        return np.array(values)

    def with_volume(self, elevation: Floats, volume: float) -> Floats:
        """The elevation (local nodes,) of a volume nearest in the mean square, unchanged where pinned."""
        return elevation + (volume - self.mean(elevation)) / self._extent * self._level

    def remove_pinned_projection(self, elevation: Floats, closed: bool) -> Floats:
        """An elevation (local nodes,) less the nearest that vanishes where pinned.

        In a closed domain that one has no volume either.
        """
        nearest = self._nearest(elevation)
        return elevation - (self.with_volume(nearest, 0.0) if closed else nearest)

    def _nearest(self, elevation: Floats) -> Floats:
        return self.elevation_of(self.times(self.area, elevation))

    def mean(self, elevation: Floats, other: Floats | None = None) -> float:
        """Integral of an elevation, or of the product of two, over the area below the surface."""
        moments = self.times(self.area, elevation).array_r
        mine = float(moments.sum() if other is None else moments @ other[: len(moments)])
        return float(self.domain.comm.allreduce(mine))

    def on_nodes(self, elevation: Floats) -> Floats:
        """An elevation (local nodes,) at the rows (n,) of `mesh.geometry.x`. Not collective."""
        return np.asarray(elevation[self._rows])

    def from_nodes(self, values: Floats) -> Floats:
        """The inverse of `on_nodes`. Not collective."""
        elevation = np.zeros_like(self._values.x.array)
        elevation[self._rows] = values
        return elevation

    def _raised_above(self, still: float) -> float:
        heights = self.space.tabulate_dof_coordinates()[self.nodes, self.domain.gdim - 1]
        level = self.domain.comm.allreduce(float(heights.max(initial=-np.inf)), op=MPI.MAX)
        return (
            0.0
            if np.isclose(level, still, rtol=0.0, atol=1e-9 * max(abs(level), abs(still)))
            else level - still
        )

    def _numbers(self, nodes: Any) -> Any:
        index_map = self.space.dofmap.index_map
        own = nodes[nodes < index_map.size_local]
        return (own + index_map.local_range[0]).astype(PETSc.IntType)


class Factors(Owner):
    """Factors of a submatrix, given by global numbers of rows and columns.

    Holds PETSc objects; every method is collective.
    """

    def __init__(self, matrix: Any, numbers: Any):
        super().__init__()
        chosen = PETSc.IS().createGeneral(numbers, comm=matrix.comm)
        part = matrix.createSubMatrix(chosen, chosen)
        self._solution, self._right_side = map(self.holding, part.createVecs())
        self._solver = self.holding(PETSc.KSP().create(matrix.comm))
        self._solver.setOperators(part)
        self._solver.setType("preonly")
        self._solver.getPC().setType("lu")
        if PETSc.Sys.hasExternalPackage("mumps"):
            self._solver.getPC().setFactorSolverType("mumps")
        self._solver.setUp()
        for lent in (chosen, part):
            lent.destroy()

    def solve(self, right_side: Floats) -> Floats:
        self._right_side.array[:] = right_side
        self._solver.solve(self._right_side, self._solution)
        return np.array(self._solution.array_r)

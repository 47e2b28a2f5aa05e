"""Taylor-Hood spaces: continuous velocity of order k, pressure of order k - 1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import dolfinx
import numpy as np
import ufl
from petsc4py import PETSc

from .. import compat
from ..mesh.domain import straight_cells


@dataclass(frozen=True)
class TaylorHood:
    """Mixed space and its parts, with maps of their unknowns into the mixed vector."""

    mixed: Any
    velocity: Any
    pressure: Any
    velocity_map: np.ndarray
    pressure_map: np.ndarray
    order: int

    @property
    def gdim(self) -> int:
        return int(self.mixed.mesh.geometry.dim)

    @property
    def parts(self) -> tuple[tuple[Any, np.ndarray], tuple[Any, np.ndarray]]:
        """Velocity and pressure: spaces and maps."""
        return (self.velocity, self.velocity_map), (self.pressure, self.pressure_map)

    @property
    def unknowns_at_nodes(self) -> np.ndarray:
        return self.velocity_map.reshape(-1, self.gdim)

    @property
    def unknowns(self) -> int:
        return int(self.mixed.dofmap.index_map.size_global * self.mixed.dofmap.index_map_bs)

    def constant(self, value: float) -> Any:
        return dolfinx.fem.Constant(self.mixed.mesh, PETSc.ScalarType(value))

    def component(self) -> Any:
        """Space of one velocity component. Collective."""
        return compat.space(self.mixed.mesh, ("Lagrange", self.order))

    def quadrature(self, cells: np.ndarray | None = None, polynomial: bool = False) -> Any:
        """Measure of all cells, or of local `cells` (ascending), exact for convection on straight ones. Collective.

        The degree grows by two per order of curvature; for integrands `polynomial` on straight
        cells, on curved cells only.
        """
        mesh = self.mixed.mesh
        exact = 3 * self.order - 1
        degrees = [exact + self._for_curvature(), exact]
        if cells is None and not (polynomial and self._for_curvature()):
            return ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": degrees[0]})
        tags = np.ones(compat.geometry_dofs(mesh).shape[0], dtype=np.int32)
        tags[straight_cells(mesh) if polynomial else []] = 2
        chosen = np.arange(len(tags), dtype=np.int32) if cells is None else cells
        tagged = dolfinx.mesh.meshtags(mesh, mesh.topology.dim, chosen, tags[chosen])
        first, *others = (
            ufl.Measure(
                "dx", domain=mesh, subdomain_data=tagged, metadata={"quadrature_degree": degree}
            )(tag)
            for tag, degree in enumerate(degrees[: 1 + polynomial], 1)
        )
        return sum(others, first)

    def boundary_quadrature(self, facets: Any) -> Any:
        """Boundary measure, exact for convection through straight facets; `facets` are tags."""
        metadata = {"quadrature_degree": 3 * self.order + self._for_curvature()}
        return ufl.Measure("ds", domain=self.mixed.mesh, subdomain_data=facets, metadata=metadata)

    def _for_curvature(self) -> int:
        return 2 * (compat.geometry_degree(self.mixed.mesh) - 1)

    def velocity_points(self) -> np.ndarray:
        return self.velocity.tabulate_dof_coordinates()


def taylor_hood(mesh: Any, order: int) -> TaylorHood:
    """Build the spaces of velocity order `order` (at least 2). Collective."""
    gdim = mesh.geometry.dim
    parts = [compat.element(mesh, order, (gdim,)), compat.element(mesh, order - 1)]
    mixed = compat.function_space(mesh, compat.mixed_element(parts))
    velocity, pressure = (compat.function_space(mesh, part) for part in parts)
    in_mixed = [_places(part, mixed.sub(i)) for i, part in enumerate((velocity, pressure))]
    return TaylorHood(mixed, velocity, pressure, in_mixed[0], in_mixed[1], order)


def _places(part: Any, within: Any) -> np.ndarray:
    """Number of each unknown of a space in the mixed space with part `within`.

    dolfinx 0.5.2's `within.collapse()` is discontinuous from third order.
    """
    block = part.dofmap.index_map_bs
    own = compat.cell_dofs(part)[:, :, None] * block + np.arange(block)
    index_map = part.dofmap.index_map
    places = np.zeros((index_map.size_local + index_map.num_ghosts) * block, dtype=np.int32)
    places[own.ravel()] = compat.cell_dofs(within).ravel()
    return places


def cell_size(mesh: Any) -> Any:
    """Cell size in UFL: root of twice the area, in 3-D cubic root of six times the volume."""
    return abs(ufl.JacobianDeterminant(mesh)) ** (1 / mesh.geometry.dim)


def size_along(mesh: Any, direction: Any) -> Any:
    """Cell size along a vector in UFL; along an edge, its length over that of the reference cell."""
    back = ufl.dot(ufl.inv(ufl.Jacobian(mesh)), direction)
    return ufl.sqrt((ufl.inner(direction, direction) + 1e-30) / (ufl.inner(back, back) + 1e-30))


def geometry_function(mesh: Any) -> Any:
    """Vector function on the mesh's geometry nodes. Collective."""
    return dolfinx.fem.Function(compat.function_space(mesh, compat.coordinate_element(mesh)))


def geometry_rows(function: Any) -> np.ndarray:
    """Row in `mesh.geometry.x` of each node of a `geometry_function`, whose values are those of the rows, (n gdim,)."""
    space = function.function_space
    rows = np.zeros(len(function.x.array) // space.mesh.geometry.dim, dtype=np.int64)
    rows[compat.cell_dofs(space)] = compat.geometry_dofs(space.mesh)
    return rows

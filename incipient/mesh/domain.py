"""The meshed fluid domain with its named boundaries, built on rank 0 and distributed, and its cells."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import basix
import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from .. import compat
from ..arrays import Floats, Integers, unordered_keys
from ..errors import MeshError
from ..meshes import SYMMETRY
from ..parallel import collectively

if TYPE_CHECKING:
    from ..meshes.simplices import Simplices

CELLS = {2: basix.CellType.triangle, 3: basix.CellType.tetrahedron}


def shape_functions(mesh: Any) -> Any:
    """Scalar element of the mesh's own geometry."""
    degree, variant = compat.geometry_degree(mesh), basix.LagrangeVariant.equispaced
    return basix.create_element(basix.ElementFamily.P, CELLS[mesh.geometry.dim], degree, variant)


def with_first(coordinates: Floats) -> Floats:
    """All barycentric coordinates (..., gdim + 1) from coordinates (..., gdim) in a reference cell."""
    first = 1.0 - coordinates.sum(axis=-1, keepdims=True)
    return np.concatenate([first, coordinates], axis=-1)


def barycentric_nodes(mesh: Any) -> Floats:
    """Barycentric coordinates (nodes, gdim + 1) of a cell's nodes, vertices first."""
    return with_first(shape_functions(mesh).points)


def straight_cells(mesh: Any) -> np.ndarray:
    """Ascending local cells with an affine map from the reference cell."""
    corners = barycentric_nodes(mesh)
    places = mesh.geometry.x[compat.geometry_dofs(mesh)]
    affine = np.einsum("nc,kcd->knd", corners, places[:, : corners.shape[1]])
    bend, extent = np.abs(places - affine).max(axis=(1, 2)), np.ptp(places, axis=1).max(axis=1)
    # Within round-off of a straight cell's nodes
    return np.flatnonzero(bend <= 1e-10 * extent).astype(np.int32)


def local_cells(mesh: Any) -> int:
    """Number of cells of this rank, ghosts included."""
    index_map = mesh.topology.index_map(mesh.topology.dim)
    return int(index_map.size_local + index_map.num_ghosts)


def cell_facets(mesh: Any, cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Facets (n,) of the first local cells, cell by cell, and geometry rows (n, gdim) of their corners."""
    dimension = mesh.topology.dim
    mesh.topology.create_connectivity(dimension, dimension - 1)
    facets = mesh.topology.connectivity(dimension, dimension - 1).array[: cells * (dimension + 1)]
    # A simplex's facet is numbered as the corner that it lacks.
    lacking = [[k for k in range(dimension + 1) if k != corner] for corner in range(dimension + 1)]
    corners = compat.geometry_dofs(mesh)[:cells][:, lacking].reshape(-1, dimension)
    return facets, corners


def input_numbers(mesh: Any) -> Integers:
    """Number in the mesh's input of each row of `mesh.geometry.x`."""
    return np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)


def vertex_numbers(space: Any) -> Integers:
    """Numbers (local nodes,) in the mesh's input of the nodes of a first-order space, on any ranks the same."""
    mesh, index_map = space.mesh, space.dofmap.index_map
    numbers = np.empty(index_map.size_local + index_map.num_ghosts, dtype=np.int64)
    rows = compat.geometry_dofs(mesh)[:, : mesh.topology.dim + 1]
    numbers[compat.cell_dofs(space)] = input_numbers(mesh)[rows]
    return numbers


def is_node_of(space: dolfinx.fem.FunctionSpace, cells: Integers) -> np.ndarray:
    """Mask (local nodes,) of nodes of a scalar space in some of these cells of any rank. Collective."""
    marked = dolfinx.fem.Function(space)
    marked.x.array[np.unique(compat.cell_dofs(space)[cells])] = 1.0
    view = compat.vec_view(marked)
    view.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    view.destroy()
    marked.x.scatter_forward()
    return np.asarray(marked.x.array > 0.0)


@dataclass(frozen=True)
class Domain:
    """A distributed mesh whose boundary facets carry names ("inflow", "bed", "body", ...)."""

    mesh: Any
    facets: Any
    names: dict[str, int]

    @property
    def gdim(self) -> int:
        return int(self.mesh.geometry.dim)

    @property
    def comm(self) -> MPI.Comm:
        return self.mesh.comm

    @property
    def halved(self) -> bool:
        """Whether this is half of a mirror-symmetric domain, cut in a plane of constant y."""
        return SYMMETRY in self.names

    @property
    def multiplicity(self) -> float:
        """Volume of the whole domain over that of its mesh."""
        return 2.0 if self.halved else 1.0

    def facets_of(self, name: str) -> np.ndarray:
        """Local facets (ghosts included) of a named boundary."""
        return self.facets.find(self.names[name])

    def enclosed_by(self, name: str, middle: float) -> float:
        """Volume that a named boundary in 3-D encloses, with the plane y = middle if it ends there. Collective."""
        mesh = self.mesh
        way = ufl.SpatialCoordinate(mesh) - ufl.as_vector([0.0, middle, 0.0])
        outwards = -ufl.FacetNormal(mesh)
        volume = ufl.inner(way, outwards) / 3.0 * self.measure(name)
        return compat.integral(compat.form(volume), mesh.comm)

    def measure(self, *names: str) -> Any:
        tags = tuple(self.names[name] for name in names)
        return ufl.Measure("ds", domain=self.mesh, subdomain_data=self.facets)(
            tags[0] if len(tags) == 1 else tags
        )


def build(comm: MPI.Comm, drawing: Callable[[], Simplices]) -> Domain:
    """Mesh on rank 0, where `drawing()` is called, then distribute. Collective.

    Raises MeshError on all ranks, when the geometry cannot be meshed or part of the boundary has no name.
    """
    simplices, known = None, None
    with collectively(comm):
        if comm.rank == 0:
            simplices = drawing()
            names = {name: tag for tag, name in enumerate(simplices.sides, start=1)}
            gdim, parts = (
                simplices.points.shape[1],
                [simplices.cells[:0], *simplices.sides.values()],
            )
            corners = np.concatenate([part[:, :gdim] for part in parts])
            tags = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
            known = simplices.order, gdim, simplices.cells.shape[1], names, corners, tags
    order, gdim, per_cell, names, corners, tags = comm.bcast(known, root=0)
    cells = np.empty((0, per_cell), dtype=np.int64) if simplices is None else simplices.cells
    points = np.empty((0, gdim)) if simplices is None else simplices.points
    mesh = compat.create_mesh(comm, cells[:, compat.gmsh_order(gdim, per_cell)], points, order)
    domain = Domain(mesh, named_facets(mesh, corners, tags), names)
    _check_boundary(domain)
    return domain


def _check_boundary(domain: Domain) -> None:
    """A facet without a name would silently be an open boundary."""
    exterior = compat.exterior_facets(domain.mesh)
    unnamed = np.setdiff1d(exterior, domain.facets.indices)
    missing = domain.comm.allreduce(len(unnamed))
    if missing:
        raise MeshError(f"{missing} boundary facets of the mesh belong to no named boundary")


def named_facets(mesh: Any, corners: Integers, tags: Integers) -> Any:
    """The tags (k,) of facets with corners of node numbers (k, gdim), known to all ranks, as tags of the mesh.

    Includes facets of ghosts; unknown ones are omitted. Collective.
    """
    dimension = mesh.topology.dim
    facets, rows = cell_facets(mesh, local_cells(mesh))
    numbers, wanted = np.unique(corners, return_inverse=True)
    wanted = unordered_keys(wanted.reshape(-1, dimension), len(numbers))
    order = np.argsort(wanted, kind="stable")
    position = _positions(numbers, input_numbers(mesh))[rows]
    among = (position >= 0).all(axis=1)
    matched = _positions(wanted[order], unordered_keys(position[among], len(numbers)))
    named, first = np.unique(facets[among][matched >= 0], return_index=True)
    values = tags[order][matched[matched >= 0]][first]
    return dolfinx.mesh.meshtags(
        mesh, dimension - 1, named.astype(np.int32), values.astype(np.int32)
    )


def _positions(ascending: Integers, numbers: Integers) -> Integers:
    if not len(ascending):
        return np.full(len(numbers), -1)
    position = np.minimum(np.searchsorted(ascending, numbers), len(ascending) - 1)
    return np.where(ascending[position] == numbers, position, -1)

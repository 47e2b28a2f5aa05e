"""Cells of a mesh: shape functions, facets and nodes."""

from __future__ import annotations

from typing import Any

import basix
import dolfinx
import numpy as np
from petsc4py import PETSc

from .. import compat
from ..arrays import Floats, Integers

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

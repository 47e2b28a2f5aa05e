"""The quadratic nodes of a distributed mesh, or of part of its boundary, numbered contiguously over all ranks.

All fields are written on these nodes, which represent P2 velocity and quadratic geometry exactly; VTK draws them as
Triangle_6 (2-D), Tetrahedron_10 (3-D) and Edge_3 (boundary in 2-D).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx.fem import Function

from .. import compat
from ..parallel import NumberedRows, joined

# Degrees of freedom of a P2 cell in VTK's order (basix numbers a triangle's edge after the vertex it lacks).
_CELL_NODES = {2: (0, 1, 2, 5, 3, 4), 3: (0, 1, 2, 3, 9, 6, 8, 7, 5, 4)}
_FACET_NODES = {
    2: ((1, 2, 3), (0, 2, 4), (0, 1, 5)),
    3: ((1, 2, 3, 6, 4, 5), (0, 2, 3, 8, 4, 7), (0, 1, 3, 9, 5, 7), (0, 1, 2, 9, 6, 8)),
}
_XDMF_NAMES = {3: "Edge_3", 6: "Triangle_6", 10: "Tetrahedron_10"}


class QuadraticNodes:
    """P2 nodes of all cells of a mesh, or of some facets. The constructor and every method are collective.

    Results are complete on rank 0 and empty on the others.

    topology: (cells or facets, nodes each) node numbers in VTK's order
    facets:   local facet indices; those owned by another rank are ignored
    """

    def __init__(self, mesh: Any, facets: np.ndarray | None = None):
        self.mesh, self._comm = mesh, mesh.comm
        self._space = compat.space(mesh, ("Lagrange", 2))
        self._dofs = compat.cell_dofs(self._space)
        self._targets: dict[tuple[int, ...], tuple[Any, np.ndarray]] = {}
        local = _cells(mesh, self._dofs) if facets is None else _facets(mesh, self._dofs, facets)
        self._local, places = np.unique(local, return_inverse=True)
        self.cell_type = _XDMF_NAMES[local.shape[1]]
        index_map = self._space.dofmap.index_map
        numbers = index_map.local_to_global(self._local.astype(np.int32)).astype(np.int64)
        self._nodes = NumberedRows(self._comm, numbers)
        cells = joined(self._comm, numbers[places.reshape(local.shape)])
        self.topology = self._nodes.places_of(cells).astype(np.int32)

    def coordinates(self) -> np.ndarray:
        """Coordinates (nodes, 3), pushed through the mesh's geometry of any order."""
        return self._nodes.joined(self._space.tabulate_dof_coordinates()[self._local])

    def values(self, function: Any) -> np.ndarray:
        """Nodal values of a Lagrange function, (nodes,) or (nodes, 3).

        Vectors in 2-D get a third component of zero. At a jump between cells one side is taken.
        """
        shape = tuple(function.ufl_shape)
        if shape not in ((), (1,), (2,), (3,)):
            raise ValueError(f"a field of shape {shape} can not be written; write its components")
        target, dofs = self._target(shape)
        target.interpolate(function)
        target.x.scatter_forward()
        nodal = target.x.array.reshape(-1, *shape)[dofs.ravel()]
        index_map = self._space.dofmap.index_map
        nodes = index_map.size_local + index_map.num_ghosts
        values = np.zeros((nodes, 3) if shape else nodes)
        # The numbering may differ from that of the scalar space: map through the cells.
        values[(self._dofs.ravel(), slice(*shape)) if shape else self._dofs.ravel()] = nodal
        return self._nodes.joined(values[self._local])

    def _target(self, shape: tuple[int, ...]) -> tuple[Any, np.ndarray]:
        """A P2 function of a shape to interpolate into, and its space's cell-wise degrees of freedom."""
        if shape not in self._targets:
            space = compat.space(self.mesh, ("Lagrange", 2), shape)
            self._targets[shape] = Function(space), compat.cell_dofs(space)
        return self._targets[shape]


def _cells(mesh: Any, dofs: np.ndarray) -> np.ndarray:
    """(owned cells, nodes) local P2 nodes in VTK's order."""
    dimension = mesh.topology.dim
    return dofs[: mesh.topology.index_map(dimension).size_local][:, _CELL_NODES[dimension]]


def _facets(mesh: Any, dofs: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """(owned facets, nodes) local P2 nodes in VTK's order."""
    dimension = mesh.topology.dim
    nodes = np.array(_FACET_NODES[dimension])
    mesh.topology.create_connectivity(dimension - 1, dimension)
    mesh.topology.create_connectivity(dimension, dimension - 1)
    to_cell = mesh.topology.connectivity(dimension - 1, dimension)
    to_facet = mesh.topology.connectivity(dimension, dimension - 1)
    owned = facets[facets < mesh.topology.index_map(dimension - 1).size_local]
    rows = []
    for facet in owned:
        cell = to_cell.links(facet)[0]
        rows.append(dofs[cell, nodes[np.flatnonzero(to_facet.links(cell) == facet)[0]]])
    return np.array(rows, dtype=dofs.dtype).reshape(-1, nodes.shape[1])

"""Series of fields on quadratic nodes for ParaView and pyvista."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx.fem import Function
from mpi4py import MPI

from .. import compat
from ..arrays import spatial
from ..mesh.domain import cell_facets
from ..parallel import NumberedRows, joined, on_first
from .series_file import SeriesFile

_XDMF_NAMES = {3: "Edge_3", 6: "Triangle_6", 10: "Tetrahedron_10"}


class QuadraticNodes:
    """P2 nodes of a distributed mesh, or of some of its facets, numbered contiguously over all ranks.

    They represent P2 velocity and quadratic geometry exactly. The constructor and every method are collective;
    results are complete on rank 0. topology: (cells or facets, nodes each) in VTK's order.
    """

    def __init__(self, mesh: Any, facets: np.ndarray | None = None):
        self.mesh, self._comm = mesh, mesh.comm
        self._space = compat.space(mesh, ("Lagrange", 2))
        self._dofs = compat.cell_dofs(self._space)
        self._targets: dict[tuple[int, ...], tuple[Any, np.ndarray]] = {}
        local = self._cells() if facets is None else self._facets(facets)
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

        2-D vectors get a third component of zero; at a jump between cells one side is taken.
        """
        shape = tuple(function.ufl_shape)
        target, rows = self._target(shape)
        target.interpolate(function)
        target.x.scatter_forward()
        nodal = target.x.array.reshape(-1, *shape)[rows]
        return self._nodes.joined(spatial(nodal) if shape else nodal)

    def _target(self, shape: tuple[int, ...]) -> tuple[Any, np.ndarray]:
        """A quadratic function, and its rows at the nodes; its numbering may differ from the scalar space's."""
        if shape not in self._targets:
            space = compat.space(self.mesh, ("Lagrange", 2), shape)
            rows = np.zeros(self._dofs.max(initial=0) + 1, dtype=np.int64)
            rows[self._dofs] = compat.cell_dofs(space)
            self._targets[shape] = Function(space), rows[self._local]
        return self._targets[shape]

    def _cells(self) -> np.ndarray:
        dimension = self.mesh.topology.dim
        owned = self._dofs[: self.mesh.topology.index_map(dimension).size_local]
        return owned[:, compat.vtk_order(dimension, owned.shape[1])]

    def _facets(self, facets: np.ndarray) -> np.ndarray:
        topology, dimension = self.mesh.topology, self.mesh.topology.dim
        layout = self._space.dofmap.dof_layout
        sides = np.array(
            [layout.entity_closure_dofs(dimension - 1, side) for side in range(dimension + 1)]
        )
        sides = sides[:, compat.vtk_order(dimension - 1, sides.shape[1])]
        _, first = np.unique(cell_facets(self.mesh, len(self._dofs))[0], return_index=True)
        owned = facets[facets < topology.index_map(dimension - 1).size_local]
        cell, side = np.divmod(first[owned], dimension + 1)
        return self._dofs[cell[:, None], sides[side]]


class FieldSeries:
    """Writes Lagrange functions on quadratic nodes of a mesh, or of part of its boundary, step by step.

    Every method is collective; rank 0 writes (`SeriesFile`). Raises OutputError on all ranks if writing fails;
    earlier steps stay readable.

    Args:
        after: stored steps after this time are removed; default: all.
        facets: (n,) local indices of the boundary facets written; None: the whole mesh.
    """

    def __init__(
        self,
        stem: Path,
        mesh: Any,
        comm: MPI.Comm,
        after: float = -math.inf,
        facets: np.ndarray | None = None,
    ):
        self.remeshed(mesh, facets)
        self._file = SeriesFile(stem, self._nodes.cell_type)
        on_first(comm, self._file.begin, after)

    def remeshed(self, mesh: Any, facets: np.ndarray | None = None) -> None:
        self._nodes, self._written = QuadraticNodes(mesh, facets), None

    def write(self, time: float, fields: Mapping[str, Any]) -> None:
        # The communicator of an earlier mesh is freed with that mesh.
        nodes, comm = self._nodes, self._nodes.mesh.comm
        places, mesh = nodes.mesh.geometry.x, {}
        if self._written is None:
            mesh["topology"] = nodes.topology
        still = self._written is not None and np.array_equal(self._written, places)
        if comm.allreduce(not still, op=MPI.LOR):
            mesh["geometry"] = nodes.coordinates()
        values = {name: nodes.values(function) for name, function in fields.items()}
        on_first(comm, self._file.add_step, time, values, mesh)
        if mesh:
            self._written = places.copy()

"""Fields over time for ParaView and pyvista, on quadratic nodes, from any number of ranks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from ..parallel import collectively
from .nodes import QuadraticNodes
from .series_file import SeriesFile


class FieldSeries:
    """Writes Lagrange functions of any degree on quadratic nodes of a mesh, or of part of its boundary, step by step.

    In 2-D cells are Triangle_6 and those of a boundary, such as a grain's surface, Edge_3; in 3-D Tetrahedron_10 and
    Triangle_6. Every method is collective; rank 0 writes (`SeriesFile`). A topology is written once for each mesh, the
    nodes' coordinates once for each step before which the mesh has moved.

    Args:
        after: later steps that are there are removed, earlier ones stay; by default all are removed.
        facets: (n,) local indices of boundary facets, on whose nodes values are written; those owned by another rank
            are ignored. None: on all of the mesh.

    Raises OutputError on all ranks when the files cannot be written; steps written before stay readable.
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
        with collectively(comm):
            if comm.rank == 0:
                self._file.begin(after)

    def remeshed(self, mesh: Any, facets: np.ndarray | None = None) -> None:
        """Continue with a new mesh of the same kind, or facets of it: the steps to come are on it."""
        self._nodes, self._written = QuadraticNodes(mesh, facets), None

    def write(self, time: float, fields: Mapping[str, Any]) -> None:
        """Append named dolfinx functions (scalars or vectors, in scene units) at a time."""
        # A communicator that an earlier mesh lent is gone with that mesh.
        nodes, comm = self._nodes, self._nodes.mesh.comm
        places, mesh = nodes.mesh.geometry.x, {}
        if self._written is None:
            mesh["topology"] = nodes.topology
        still = self._written is not None and np.array_equal(self._written, places)
        if comm.allreduce(not still, op=MPI.LOR):
            mesh["geometry"] = nodes.coordinates()
        values = {name: nodes.values(function) for name, function in fields.items()}
        with collectively(comm):
            if comm.rank == 0:
                self._file.add_step(time, values, mesh)
        if mesh:
            self._written = places.copy()

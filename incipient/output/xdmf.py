"""Series of fields on quadratic nodes for ParaView and pyvista, on any number of ranks."""

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
    """Writes Lagrange functions on quadratic nodes of a mesh, or of part of its boundary, step by step.

    Cells are Triangle_6 in 2-D and Tetrahedron_10 in 3-D, boundary cells Edge_3 and Triangle_6. Every method is
    collective; rank 0 writes (`SeriesFile`). Topology is written once for each mesh, coordinates after each motion.

    Args:
        after: stored steps after this time are removed; default: all.
        facets: (n,) local indices of the boundary facets written; those owned by another rank are ignored. None: the
            whole mesh.

    Raises OutputError on all ranks if writing fails; earlier steps stay readable.
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
        """Continue on a new mesh of the same kind, or on its facets."""
        self._nodes, self._written = QuadraticNodes(mesh, facets), None

    def write(self, time: float, fields: Mapping[str, Any]) -> None:
        """Append named dolfinx functions (scalars or vectors, in scene units) at a time."""
        # The communicator of an earlier mesh is freed with that mesh.
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

"""Fields over time for ParaView: `stem.xdmf` and `stem.h5`, on quadratic nodes, from any number of ranks."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from ..parallel import collectively
from .nodes import QuadraticNodes
from .series_file import SeriesFile


class FieldSeries:
    """Writes Lagrange functions of any degree on the P2 nodes of a mesh, step by step.

    Making it, `write` and `remeshed` are collective. Rank 0 alone touches the files. They are closed between
    writes, so every step written stays readable, whatever happens to the program later.

    Raises:
        OutputError: on all ranks, when the files cannot be written; steps written before stay readable.
    """

    def __init__(self, stem: Path, mesh: Any, comm: MPI.Comm):
        self._begin(stem, comm, mesh, QuadraticNodes(mesh))

    def _begin(self, stem: Path, comm: MPI.Comm, mesh: Any, nodes: QuadraticNodes) -> None:
        self._comm, self._mesh, self._nodes = comm, mesh, nodes
        self._written: np.ndarray | None = None
        self._file = SeriesFile(stem, nodes.cell_type)
        with collectively(comm):
            if comm.rank == 0:
                self._file.create()
                self._file.add_mesh(nodes.topology)

    def write(self, time: float, fields: Mapping[str, Any]) -> None:
        """Append named dolfinx functions (scalars or vectors, in scene units) at a time. Collective.

        The nodes' coordinates are written with the first step and again whenever the mesh has moved.
        """
        moved = self._moved()
        points = self._nodes.coordinates() if moved else None
        values = {name: self._nodes.values(function) for name, function in fields.items()}
        with collectively(self._comm):
            if self._comm.rank == 0:
                if points is not None:
                    self._file.add_geometry(points)
                self._file.add_step(time, values)
        self._written = self._mesh.geometry.x.copy() if moved else self._written

    def remeshed(self, mesh: Any) -> None:
        """Go on with a new mesh of the same kind: the steps to come are on it. Collective."""
        self._mesh, self._nodes, self._written = mesh, QuadraticNodes(mesh), None
        with collectively(self._comm):
            if self._comm.rank == 0:
                self._file.add_mesh(self._nodes.topology)

    def _moved(self) -> bool:
        """Whether, on any rank, a node of the mesh is not where it was when coordinates were last written."""
        still = self._written is not None and np.array_equal(self._written, self._mesh.geometry.x)
        return bool(self._comm.allreduce(not still, op=MPI.LOR))

    def __enter__(self) -> FieldSeries:
        return self

    def __exit__(self, *exception: object) -> None:
        """Nothing is left open between writes."""


class SurfaceSeries(FieldSeries):
    """The same on part of the boundary, such as a grain's surface: Edge_3 in the plane, Triangle_6 in space.

    `facets` are local indices of boundary facets, (n,); those owned by another rank are ignored. Functions
    live on the whole mesh; their values on the facets' nodes are written.
    """

    def __init__(self, stem: Path, mesh: Any, facets: np.ndarray, comm: MPI.Comm):
        self._begin(stem, comm, mesh, QuadraticNodes(mesh, facets))

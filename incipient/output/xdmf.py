"""Fields over time for ParaView: `stem.xdmf` and `stem.h5`, on quadratic nodes, from any number of ranks."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from ..parallel import collectively
from .nodes import QuadraticNodes
from .series_file import SeriesFile, Unreadable

log = logging.getLogger("incipient")


class FieldSeries:
    """Writes Lagrange functions of any degree on quadratic nodes of a mesh, or of part of its boundary, step by step.

    In the plane cells are Triangle_6 and those of a boundary, such as a grain's surface, Edge_3; in space
    Tetrahedron_10 and Triangle_6. Every method is collective. Ranks write their rows of tables at once, rank 0 all else
    (`SeriesFile`). The files are closed between writes, so every step written stays readable, whatever happens to the
    program later. A topology is written once for each mesh, the nodes' coordinates once for each step before which the
    mesh has moved.

    Args:
        after: None starts new files; a time resumes those that are there, after dropping later steps.
        steady: there will be one step, written as a grid without a time.
        facets: (n,) local indices of boundary facets, on whose nodes values are written; those owned by another rank
            are ignored. None: on all of the mesh.

    Raises OutputError on all ranks when the files cannot be written; steps written before stay readable.
    """

    def __init__(
        self,
        stem: Path,
        mesh: Any,
        comm: MPI.Comm,
        after: float | None = None,
        steady: bool = False,
        facets: np.ndarray | None = None,
    ):
        nodes = QuadraticNodes(mesh, facets)
        self._file = SeriesFile(stem, nodes.cell_type, steady)
        with collectively(comm):
            if comm.rank == 0:
                self._file.create() if after is None else self._resume(after)
        self._go_on(nodes)

    def remeshed(self, mesh: Any, facets: np.ndarray | None = None) -> None:
        """Continue with a new mesh of the same kind, or facets of it: the steps to come are on it. Collective."""
        self._go_on(QuadraticNodes(mesh, facets))

    def _resume(self, after: float) -> None:
        """Resume the files that are there; what cannot be read is put aside, and does not stop the run."""
        try:
            self._file.resume(after)
        except Unreadable as error:
            why, aside = str(error).rpartition("; ")[0], self._file.put_aside()
            kept = f", what there was is in {aside}" if aside else ""
            log.warning("%s; the series restarts after t = %g%s", why, after, kept)
            self._file.create()

    def _go_on(self, nodes: QuadraticNodes) -> None:
        """The steps to come are on these nodes."""
        # A communicator that an earlier mesh lent is gone with that mesh.
        self._comm = nodes.mesh.comm
        self._nodes, self._written = nodes, None
        self._file.add_mesh(nodes.topology)

    def write(self, time: float, fields: Mapping[str, Any]) -> None:
        """Append named dolfinx functions (scalars or vectors, in scene units) at a time. Collective."""
        places = self._nodes.mesh.geometry.x
        moved = self._moved(places)
        if moved:
            self._file.add_geometry(self._nodes.coordinates())
        values = {name: self._nodes.values(function) for name, function in fields.items()}
        self._file.add_step(time, values, self._comm)
        self._written = places.copy() if moved else self._written

    def finish(self) -> None:
        """Write the VTKHDF file of the steps that there are, if any. On rank 0."""
        self._file.tell_vtk()

    def _moved(self, places: np.ndarray) -> bool:
        """Whether, on any rank, a node of the mesh is not where it was when coordinates were last written."""
        still = self._written is not None and np.array_equal(self._written, places)
        return bool(self._comm.allreduce(not still, op=MPI.LOR))

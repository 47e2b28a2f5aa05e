"""Fields over time for ParaView: `stem.xdmf` and `stem.h5`, on quadratic nodes, from any number of ranks."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
from mpi4py import MPI

from ..parallel import collectively
from .nodes import QuadraticNodes
from .series_file import SeriesFile, Unreadable

log = logging.getLogger("incipient")


class Series:
    """Writes Lagrange functions of any degree on quadratic nodes, step by step; see the two kinds below.

    Every method is collective. Ranks write their rows of tables at once, rank 0 all else (`SeriesFile`). The files are
    closed between writes, so every step written stays readable, whatever happens to the program later. A topology is
    written once for each mesh, the nodes' coordinates once for each step before which the mesh has moved.

    Raises:
        OutputError: on all ranks, when the files cannot be written; steps written before stay readable.
    """

    def __init__(self, stem: Path, comm: MPI.Comm, nodes: QuadraticNodes, after: float | None, steady: bool):
        self._file = SeriesFile(stem, nodes.cell_type, steady)
        with collectively(comm):
            if comm.rank == 0:
                self._file.create() if after is None else self._resume(after)
        self._go_on(nodes)

    def _resume(self, after: float) -> None:
        """Go on with the files that are there; what cannot be read is put aside, and does not stop the run."""
        try:
            self._file.resume(after)
        except Unreadable as error:
            why, aside = str(error).rpartition("; ")[0], self._file.put_aside()
            kept = f", what there was is in {aside}" if aside else ""
            log.warning("%s; the series starts anew after t = %g%s", why, after, kept)
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

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        """Nothing is left open between writes."""


class FieldSeries(Series):
    """Fields on all of a mesh: Triangle_6 in the plane, Tetrahedron_10 in space.

    Args:
        stem: path of the files without ending.
        mesh: dolfinx mesh, straight or curved.
        comm: its communicator.
        after: None starts the files anew; a time goes on with those that are there, after dropping later steps.
        steady: there will be one step, written as a grid without a time.
    """

    def __init__(
        self, stem: Path, mesh: Any, comm: MPI.Comm, after: float | None = None, steady: bool = False
    ):
        super().__init__(stem, comm, QuadraticNodes(mesh), after, steady)

    def remeshed(self, mesh: Any) -> None:
        """Go on with a new mesh of the same kind: the steps to come are on it. Collective."""
        self._go_on(QuadraticNodes(mesh))


class SurfaceSeries(Series):
    """A series of fields on part of the boundary, such as a grain's surface: Edge_3 in the plane, Triangle_6 in space.

    `facets` are local indices of boundary facets, (n,); those owned by another rank are ignored. Functions
    live on the whole mesh; their values on the facets' nodes are written.
    """

    def __init__(
        self,
        stem: Path,
        mesh: Any,
        facets: np.ndarray,
        comm: MPI.Comm,
        after: float | None = None,
        steady: bool = False,
    ):
        super().__init__(stem, comm, QuadraticNodes(mesh, facets), after, steady)

    def remeshed(self, mesh: Any, facets: np.ndarray) -> None:
        """Go on with facets of a new mesh: the steps to come are on them. Collective."""
        self._go_on(QuadraticNodes(mesh, facets))

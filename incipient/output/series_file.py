"""A pair of files, XDMF and HDF5, with fields on a mesh at successive times; no dolfinx.

Layout of the HDF5 file (version 1): `mesh0/topology` (cells, nodes per cell) node numbers in VTK's order,
`mesh0/geometry0` (nodes, 3), `mesh0/geometry1` after the mesh has moved, `mesh1/topology` after a remeshing,
`step0/velocity` (nodes, 3) and so on. Each group `step<n>` has the attributes `time`, `topology` and `geometry`.
The XDMF file points there: a temporal collection, which lists its times from the first step on, or of a steady flow
one grid without a time. Xdmf2 and both Xdmf3 readers of ParaView open both, meshio opens the grid.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ..errors import OutputError
from ..files import cause_of, claim, ends_with, insert_before_end, reported, write_text_atomically
from ..parallel import Alone, Comm, collectively, from_first
from ..tables.hdf5 import WriteAhead, complete, completed, journal_of, reserve, write_rows
from ..tables.rows import Rows
from .ownership import put_aside
from .vtkhdf import write_vtkhdf

# The whole of a table, or this rank's rows of it.
Table = Rows | NDArray[Any]
ALONE = Alone()

_METADATA_BYTES = 1 << 16
_HEAD = '<?xml version="1.0"?>\n<Xdmf Version="3.0">\n  <Domain>\n'
_END = "  </Domain>\n</Xdmf>\n"
_END_OF_SERIES = f"    </Grid>\n{_END}"
_ABOUT = {"time", "topology", "geometry"}  # the attributes of a step, which it gets last
_ATTRIBUTE_TYPES = {1: "Scalar", 2: "Vector"}
_SAME_TIME = 1e-12  # relative; steps further apart are different


class Unreadable(OutputError):
    """A pair is missing, damaged or empty."""


@dataclass(frozen=True)
class StoredStep:
    """Fields read back: points (nodes, 3), cells (cells, nodes per cell), fields (nodes,) or (nodes, 3)."""

    time: float
    points: np.ndarray
    cells: np.ndarray
    fields: dict[str, np.ndarray]


@dataclass(frozen=True)
class _Dataset:
    """An array in the HDF5 file: its name and shape."""

    name: str
    shape: tuple[int, ...]


@dataclass(frozen=True)
class _Mesh:
    """The mesh of a step: its number, that of its geometry, and where both are stored."""

    number: int = -1
    version: int = -1
    topology: _Dataset = _Dataset("", ())
    geometry: _Dataset = _Dataset("", ())

    def changed(self, waiting: Mapping[str, Rows]) -> _Mesh:
        """The mesh when the topology and geometry that wait have been stored."""
        mesh = self
        if "topology" in waiting:
            name = f"mesh{self.number + 1}/topology"
            mesh = _Mesh(self.number + 1, -1, _Dataset(name, waiting["topology"].shape))
        if "geometry" in waiting:
            name = f"mesh{mesh.number}/geometry{mesh.version + 1}"
            stored = _Dataset(name, waiting["geometry"].shape)
            mesh = replace(mesh, version=mesh.version + 1, geometry=stored)
        return mesh


class SeriesFile:
    """Writes the pair; the files are closed, complete and readable after every call.

    A mesh or a geometry is written with the first step on it; one that no step is on is not written. What a step
    costs does not grow with the number of those before it. For tables each rank gives its rows, or an array that is
    the whole, and writes them at the same time as the others; all else is done by rank 0. `stem` is the path without
    ending, `cell_type` XDMF's name of the cells, such as "Triangle_6". A `steady` series has one step, whose time means
    nothing.
    """

    def __init__(self, stem: Path, cell_type: str, steady: bool = False):
        self._xdmf, self._hdf5 = _pair(stem)
        self._cell_type, self._name, self._steady = cell_type, stem.name, steady
        self._steps = 0  # written
        self._mesh = _Mesh()  # of the last step written
        self._open: Any = None  # the HDF5 file while a step is written
        self._ahead: WriteAhead  # what it is opened on
        self._waiting: dict[str, Rows] = {}  # to be written with the next step, by what they are

    def create(self) -> None:
        """Start a new HDF5 file and remove an old XDMF file, which would point into it."""
        import h5py

        self._forget_vtk()
        for path in (self._hdf5, journal_of(self._hdf5)):
            claim(path)
        with reported(self._xdmf):
            self._xdmf.unlink(missing_ok=True)
            journal_of(self._hdf5).unlink(missing_ok=True)
        with (
            reported(self._hdf5, (RuntimeError,)),
            h5py.File(self._hdf5, "w", locking=False) as file,
        ):
            file.attrs["format"] = "incipient fields, version 1"

    def resume(self, time: float) -> None:
        """Resume the pair that is there after its last step at or before a time; later steps are dropped.

        A mesh must be added before the next step. The XDMF file is rewritten, whatever its state.

        Raises Unreadable for a pair that is missing or damaged, OutputError when the XDMF file cannot be written.
        """
        self._forget_vtk()
        with _opened(self._hdf5, "r+") as file:
            for index in range(_count(file)):
                about, latest = file[f"step{index}"].attrs, time + _SAME_TIME * abs(time)
                if (
                    not about.keys() >= _ABOUT or about["time"] > latest
                ):  # not written to its end, or later
                    del file[f"step{index}"]
            self._steps = _count(file)
            self._mesh = _Mesh(sum(name.startswith("mesh") for name in file) - 1)
        self._write_xdmf()

    def put_aside(self) -> Path | None:
        """Give the HDF5 file another name; which, None if there is none."""
        if not self._hdf5.exists():
            return None
        with reported(self._hdf5):
            complete(self._hdf5)
        return put_aside(self._hdf5)

    def add_mesh(self, topology: Table) -> None:
        """Cells (cells, nodes per cell) for the steps to come; a geometry must follow. On every rank."""
        self._waiting = {"topology": _rows(topology, np.int64)}

    def add_geometry(self, points: Table) -> None:
        """Node coordinates (nodes, 3) of the newest mesh for the steps to come. On every rank."""
        self._waiting["geometry"] = _rows(points, np.float64)

    def add_step(
        self, time: float, fields: Mapping[str, Table], comm: Comm | Alone = ALONE
    ) -> None:
        """Store fields, (nodes,) or (nodes, 3) each, at a time; the HDF5 file first, then the XDMF file. Collective."""
        values = {name: _rows(table, np.float64) for name, table in fields.items()}
        tables, mesh = self._waiting | values, self._mesh.changed(self._waiting)
        names = {part: getattr(mesh, part).name for part in self._waiting}
        names |= {name: f"step{self._steps}/{name}" for name in values}
        # HDF5 writes what it knows of the step when the file is closed, which is when the step's tables are there.
        with ExitStack() as held:
            places = from_first(comm, lambda: self._begun(held, names, tables))
            with collectively(comm), reported(self._hdf5):
                write_rows(self._hdf5, places, tables)
            with collectively(comm):
                if comm.rank == 0:
                    self._end(held, time, mesh)
        with collectively(comm):
            if comm.rank == 0:
                stored = {
                    name: _Dataset(names[name], table.shape) for name, table in values.items()
                }
                self._tell(time, mesh, stored)
        self._waiting = {}

    def tell_vtk(self) -> None:
        """Write the VTKHDF file of the steps that there are, if any. On rank 0."""
        if self._steps:
            write_vtkhdf(self._hdf5, self._cell_type, self._steady)

    def _forget_vtk(self) -> None:
        """Remove the VTKHDF file, which points to steps that may go."""
        path = self._hdf5.with_suffix(".vtkhdf")
        with reported(path):
            path.unlink(missing_ok=True)

    def _begun(
        self, held: ExitStack, names: Mapping[str, str], tables: Mapping[str, Rows]
    ) -> dict[str, int]:
        """Open the HDF5 file and make datasets without content at its end; their places. On rank 0.

        What does not fit is refused before the file is touched.
        """
        import h5py

        step = f"step{self._steps}"
        with reported(self._hdf5, (RuntimeError, ValueError)):
            _reserve(self._hdf5, sum(table.nbytes for table in tables.values()) + _METADATA_BYTES)
            complete(self._hdf5)
            self._ahead = held.enter_context(WriteAhead(self._hdf5))
            self._open = held.enter_context(h5py.File(self._ahead, "r+"))
            for name in (
                step,
                *names.values(),
            ):  # what an earlier, failed attempt at this step has left
                if name in self._open:
                    del self._open[name]
            self._open.require_group(step)
            return {key: reserve(self._open, names[key], table) for key, table in tables.items()}

    def _end(self, held: ExitStack, time: float, mesh: _Mesh) -> None:
        """Make a step whose tables are written one of the series, and close the HDF5 file. On rank 0."""
        about = {
            "time": float(time),
            "topology": mesh.topology.name,
            "geometry": mesh.geometry.name,
        }
        with reported(self._hdf5, (RuntimeError, ValueError)):
            self._open[f"step{self._steps}"].attrs.update(about)
            self._open.close()
            self._ahead.commit()
            held.close()

    def _tell(self, time: float, mesh: _Mesh, stored: Mapping[str, _Dataset]) -> None:
        """Put a step that the HDF5 file has into the XDMF file. On rank 0."""
        if self._steps and not self._steady and ends_with(self._xdmf, _END_OF_SERIES):
            grid = self._grid(time, mesh.topology, mesh.geometry, stored)
            insert_before_end(self._xdmf, grid, _END_OF_SERIES)
        else:
            self._write_xdmf(self._steps + 1)
        self._steps, self._mesh = self._steps + 1, mesh

    def _write_xdmf(self, steps: int | None = None) -> None:
        """Rewrite the whole XDMF file, for so many steps of the HDF5 file (default: those written)."""
        steps = self._steps if steps is None else steps
        with _opened(self._hdf5, "r") as file:
            shown = range(steps)[-1:] if self._steady else range(steps)
            grids = [self._stored_grid(file, index) for index in shown]
        if self._steady:
            text = f"{_HEAD}{''.join(grids)}{_END}"
        else:
            kind = 'GridType="Collection" CollectionType="Temporal"'
            collection = f'    <Grid Name="{self._name} in time" {kind}>\n'
            text = f"{_HEAD}{collection}{''.join(grids)}{_END_OF_SERIES}"
        write_text_atomically(self._xdmf, text)

    def _stored_grid(self, file: Any, index: int) -> str:
        """The XML of a step that the HDF5 file holds."""
        step = file[f"step{index}"]
        cells, points = (_dataset(file, step.attrs[part]) for part in ("topology", "geometry"))
        fields = {name: _dataset(file, f"step{index}/{name}") for name in step}
        return self._grid(float(step.attrs["time"]), cells, points, fields)

    def _grid(
        self, time: float, cells: _Dataset, points: _Dataset, fields: Mapping[str, _Dataset]
    ) -> str:
        """The XML of one step."""
        grid = ElementTree.Element("Grid", Name=self._name, GridType="Uniform")
        if not self._steady:
            ElementTree.SubElement(grid, "Time", Value=repr(float(time)))
        about = {"TopologyType": self._cell_type, "NumberOfElements": str(cells.shape[0])}
        self._item(ElementTree.SubElement(grid, "Topology", about), cells, "Int")
        self._item(ElementTree.SubElement(grid, "Geometry", GeometryType="XYZ"), points, "Float")
        for name, dataset in sorted(fields.items()):
            about = {
                "Name": name,
                "AttributeType": _ATTRIBUTE_TYPES[len(dataset.shape)],
                "Center": "Node",
            }
            self._item(ElementTree.SubElement(grid, "Attribute", about), dataset, "Float")
        level = 2 if self._steady else 3
        ElementTree.indent(grid, level=level)
        return f"{level * '  '}{ElementTree.tostring(grid, encoding='unicode')}\n"

    def _item(self, parent: ElementTree.Element, dataset: _Dataset, number: str) -> None:
        about = {"Dimensions": " ".join(map(str, dataset.shape)), "NumberType": number}
        item = ElementTree.SubElement(parent, "DataItem", about, Precision="8", Format="HDF")
        item.text = f"{self._hdf5.name}:/{dataset.name}"


def times(stem: Path) -> list[float]:
    """Times of the steps of a pair, in order; raises Unreadable for a bad pair or no step. Not collective."""
    path = _pair(stem)[1]
    with _opened(path, "r") as file:
        return [float(file[f"step{index}"].attrs["time"]) for index in range(_some(file, path))]


def read_step(stem: Path, index: int = -1) -> StoredStep:
    """One step (default: the last) of a pair; raises Unreadable for a bad pair or no such step. Not collective."""
    path = _pair(stem)[1]
    with _opened(path, "r") as file:
        group = file[f"step{range(_some(file, path))[index]}"]
        points, cells = (file[group.attrs[part]][()] for part in ("geometry", "topology"))
        fields = {name: dataset[()] for name, dataset in group.items()}
        return StoredStep(float(group.attrs["time"]), points, cells, fields)


@contextmanager
def _opened(path: Path, mode: str) -> Iterator[Any]:
    """The HDF5 file; what goes wrong with it inside the block is one line with a remedy."""
    import h5py

    if not path.is_file():
        raise Unreadable(f"{path}: no such file; run the scene with output.fields = true")
    try:
        if mode != "r":  # who only reads leaves the files of others as they are
            complete(path)
        source = completed(path) if mode == "r" else path
        options = {} if isinstance(source, WriteAhead) else {"locking": False}
        with h5py.File(source, mode, **options) as file:
            yield file
    except (OSError, KeyError, IndexError, RuntimeError, ValueError) as error:
        raise Unreadable(
            f"{path}: cannot be read: {cause_of(error)}; run the scene again"
        ) from error


def _count(file: Any) -> int:
    return sum(name.startswith("step") for name in file)


def _some(file: Any, path: Path) -> int:
    """The number of steps, which is not zero."""
    count = _count(file)
    if not count:
        raise Unreadable(f"{path}: holds no step; the run ended before its first result")
    return count


def _dataset(file: Any, name: str) -> _Dataset:
    return _Dataset(name, file[name].shape)


def _pair(stem: Path) -> tuple[Path, Path]:
    """Paths of both files; a stem may contain dots."""
    return stem.with_name(stem.name + ".xdmf"), stem.with_name(stem.name + ".h5")


def _rows(table: Table, kind: type) -> Rows:
    """Rows with numbers of a kind; an array is a table that is all here."""
    rows = table if isinstance(table, Rows) else Rows.whole(table)
    return replace(rows, values=rows.values.astype(kind))


def _reserve(path: Path, size: int) -> None:
    """Make sure `size` bytes fit behind the file: HDF5 that runs out of space half-way damages its file.

    HDF5 writes into the reserved bytes and cuts off what it did not need when it closes the file.
    """
    descriptor = os.open(path, os.O_RDWR)
    try:
        os.posix_fallocate(descriptor, 0, os.fstat(descriptor).st_size + size)
    finally:
        os.close(descriptor)

"""A pair of files, XDMF beside HDF5, that holds fields on a mesh at successive times; no dolfinx, no MPI.

Layout of the HDF5 file (version 1): `mesh0/topology` (cells, nodes per cell) node numbers in VTK's order,
`mesh0/geometry0` (nodes, 3), `mesh0/geometry1` after the mesh has moved, `step0/velocity` (nodes, 3) and
so on. Each group `step<n>` has the attributes `time`, `topology` and `geometry`. The XDMF file is a temporal
collection that points there; Xdmf2 and both Xdmf3 readers of ParaView open it.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from ..errors import OutputError
from ..files import reported, write_text_atomically

_METADATA_BYTES = 1 << 16
_ATTRIBUTE_TYPES = {1: "Scalar", 2: "Vector"}


@dataclass(frozen=True)
class Step:
    """Fields read back: points (nodes, 3), cells (cells, nodes per cell), fields (nodes,) or (nodes, 3)."""

    time: float
    points: np.ndarray
    cells: np.ndarray
    fields: dict[str, np.ndarray]


class SeriesFile:
    """Writes the pair; the files are closed, complete and readable after every call.

    `stem` is the path without ending, `cell_type` XDMF's name of the cells, such as "Triangle_6".
    """

    def __init__(self, stem: Path, cell_type: str):
        self._xdmf, self._hdf5 = _pair(stem)
        self._cell_type = cell_type
        self._root = ElementTree.Element("Xdmf", Version="3.0")
        domain = ElementTree.SubElement(self._root, "Domain")
        self._steps = ElementTree.SubElement(
            domain, "Grid", Name=f"{stem.name} in time", GridType="Collection", CollectionType="Temporal"
        )
        self._name = stem.name
        self._meshes = self._geometries = 0
        self._topology = self._geometry = ""
        self._shapes: dict[str, tuple[int, ...]] = {}

    def create(self) -> None:
        """Start the HDF5 file anew and remove an old XDMF file, which would point into it."""
        import h5py

        with reported(self._xdmf):
            self._xdmf.unlink(missing_ok=True)
        with reported(self._hdf5, (RuntimeError,)), h5py.File(self._hdf5, "w", locking=False) as file:
            file.attrs["format"] = "incipient fields, version 1"

    def add_mesh(self, topology: np.ndarray) -> None:
        """Store cells (cells, nodes per cell) for the steps to come; a geometry must follow."""
        name = f"mesh{self._meshes}/topology"
        self._write({name: topology.astype(np.int64)})
        self._topology, self._geometry = name, ""
        self._meshes, self._geometries = self._meshes + 1, 0

    def add_geometry(self, points: np.ndarray) -> None:
        """Store node coordinates (nodes, 3) of the newest mesh for the steps to come."""
        name = f"mesh{self._meshes - 1}/geometry{self._geometries}"
        self._write({name: points.astype(np.float64)})
        self._geometry = name
        self._geometries += 1

    def add_step(self, time: float, fields: Mapping[str, np.ndarray]) -> None:
        """Store fields, (nodes,) or (nodes, 3) each, at a time; the HDF5 file first, then the XDMF file."""
        step = f"step{len(self._steps)}"
        named = {f"{step}/{name}": values.astype(np.float64) for name, values in fields.items()}
        about = {"time": float(time), "topology": self._topology, "geometry": self._geometry}
        self._write(named, step, about)
        grid = self._grid(time, {name: f"{step}/{name}" for name in fields})
        self._steps.append(grid)
        ElementTree.indent(self._root)
        text = ElementTree.tostring(self._root, encoding="unicode", xml_declaration=False)
        try:
            write_text_atomically(self._xdmf, f'<?xml version="1.0"?>\n{text}\n')
        except OutputError:
            self._steps.remove(grid)
            raise

    def _write(
        self, arrays: Mapping[str, np.ndarray], group: str = "", about: Mapping[str, object] | None = None
    ) -> None:
        """Append arrays to the HDF5 file; what does not fit is refused before the file is touched."""
        import h5py

        with reported(self._hdf5, (RuntimeError, ValueError)):
            _reserve(self._hdf5, sum(array.nbytes for array in arrays.values()) + _METADATA_BYTES)
            with h5py.File(self._hdf5, "r+", locking=False) as file:
                if group in file and group:  # what an earlier, failed attempt at this step has left
                    del file[group]
                for name, array in arrays.items():
                    file.create_dataset(name, data=array)
                if group:
                    file.require_group(group).attrs.update(about or {})
        self._shapes.update({name: array.shape for name, array in arrays.items()})

    def _grid(self, time: float, datasets: Mapping[str, str]) -> ElementTree.Element:
        grid = ElementTree.Element("Grid", Name=self._name, GridType="Uniform")
        ElementTree.SubElement(grid, "Time", Value=repr(float(time)))
        cells = str(self._shapes[self._topology][0])
        topology = ElementTree.SubElement(
            grid, "Topology", TopologyType=self._cell_type, NumberOfElements=cells
        )
        self._item(topology, self._topology, "Int")
        self._item(ElementTree.SubElement(grid, "Geometry", GeometryType="XYZ"), self._geometry, "Float")
        for name, dataset in datasets.items():
            kind = _ATTRIBUTE_TYPES[len(self._shapes[dataset])]
            attribute = ElementTree.SubElement(
                grid, "Attribute", Name=name, AttributeType=kind, Center="Node"
            )
            self._item(attribute, dataset, "Float")
        return grid

    def _item(self, parent: ElementTree.Element, dataset: str, number: str) -> None:
        dimensions = " ".join(map(str, self._shapes[dataset]))
        item = ElementTree.SubElement(
            parent, "DataItem", Dimensions=dimensions, NumberType=number, Precision="8", Format="HDF"
        )
        item.text = f"{self._hdf5.name}:/{dataset}"


def read_step(stem: Path, index: int = -1) -> Step:
    """Read one step (the last by default) of a pair written by `SeriesFile`. Not collective.

    Raises:
        OutputError: when the file is missing, damaged, or has no such step.
    """
    import h5py

    path = _pair(stem)[1]
    if not path.is_file():
        raise OutputError(f"{path}: no such file; run the scene with output.fields = true")
    try:
        with h5py.File(path, "r", locking=False) as file:
            steps = sorted((name for name in file if name.startswith("step")), key=lambda name: int(name[4:]))
            if not steps:
                raise OutputError(f"{path}: holds no step; the run ended before its first result")
            group = file[steps[index]]
            about = group.attrs
            fields = {name: dataset[()] for name, dataset in group.items()}
            return Step(
                float(about["time"]), file[about["geometry"]][()], file[about["topology"]][()], fields
            )
    except (OSError, KeyError, IndexError, RuntimeError, ValueError) as error:
        raise OutputError(f"{path}: cannot be read: {error}; run the scene again") from error


def _pair(stem: Path) -> tuple[Path, Path]:
    """Paths of both files; a stem may contain dots."""
    return stem.with_name(stem.name + ".xdmf"), stem.with_name(stem.name + ".h5")


def _reserve(path: Path, size: int) -> None:
    """Make sure `size` bytes fit behind the file: HDF5 that runs out of space half-way damages its file.

    HDF5 writes into the reserved bytes and cuts off what it did not need when it closes the file.
    """
    descriptor = os.open(path, os.O_RDWR)
    try:
        end = os.fstat(descriptor).st_size
        os.posix_fallocate(descriptor, end, size)
    finally:
        os.close(descriptor)

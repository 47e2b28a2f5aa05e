"""Fields on a mesh at successive times: an HDF5 file for each step, and an XDMF index.

`fields/000012.h5` holds the attribute `time`, `topology` (cells, nodes per cell) in VTK's order, `geometry`
(nodes, 3) and the fields, (nodes,) or (nodes, 3). Unchanged topology and geometry link to an earlier step.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import OutputError
from ..files import make_directory, opened_hdf5, own, reported, write_hdf5, write_text_atomically
from .ownership import put_aside

log = logging.getLogger("incipient")

MESH = ("topology", "geometry")
_HEAD = '<?xml version="1.0"?>\n<Xdmf Version="3.0">\n  <Domain>\n'
_END = "    </Grid>\n  </Domain>\n</Xdmf>\n"
_ATTRIBUTE_TYPES = {1: "Scalar", 2: "Vector"}
_SAME_TIME = 1e-12  # relative difference of equal times


@dataclass(frozen=True)
class StoredStep:
    """Fields read back: points (nodes, 3), cells (cells, nodes per cell), fields (nodes,) or (nodes, 3)."""

    time: float
    points: np.ndarray
    cells: np.ndarray
    fields: dict[str, np.ndarray]


class SeriesFile:
    """Writes a series step by step, readable at any time.

    stem: path without suffix; cell_type: XDMF's name of the cells, such as "Triangle_6"
    """

    def __init__(self, stem: Path, cell_type: str):
        self._stem, self._cell_type = stem, cell_type
        self._xdmf = stem.with_name(stem.name + ".xdmf")
        self._grids: list[str] = []
        self._number = 0  # of the next step
        self._mesh: dict[str, str] = {}  # names of the files with the newest topology and geometry

    def begin(self, after: float = -math.inf) -> None:
        """Start the series after a time; later steps are removed, unreadable ones are renamed.

        The next step must include a mesh. Raises OutputError.
        """
        own(self._stem)
        make_directory(self._stem, self._stem)
        for path in _paths(self._stem):
            try:
                is_later = _time_of(path) > after + _SAME_TIME * abs(after)
                # Later steps may link to the mesh of one that is removed.
                grid = "" if is_later else self._grid(path)
            except OutputError as error:
                log.warning("%s; it is now %s", str(error).rpartition("; ")[0], put_aside(path))
                continue
            if is_later:
                with reported(path):
                    path.unlink()
            else:
                self._grids.append(grid)
                self._number = int(path.stem) + 1
        if self._grids:
            self._write_xdmf()
        else:
            with reported(self._xdmf):
                self._xdmf.unlink(missing_ok=True)

    def add_step(
        self, time: float, fields: Mapping[str, NDArray[Any]], mesh: Mapping[str, NDArray[Any]]
    ) -> None:
        """Store fields, (nodes,) or (nodes, 3), at a time, and changed parts of the mesh by their names in `MESH`."""
        path = self._stem / f"{self._number:06}.h5"
        links = {name: file for name, file in self._mesh.items() if name not in mesh}
        write_hdf5(path, {**mesh, **fields}, {"time": float(time)}, links)
        self._mesh |= dict.fromkeys(mesh, path.name)
        self._grids.append(self._grid(path))
        self._number += 1
        self._write_xdmf()

    def _write_xdmf(self) -> None:
        collection = 'GridType="Collection" CollectionType="Temporal"'
        head = f'{_HEAD}    <Grid Name="{self._stem.name} in time" {collection}>\n'
        write_text_atomically(self._xdmf, "".join([head, *self._grids, _END]))

    def _grid(self, path: Path) -> str:
        with opened_hdf5(path) as file:
            topology, geometry = (file[name] for name in MESH)
            cells = f'TopologyType="{self._cell_type}" NumberOfElements="{len(topology)}"'
            parts = [
                f'<Time Value="{float(file.attrs["time"])!r}" />',
                f"<Topology {cells}>{self._item(topology)}</Topology>",
                f'<Geometry GeometryType="XYZ">{self._item(geometry)}</Geometry>',
            ]
            for name in sorted(set(file) - {*MESH}):
                about = f'Name="{name}" AttributeType="{_ATTRIBUTE_TYPES[file[name].ndim]}"'
                item = self._item(file[name])
                parts.append(f'<Attribute {about} Center="Node">{item}</Attribute>')
        lines = "".join(f"        {part}\n" for part in parts)
        head = f'<Grid Name="{self._stem.name}" GridType="Uniform">'
        return f"      {head}\n{lines}      </Grid>\n"

    def _item(self, dataset: Any) -> str:
        kind = "Int" if dataset.dtype.kind == "i" else "Float"
        size = f'Dimensions="{" ".join(map(str, dataset.shape))}"'
        about = f'{size} NumberType="{kind}" Precision="{dataset.dtype.itemsize}" Format="HDF"'
        file = f"{self._stem.name}/{Path(dataset.file.filename).name}"
        return f"<DataItem {about}>{file}:{dataset.name}</DataItem>"


def times(stem: Path) -> list[float]:
    """Times of the steps of a series, in order. Raises OutputError without steps."""
    return [_time_of(path) for path in _stored(stem)]


def read_step(stem: Path, index: int = -1) -> StoredStep:
    """One step (default: the last) of a series. Raises OutputError for a missing or damaged step."""
    with opened_hdf5(_stored(stem)[index]) as file:
        stored = {name: file[name][()] for name in file}
        cells, points = (stored.pop(name) for name in MESH)
        return StoredStep(float(file.attrs["time"]), points, cells, stored)


def _paths(stem: Path) -> list[Path]:
    return sorted(stem.glob("[0-9]*.h5"))


def _stored(stem: Path) -> list[Path]:
    if not (paths := _paths(stem)):
        raise OutputError(f"{stem}: holds no fields; run the scene with output.fields = true")
    return paths


def _time_of(path: Path) -> float:
    with opened_hdf5(path) as file:
        return float(file.attrs["time"])

"""A VTKHDF file of a series that XDMF and HDF5 files hold, for readers that know that format; no dolfinx.

Its tables are virtual datasets of HDF5: they point into the pair's HDF5 file, which has to stay beside it, so that
nothing is stored twice. Every place of the mesh is a part of its own; steps on which nothing has moved share one.
Source: VTK's file format VTKHDF, version 2.0, of unstructured grids in time (ParaView from 5.12, VTK from 9.3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..files import part_of, replaced

CELL_TYPES = {"Edge_3": 21, "Triangle_6": 22, "Tetrahedron_10": 24}  # VTK's numbers of XDMF's names
_VERSION = (2, 0)
_ABOUT = "mesh"  # group of what is the same for all steps on one topology


@dataclass(frozen=True)
class _Piece:
    """A dataset of a file, which is a part of a virtual one."""

    file: str
    name: str
    shape: tuple[int, ...]
    dtype: Any

    @classmethod
    def of(cls, dataset: Any, file: str) -> _Piece:
        return cls(file, dataset.name, dataset.shape, dataset.dtype)


def write_vtkhdf(hdf5: Path, cell_type: str, steady: bool) -> Path:
    """Write the VTKHDF file beside the HDF5 file of a series, in place of an earlier one; its path. Not collective.

    `hdf5` is the file that `SeriesFile` writes, with at least one step; with `steady` there is one, whose time means
    nothing. `cell_type` is XDMF's name of the cells. Raises OutputError if it cannot be written, or `hdf5` not be read.
    """
    import h5py

    path = hdf5.with_suffix(".vtkhdf")
    with (
        replaced(path, part_of(path), (RuntimeError, KeyError, ValueError)) as part,
        h5py.File(hdf5, "r", locking=False) as series,
        h5py.File(part, "w", locking=False) as file,
    ):
        _Writer(series, hdf5.name, file, CELL_TYPES[cell_type]).write(steady)
    return path


class _Writer:
    """Puts the steps of a series into an open VTKHDF file."""

    def __init__(self, series: Any, name: str, file: Any, cell: int):
        self._series, self._name, self._file, self._cell = series, name, file, cell
        count = sum(name.startswith("step") for name in series)
        self._steps = [series[f"step{index}"] for index in range(count)]

    def write(self, steady: bool) -> None:
        """Put all steps into the file; of a steady flow the last one, without its time."""
        steps = self._steps[-1:] if steady else self._steps
        meshes = [(step.attrs["topology"], step.attrs["geometry"]) for step in steps]
        parts = list(dict.fromkeys(meshes))
        root = self._file.create_group("VTKHDF")
        root.attrs["Version"] = np.array(_VERSION)
        root.attrs["Type"] = np.bytes_("UnstructuredGrid")
        points = [_Piece.of(self._series[geometry], self._name) for _, geometry in parts]
        cells = [_Piece.of(self._series[topology], self._name) for topology, _ in parts]
        for name, counts in (
            ("NumberOfPoints", [one.shape[0] for one in points]),
            ("NumberOfCells", [one.shape[0] for one in cells]),
            ("NumberOfConnectivityIds", [int(np.prod(one.shape)) for one in cells]),
        ):
            root[name] = np.array(counts, dtype=np.int64)
        _virtual(root, "Points", points)
        _virtual(root, "Connectivity", cells, flat=True)
        described = [self._described(topology) for topology, _ in parts]
        _virtual(root, "Offsets", [offsets for offsets, _ in described])
        _virtual(root, "Types", [types for _, types in described])
        fields = root.create_group("PointData")
        for name in steps[0]:
            _virtual(fields, name, [_Piece.of(step[name], self._name) for step in steps])
        if not steady:
            self._tell_times(root, [parts.index(mesh) for mesh in meshes])

    def _described(self, topology: str) -> tuple[_Piece, _Piece]:
        """Where the cells of a topology begin in its connectivity, and what they are; stored once."""
        group = self._file.require_group(f"{_ABOUT}/{topology}")
        if "types" not in group:
            cells, nodes = self._series[topology].shape
            group["offsets"] = nodes * np.arange(cells + 1, dtype=np.int64)
            group.create_dataset(
                "types", data=np.full(cells, self._cell, dtype=np.uint8), compression="gzip"
            )
        return _Piece.of(group["offsets"], "."), _Piece.of(group["types"], ".")

    def _tell_times(self, root: Any, part_of_step: Sequence[int]) -> None:
        """When the steps are, and where what belongs to each begins."""
        times = root.create_group("Steps")
        times.attrs["NSteps"] = len(self._steps)
        times["Values"] = np.array([float(step.attrs["time"]) for step in self._steps])
        times["NumberOfParts"] = np.ones(len(self._steps), dtype=np.int64)
        times["PartOffsets"] = np.array(part_of_step, dtype=np.int64)
        for name, of in (
            ("PointOffsets", "NumberOfPoints"),
            ("CellOffsets", "NumberOfCells"),
            ("ConnectivityIdOffsets", "NumberOfConnectivityIds"),
        ):
            begins = _begins(root[of][()])[list(part_of_step)]
            times[name] = begins if name == "PointOffsets" else begins[:, None]
        at = times.create_group("PointDataOffsets")
        for name in root["PointData"]:
            at[name] = _begins([step[name].shape[0] for step in self._steps])


def _begins(counts: Any) -> np.ndarray:
    """Where each of consecutive runs of so many begins."""
    return np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64)


def _virtual(group: Any, name: str, pieces: Sequence[_Piece], flat: bool = False) -> None:
    """Make a dataset of which the pieces are consecutive rows; flat: all their numbers in one row."""
    from h5py import h5d, h5p, h5s, h5t

    rows = [int(np.prod(one.shape)) if flat else one.shape[0] for one in pieces]
    row = () if flat else pieces[0].shape[1:]
    target = h5s.create_simple((sum(rows), *row))
    plan = h5p.create(h5p.DATASET_CREATE)
    for begin, count, piece in zip(_begins(rows), rows, pieces, strict=True):
        target.select_hyperslab((int(begin), *(0 for _ in row)), (count, *row))
        source = h5s.create_simple(piece.shape)
        source.select_all()
        plan.set_virtual(target, piece.file.encode(), piece.name.encode(), source)
    target.select_all()
    h5d.create(group.id, name.encode(), h5t.py_create(pieces[0].dtype), target, dcpl=plan)

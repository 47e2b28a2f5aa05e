"""HDF5 files that all ranks write at once, each its own rows of a table, by an HDF5 library that knows no MPI.

A table is stored in one piece, whose place in the file the library tells before anything is in it. Rank 0 makes the
file with all its tables, empty; then each rank writes its rows to their place.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .rows import Rows


def reserve(group: Any, name: str, rows: Rows) -> int:
    """Make a dataset for a table, without its content; the place of its first byte in the file. Not collective."""
    import h5py

    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_layout(h5py.h5d.CONTIGUOUS)
    properties.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    properties.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    kind = h5py.h5t.py_create(rows.values.dtype, logical=True)
    space = h5py.h5s.create_simple(rows.shape)
    within, _, last = name.rpartition("/")
    holder = group.require_group(within) if within else group
    made = h5py.h5d.create(holder.id, last.encode(), kind, space, properties)
    return int(made.get_offset() or 0)


def write_rows(path: Path, places: Mapping[str, int], tables: Mapping[str, Rows]) -> None:
    """Write this rank's rows of tables to the places that `reserve` gave. On every rank. Raises OSError."""
    descriptor = os.open(path, os.O_WRONLY)
    try:
        for name, rows in tables.items():
            data = np.ascontiguousarray(rows.values).reshape(-1).view(np.uint8).data
            place = places[name] + rows.first * (len(data) // max(len(rows.values), 1))
            while data:
                written = os.pwrite(descriptor, data, place)
                data, place = data[written:], place + written
    finally:
        os.close(descriptor)

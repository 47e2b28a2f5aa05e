"""HDF5 files that all ranks write at once, each its own rows of a table, by an HDF5 library that knows no MPI.

A table is stored in one piece, whose place in the file the library tells before anything is in it. Rank 0 makes the
file with all its tables, empty; then each rank writes its rows to their place.

What HDF5 itself changes in a file when it closes it, in many places, is written through a journal: a process that is
killed meanwhile leaves either the file as it was or a journal that completes it.
"""

from __future__ import annotations

import io
import os
import struct
import zlib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from .rows import Rows

_PAIR = struct.Struct("<QQ")


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
            _write_at(
                descriptor,
                data,
                places[name] + rows.first * (len(data) // max(len(rows.values), 1)),
            )
    finally:
        os.close(descriptor)


class WriteAhead(io.RawIOBase):
    """A file opened for HDF5, whose changes are kept in memory until `commit`. Not collective.

    Changes are what HDF5 knows of tables, some kilobytes; the tables themselves go to the file past it.
    """

    def __init__(
        self, path: Path, size: int | None = None, changes: Iterable[tuple[int, bytes]] = ()
    ):
        super().__init__()
        self._path, self._file = path, path.open("rb", buffering=0)
        self._size = os.fstat(self._file.fileno()).st_size if size is None else size
        self._place, self._changes = 0, list(changes)

    def readable(self) -> bool:
        """See `io.RawIOBase`."""
        return True

    writable = seekable = readable

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """See `io.RawIOBase`."""
        start = {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: self._size}[whence]
        self._place = start + offset
        return self._place

    def tell(self) -> int:
        """See `io.RawIOBase`."""
        return self._place

    def readinto(self, buffer: Any) -> int:
        """See `io.RawIOBase`; what has been changed is read as it will be."""
        wanted = min(len(buffer), max(self._size - self._place, 0))
        held = bytearray(os.pread(self._file.fileno(), wanted, self._place).ljust(wanted, b"\0"))
        for at, data in self._changes:
            first, last = max(at, self._place), min(at + len(data), self._place + wanted)
            if first < last:
                held[first - self._place : last - self._place] = data[first - at : last - at]
        buffer[:wanted] = held
        self._place += wanted
        return wanted

    def write(self, data: Any) -> int:
        """See `io.RawIOBase`."""
        self._changes.append((self._place, bytes(data)))
        self._place += len(data)
        self._size = max(self._size, self._place)
        return len(data)

    def truncate(self, size: int | None = None) -> int:
        """See `io.RawIOBase`."""
        self._size = self._place if size is None else size
        return self._size

    def close(self) -> None:
        """Close the file without its changes, unless `commit` has made them."""
        self._file.close()
        super().close()

    def commit(self) -> None:
        """Make the changes: the journal first, then the file, so that one of both is whole."""
        changes = _packed(self._size, self._changes)
        journal = journal_of(self._path)
        journal.unlink(missing_ok=True)
        with journal.open("xb") as stream:  # never through a link
            stream.write(zlib.crc32(changes).to_bytes(4, "big") + changes)
            stream.flush()
            os.fsync(stream.fileno())
        complete(self._path)


def journal_of(path: Path) -> Path:
    """Where the changes of a file are before they are made."""
    return path.with_name(path.name + ".journal")


def complete(path: Path) -> None:
    """Make the changes in a file's journal, if that is whole; made twice they are the same.

    Raises OSError where the file cannot be written or is a link. Not collective.
    """
    if not os.path.lexists(journal_of(path)):
        return
    if (held := _journal(path)) is not None:
        size, changes = held
        descriptor = os.open(path, os.O_WRONLY | os.O_NOFOLLOW)
        try:
            for at, data in changes:
                _write_at(descriptor, data, at)
            os.ftruncate(descriptor, size)
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    journal_of(path).unlink(missing_ok=True)


def completed(path: Path) -> Path | WriteAhead:
    """What h5py reads a file from: with a journal, its content as `complete` would make it. Writes nothing."""
    held = _journal(path)
    return path if held is None else WriteAhead(path, *held)


def _journal(path: Path) -> tuple[int, list[tuple[int, bytes]]] | None:
    """Size and changes that a file's journal holds; None without one, or if it is not whole. Raises OSError."""
    journal = journal_of(path)
    held = journal.read_bytes() if journal.is_file() else b""
    if len(held) <= 4 or zlib.crc32(held[4:]) != int.from_bytes(held[:4], "big"):
        return None
    with suppress(struct.error):  # a checksum is easily made right, too
        return _unpacked(held[4:])
    return None


def _packed(size: int, changes: list[tuple[int, bytes]]) -> bytes:
    """The size of a file, and for each change its place, its length and its bytes."""
    parts = [part for at, data in changes for part in (_PAIR.pack(at, len(data)), data)]
    return b"".join([_PAIR.pack(size, len(changes)), *parts])


def _unpacked(held: bytes) -> tuple[int, list[tuple[int, bytes]]]:
    (size, count), changes, start = _PAIR.unpack_from(held), [], _PAIR.size
    for _ in range(count):
        at, length = _PAIR.unpack_from(held, start)
        start += _PAIR.size + length
        changes.append((at, held[start - length : start]))
    return size, changes


def _write_at(descriptor: int, data: bytes | memoryview, place: int) -> None:
    while data:
        written = os.pwrite(descriptor, data, place)
        data, place = data[written:], place + written

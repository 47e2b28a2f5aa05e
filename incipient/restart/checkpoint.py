"""All that a run needs to resume, in one file: what it holds, written whole or not at all, read whole or refused.

An HDF5 file: every array a dataset, every other value a dataset of JSON text, parts as groups. The attributes of
the file are its `format`, `version`, the `program` that wrote it, and a `digest` of all it holds. Ranks write and
read their rows of the large arrays at once, so that none has the whole of one; the file is in reach of all of them.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, fields, is_dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import numpy as np

from ..arrays import Floats, Integers
from ..errors import OutputError
from ..files import cause_of, claim, part_of, reported, sync
from ..parallel import Comm, collectively, from_first
from ..tables.hdf5 import reserve, write_rows
from ..tables.rows import Rows, block

T = TypeVar("T")

FORMAT, VERSION = "incipient checkpoint", 7
ANEW = "start a new run with: incipient run"
METADATA_BYTES = 1 << 16


@dataclass(frozen=True)
class Recorded:
    """How far the history had come: rows, the header not counted, and bytes of history.csv."""

    rows: int = 0
    bytes: int = 0


@dataclass(frozen=True)
class Progress:
    """How far a run has come and what it has cost.

    number:      number of time steps done
    next_length: length of the step to come, where steps adapt
    error:       error of the last step, by which the next one's tolerance goes; None where it is unknown
    total:       wall time of all sessions [s]
    """

    number: int
    next_length: float
    error: float | None
    first_motion: float | None
    iterations: dict[str, int]
    linear: dict[str, int]
    wall_time: dict[str, float]
    total: float


@dataclass(frozen=True, eq=False)
class StoredMesh:
    """A mesh with its named boundaries, of nodes and cells this rank's rows.

    nodes:  (n, gdim) places
    cells:  (cells, nodes per cell) rows of `nodes`, in the library's order within a cell
    facets: (facets, gdim) rows of `nodes`, ascending: the corners of each named facet
    tags:   (facets,) numbers of their names
    """

    degree: int
    nodes: Rows
    cells: Rows
    facets: Integers
    tags: Integers
    names: dict[str, int]


@dataclass(frozen=True, eq=False)
class StoredFlow:
    """States of a flow: velocities (n, states, gdim) and pressures (m, states) at their nodes (n, 3), (m, 3)."""

    velocity_points: Rows
    pressure_points: Rows
    velocities: Rows
    pressures: Rows


@dataclass(frozen=True, eq=False)
class StoredValues:
    """States (n, states, 2) of the logarithms of k and epsilon or omega at nodes (n, 3), the present one first."""

    points: Rows
    logarithms: Rows


@dataclass(frozen=True, eq=False)
class StoredBody:
    """A moving grain, its coupling to the fluid and its mesh. States are place, angle or quaternion, velocities.

    made, weights:   places (nodes, 3) of the mesh when made, and how each node follows the grain (nodes, gdim + 1)
    made_for:        state for which it was made
    states, times:   of the grain, now and a step before (n, 6 or 13), (n,)
    places:          places of the mesh's nodes then (nodes, n, 3)
    mean_load:       load in the last step (k,), None before the first; with the order and length of that step
    load, flow_load: at the end of the last step (k,)
    velocities:      velocities of the grain as they limit the steps' length, one row for each past state of the flow
    on_bed:          contacts with the bed and what the grain has done there; None where it does not go on there
    """

    made: Rows
    weights: Rows
    made_for: Floats
    states: Floats
    times: Floats
    places: Rows
    mean_load: Floats | None
    mean_load_order: int
    mean_load_step: float | None
    load: Floats
    flow_load: Floats
    length: float
    velocities: Floats
    met: bool
    remeshings: list[dict[str, Any]]
    interface_iterations: Floats
    on_bed: dict[str, Any] | None = None


@dataclass(frozen=True, eq=False)
class StoredSurface:
    """A free surface and its mesh, the present state first.

    made:       places (nodes, 3) of the mesh when made
    elevations: at the mesh's nodes, zero off the surface (nodes, states), at `times` (states,)
    places:     of the mesh's nodes now and a step before (nodes, n, 3)
    """

    made: Rows
    elevations: Rows
    times: Floats
    places: Rows


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A run between two steps. `times` (states,) are those of the flow's states, the present one first."""

    scene: str
    progress: Progress
    mesh: StoredMesh
    times: Floats
    flow: StoredFlow
    body: StoredBody | None = None
    recorded: Recorded = Recorded()
    surface: StoredSurface | None = None
    turbulence: StoredValues | None = None

    @property
    def time(self) -> float:
        """The time that the run has reached."""
        return float(self.times[0])


def write(path: Path, checkpoint: Checkpoint, comm: Comm) -> None:
    """Write a file so that at any moment there is the old one or the new one. Collective; all but rows is rank 0's.

    Raises:
        OutputError: on all ranks, it cannot be written; the old one is as it was.
    """
    part, tables = part_of(path), _tables(checkpoint)
    checksums = _checksums(comm, tables)

    def made() -> dict[str, int]:
        claim(path)
        with reported(path, (RuntimeError,)):
            part.unlink(missing_ok=True)
            return _made(part, checkpoint, checksums)

    try:
        places = from_first(comm, made)
        with collectively(comm), reported(path):
            write_rows(part, places, tables)
            sync(part)
        with collectively(comm), reported(path):
            if comm.rank == 0:
                part.replace(path)
    except OutputError:
        if comm.rank == 0:
            with suppress(OSError):
                part.unlink(missing_ok=True)
        raise


def _made(path: Path, checkpoint: Checkpoint, checksums: dict[str, str]) -> dict[str, int]:
    """Make the file with all but the rows of tables; the place of each table in it, by its name.

    HDF5 that runs out of space takes the program with it: whether there is enough is asked beforehand, and it is kept.
    """
    size = METADATA_BYTES + sum(_size(one) for _, one in _members(checkpoint))
    with path.open("wb") as file:
        os.posix_fallocate(file.fileno(), 0, size)
    with _hdf5(path, "w") as file:
        places = _put(file, checkpoint)
        file.attrs.update(
            {"format": FORMAT, "digest": _digest(file, checksums), "version": VERSION}
        )
        file.attrs["program"] = f"incipient {metadata.version('incipient')}"
    with path.open("r+b") as file:
        os.posix_fallocate(file.fileno(), 0, path.stat().st_size)
    return places


def read(path: Path, comm: Comm) -> Checkpoint:
    """Read a file written by `write`, on any number of ranks, each an equal share of its rows. Collective.

    Raises:
        OutputError: on all ranks, there is none, it is damaged, of another version, or something is missing in it.
    """
    with collectively(comm):
        if not path.is_file():
            raise OutputError(
                f"{path}: no such checkpoint; {ANEW}, with output.checkpoint set to have one"
            )
        with _opened(path) as file:
            _require_readable(path, file)
            found = _got(Checkpoint, file, path, comm)
    checksums = _checksums(comm, _tables(found))
    with collectively(comm), _opened(path) as file:
        if file.attrs.get("digest") != _digest(file, checksums):
            raise OutputError(f"{path}: is damaged, its content is not what was written; {ANEW}")
    return found


def _hdf5(path: Path, mode: str) -> Any:
    import h5py

    return h5py.File(path, mode, locking=False)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """The file, to be read."""
    try:
        with _hdf5(path, "r") as file:
            yield file
    except (OSError, KeyError, RuntimeError, ValueError, TypeError) as error:
        raise OutputError(f"{path}: cannot be read: {cause_of(error)}; {ANEW}") from error


def _require_readable(path: Path, file: Any) -> None:
    about = file.attrs
    if about.get("format") != FORMAT:
        raise OutputError(f"{path}: is not a checkpoint; give the directory of a run")
    if about.get("version") != VERSION:
        raise OutputError(
            f"{path}: is a checkpoint of version {about.get('version')}, this program reads version {VERSION}; "
            f"resume with the program that wrote it ({about.get('program')})"
        )


def _members(part: Any, within: str = "") -> Iterator[tuple[str, Any]]:
    """What a dataclass and those within it hold, with full names."""
    for field in fields(part):
        name, value = f"{within}/{field.name}", getattr(part, field.name)
        if is_dataclass(value) and not isinstance(value, Rows):
            yield from _members(value, name)
        else:
            yield name, value


def _tables(part: Any) -> dict[str, Rows]:
    """The tables of which ranks have rows, by their full names."""
    return {name: value for name, value in _members(part) if isinstance(value, Rows)}


def _size(value: Any) -> int:
    """Bytes of a member, of tables the whole."""
    return int(value.nbytes) if isinstance(value, Rows | np.ndarray) else 4 * len(json.dumps(value))


def _put(file: Any, checkpoint: Checkpoint) -> dict[str, int]:
    """Store the members, of tables their shape; places of these by their names."""
    places = {}
    for name, value in _members(checkpoint):
        if isinstance(value, Rows):
            places[name] = reserve(file, name, value)
        else:
            file[name] = value if isinstance(value, np.ndarray) else json.dumps(value)
    return places


def _got(kind: type[T], group: Any, path: Path, comm: Comm) -> T:
    """A dataclass from its stored fields, of which none may be missing, of tables this rank's share. Not collective."""
    found: dict[str, Any] = {}
    for name, hint in get_type_hints(kind).items():
        if name not in group:
            raise OutputError(f"{path}: {f'{group.name}/{name}'.strip('/')} is missing; {ANEW}")
        stored = group[name]
        if hasattr(stored, "keys"):
            kind_of_part = next(one for one in (hint, *get_args(hint)) if is_dataclass(one))
            found[name] = _got(kind_of_part, stored, path, comm)  # type: ignore[arg-type]
        elif hint is Rows:
            mine = block(len(stored), comm.rank, comm.size)
            found[name] = Rows(stored[mine], mine.start, len(stored))
        else:
            found[name] = json.loads(stored.asstr()[()]) if stored.dtype.kind == "O" else stored[()]
    return kind(**found)


def _checksums(comm: Comm, tables: dict[str, Rows]) -> dict[str, str]:
    """What tables are and the checksums of their contents, by their names, the same on all ranks. Collective."""
    mine = np.array([rows.checksum() for rows in tables.values()], dtype=np.uint64)
    sums = np.sum(comm.allgather(mine), axis=0, dtype=np.uint64).tolist()
    found = zip(tables.items(), sums, strict=True)
    return {name: f"{name} {rows.values.dtype} {rows.shape} {one}" for (name, rows), one in found}


def _digest(file: Any, checksums: dict[str, str]) -> str:
    """Checksum over the names, shapes and contents of all datasets, given those of tables."""
    whole = hashlib.sha256()
    for name, dataset in _datasets(file):
        if name in checksums:
            whole.update(checksums[name].encode())
            continue
        value = dataset[()]
        about = f"{name} {dataset.dtype} {dataset.shape} ".encode()
        whole.update(
            about + (value if isinstance(value, bytes) else np.ascontiguousarray(value).tobytes())
        )
    return whole.hexdigest()


def _datasets(group: Any) -> Iterator[tuple[str, Any]]:
    """All datasets with their full names, in the order of the names."""
    for name in sorted(group):
        member = group[name]
        if hasattr(member, "keys"):
            yield from _datasets(member)
        else:
            yield member.name, member

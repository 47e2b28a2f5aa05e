"""All that a run needs to go on, in one file: what it holds, written whole or not at all, read whole or refused.

An HDF5 file: every array a dataset, every other value a dataset of JSON text, parts as groups. The attributes of
the file are its `format`, `version`, the `program` that wrote it, and a `digest` of all it holds.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import numpy as np

from ..arrays import Floats, Integers
from ..errors import OutputError
from ..files import cause_of, write_bytes_atomically

T = TypeVar("T")

FORMAT, VERSION = "incipient checkpoint", 3
ANEW = "start anew with: incipient run"


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
class WholeMesh:
    """A mesh with its named boundaries.

    nodes:  (n, gdim) places
    cells:  (cells, nodes per cell) rows of `nodes`, in the library's order within a cell
    facets: (facets, gdim) rows of `nodes`, ascending: the corners of each named facet
    tags:   (facets,) numbers of their names
    """

    degree: int
    nodes: Floats
    cells: Integers
    facets: Integers
    tags: Integers
    names: dict[str, int]


@dataclass(frozen=True, eq=False)
class WholeFlow:
    """States of a flow: velocities (states, n, gdim) and pressures (states, m) at their nodes (n, 3), (m, 3)."""

    velocity_points: Floats
    pressure_points: Floats
    velocities: Floats
    pressures: Floats


@dataclass(frozen=True, eq=False)
class Body:
    """A moving grain, its coupling to the fluid and its mesh. States are place, angle or quaternion, velocities.

    made, weights:   places (nodes, 3) of the mesh when made, and how each node follows the grain (nodes, gdim + 1)
    made_for:        state for which it was made
    states, times:   of the grain, now and a step before (n, 6 or 13), (n,)
    places:          places of the mesh's nodes then (n, nodes, 3)
    mean_load:       load in the last step (k,), None before the first; with the order and length of that step
    load, flow_load: at the end of the last step (k,)
    velocities:      velocities of the grain as they limit the steps' length, one row for each past state of the flow
    """

    made: Floats
    weights: Floats
    made_for: Floats
    states: Floats
    times: Floats
    places: Floats
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


@dataclass(frozen=True, eq=False)
class Surface:
    """A free surface and its mesh, the present state first.

    made:       places (nodes, 3) of the mesh when made
    elevations: at the mesh's nodes, zero off the surface (states, nodes), at `times` (states,)
    places:     of the mesh's nodes now and a step before (n, nodes, 3)
    """

    made: Floats
    elevations: Floats
    times: Floats
    places: Floats


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A run between two steps. `times` (states,) are those of the flow's states, the present one first."""

    scene: str
    progress: Progress
    mesh: WholeMesh
    times: Floats
    flow: WholeFlow
    body: Body | None
    recorded: Recorded = Recorded()
    surface: Surface | None = None

    @property
    def time(self) -> float:
        """The time that the run has reached."""
        return float(self.times[0])


def write(path: Path, checkpoint: Checkpoint) -> None:
    """Write a file so that at any moment there is the old one or the new one. Not collective.

    Raises:
        OutputError: it cannot be written; the old one is as it was.
    """
    import h5py

    # Made in memory: a disk that is full then is noticed before the file takes the old one's place.
    image = io.BytesIO()
    with h5py.File(image, "w") as file:
        _put(file, checkpoint)
        about = {"version": VERSION, "program": f"incipient {metadata.version('incipient')}"}
        file.attrs.update({"format": FORMAT, "digest": _digest(file), **about})
    write_bytes_atomically(path, image.getvalue())


def read(path: Path) -> Checkpoint:
    """Read a file written by `write`. Not collective.

    Raises:
        OutputError: there is none, it is damaged, of another version, or something is missing in it.
    """
    import h5py

    if not path.is_file():
        raise OutputError(f"{path}: no such checkpoint; {ANEW}, with output.checkpoint set to have one")
    try:
        with h5py.File(path, "r", locking=False) as file:
            _require_readable(path, file)
            return _got(Checkpoint, file, path)
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
    if about.get("digest") != _digest(file):
        raise OutputError(f"{path}: is damaged, its content is not what was written; {ANEW}")


# -- as datasets ------------------------------------------------------------------------------------


def _put(group: Any, part: Any) -> None:
    """Store the fields of a dataclass."""
    for field in fields(part):
        value = getattr(part, field.name)
        if is_dataclass(value):
            _put(group.create_group(field.name), value)
        elif isinstance(value, np.ndarray):
            group[field.name] = value
        else:
            group[field.name] = json.dumps(value)


def _got(kind: type[T], group: Any, path: Path) -> T:
    """A dataclass from its stored fields, of which none may be missing."""
    found = {}
    for name, hint in get_type_hints(kind).items():
        if name not in group:
            raise OutputError(
                f"{path}: {group.name.strip('/')}/{name} is missing; {ANEW}".replace(": /", ": ")
            )
        stored = group[name]
        if hasattr(stored, "keys"):
            found[name] = _got(_dataclass_of(hint), stored, path)
        else:
            found[name] = json.loads(stored.asstr()[()]) if stored.dtype.kind == "O" else stored[()]
    return kind(**found)


def _dataclass_of(hint: Any) -> Any:
    """The dataclass that a field is, or may be."""
    return next(kind for kind in (hint, *get_args(hint)) if is_dataclass(kind))


def _digest(file: Any) -> str:
    """Checksum over the names, shapes and contents of all datasets."""
    whole = hashlib.sha256()
    for name, dataset in _datasets(file):
        value = dataset[()]
        about = f"{name} {dataset.dtype} {dataset.shape} ".encode()
        whole.update(about + (value if isinstance(value, bytes) else np.ascontiguousarray(value).tobytes()))
    return whole.hexdigest()


def _datasets(group: Any) -> Iterator[tuple[str, Any]]:
    """All datasets with their full names, in the order of the names."""
    for name in sorted(group):
        member = group[name]
        if hasattr(member, "keys"):
            yield from _datasets(member)
        else:
            yield member.name, member

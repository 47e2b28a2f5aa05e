"""All that a run needs to resume, in one file: written whole or not at all, read whole or refused.

An HDF5 file: every array a dataset, every other value one of the bytes of JSON text, parts as groups. The attributes
of the file are its `format`, `version` and the `program` that wrote it. Arrays are whole: on rank 0 when they are
written, on every rank when they are read; the file is in reach of all of them.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import numpy as np

from ..arrays import Floats, Integers
from ..errors import OutputError
from ..files import opened_hdf5, write_hdf5
from ..parallel import Comm, collectively

T = TypeVar("T")

FORMAT, VERSION = "incipient checkpoint", 8
ANEW = "start a new run with: incipient run"


@dataclass(frozen=True)
class Progress:
    """Time reached by a run, and its cost.

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
class StoredFlow:
    """States of a flow: velocities (n, states, gdim) and pressures (m, states) at their nodes (n, 3), (m, 3)."""

    velocity_points: Floats
    pressure_points: Floats
    velocities: Floats
    pressures: Floats


@dataclass(frozen=True, eq=False)
class StoredValues:
    """States (n, states, 2) of the logarithms of k and epsilon or omega at nodes (n, 3), the present one first."""

    points: Floats
    logarithms: Floats


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
    on_bed: dict[str, Any] | None = None


@dataclass(frozen=True, eq=False)
class StoredSurface:
    """A free surface and its mesh, the present state first.

    made:       places (nodes, 3) of the mesh when made
    elevations: at the mesh's nodes, zero off the surface (nodes, states), at `times` (states,)
    places:     of the mesh's nodes now and a step before (nodes, n, 3)
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
    mesh: StoredMesh
    times: Floats
    flow: StoredFlow
    body: StoredBody | None = None
    surface: StoredSurface | None = None
    turbulence: StoredValues | None = None

    @property
    def time(self) -> float:
        """The time that the run has reached."""
        return float(self.times[0])


def write(path: Path, checkpoint: Checkpoint, comm: Comm) -> None:
    """Write what rank 0 has, so that at any moment there is the old file or the new one. Collective.

    Raises:
        OutputError: on all ranks, it cannot be written; the old one is as it was.
    """
    program = f"incipient {metadata.version('incipient')}"
    about = {"format": FORMAT, "version": VERSION, "program": program}
    with collectively(comm):
        if comm.rank == 0:
            write_hdf5(path, dict(_datasets(checkpoint)), about)


def read(path: Path, comm: Comm) -> Checkpoint:
    """Read a file written by `write`, whole on any number of ranks. Collective.

    Raises:
        OutputError: on all ranks, there is none, it is damaged, of another version, or something is missing in it.
    """
    with collectively(comm):
        if not path.is_file():
            raise OutputError(
                f"{path}: no such checkpoint; {ANEW}, with output.checkpoint set to have one"
            )
        with opened_hdf5(path, ANEW) as file:
            _require_readable(path, file)
            checkpoint = _got(Checkpoint, file, path)
    return checkpoint


def _require_readable(path: Path, file: Any) -> None:
    about = file.attrs
    if about.get("format") != FORMAT:
        raise OutputError(f"{path}: is not a checkpoint; give the directory of a run")
    if about.get("version") != VERSION:
        raise OutputError(
            f"{path}: is a checkpoint of version {about.get('version')}, this program reads version {VERSION}; "
            f"resume with the program that wrote it ({about.get('program')})"
        )


def _datasets(part: Any, within: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """What a dataclass and those within it hold, with full names: arrays, and bytes of JSON text."""
    for field in fields(part):
        name, value = f"{within}/{field.name}", getattr(part, field.name)
        if is_dataclass(value):
            yield from _datasets(value, name)
        elif isinstance(value, np.ndarray):
            yield name, value
        else:
            yield name, np.frombuffer(json.dumps(value).encode(), dtype=np.uint8)


def _got(kind: type[T], group: Any, path: Path) -> T:
    """A dataclass from its stored fields, of which none may be missing."""
    parts: dict[str, Any] = {}
    for name, hint in get_type_hints(kind).items():
        if name not in group:
            raise OutputError(f"{path}: {f'{group.name}/{name}'.strip('/')} is missing; {ANEW}")
        stored = group[name]
        if hasattr(stored, "keys"):
            kind_of_part = next(one for one in (hint, *get_args(hint)) if is_dataclass(one))
            parts[name] = _got(kind_of_part, stored, path)  # type: ignore[arg-type]
        else:
            values = stored[()]
            parts[name] = json.loads(values.tobytes()) if values.dtype == np.uint8 else values
    return kind(**parts)

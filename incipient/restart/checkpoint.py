"""Checkpoint file of a run: HDF5 with arrays, JSON texts and dataclasses as groups."""

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
from ..parallel import Comm, collectively, on_first

T = TypeVar("T")

FORMAT, VERSION = "incipient checkpoint", 10
ANEW = "start a new run with: incipient run"


@dataclass(frozen=True)
class Progress:
    """Time reached by a run, and its cost.

    number:      of completed time steps
    next_length: of the next step, for adaptive steps
    error:       of the last step, which sets the tolerance of the next, or None
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

    nodes: (n, gdim) positions; cells: (cells, nodes per cell) rows of `nodes`, in the library's order
    facets: (facets, gdim) rows of `nodes`, ascending: the vertices of each named facet; tags: their names' indices
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
class StoredMotion:
    """Positions of a moving mesh: initial ones (nodes, 3), present and previous ones (nodes, n, 3)."""

    made: Floats
    places: Floats


@dataclass(frozen=True, eq=False)
class StoredBody:
    """A moving grain and its coupling. States are place, angle or quaternion, velocities.

    weights: of the nodes in the grain's motion (nodes, gdim + 1)
    made_for: state at meshing
    states, times: of the grain, present and previous (n, 6 or 13), (n,)
    mean_load: in the last step (k,), or None; load, flow_load: at its end (k,)
    velocities: of the grain, one row for each past state of the flow
    on_bed: contacts and motion on the bed; None if contact ends the run
    """

    weights: Floats
    made_for: Floats
    states: Floats
    times: Floats
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
    """A free surface: elevations at the nodes, zero off it (nodes, states), at `times` (states,), the present first."""

    elevations: Floats
    times: Floats


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A run between two steps. `times` (states,): of the flow's states, the present one first."""

    scene: str
    progress: Progress
    mesh: StoredMesh
    times: Floats
    flow: StoredFlow
    motion: StoredMotion | None = None
    body: StoredBody | None = None
    surface: StoredSurface | None = None
    turbulence: StoredValues | None = None

    @property
    def time(self) -> float:
        return float(self.times[0])


def write(path: Path, checkpoint: Checkpoint, comm: Comm) -> None:
    """Write the checkpoint of rank 0 atomically. Collective.

    Raises OutputError on all ranks; the old file is unchanged.
    """
    program = f"incipient {metadata.version('incipient')}"
    about = {"format": FORMAT, "version": VERSION, "program": program}
    on_first(comm, lambda: write_hdf5(path, dict(_datasets(checkpoint)), about))


def read(path: Path, comm: Comm) -> Checkpoint:
    """Read a checkpoint on every rank. Collective.

    Raises OutputError on all ranks: the file is missing, damaged, incomplete or of another version.
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
    for field in fields(part):
        name, value = f"{within}/{field.name}", getattr(part, field.name)
        if is_dataclass(value):
            yield from _datasets(value, name)
        elif isinstance(value, np.ndarray):
            yield name, value
        else:
            yield name, np.frombuffer(json.dumps(value).encode(), dtype=np.uint8)


def _got(kind: type[T], group: Any, path: Path) -> T:
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

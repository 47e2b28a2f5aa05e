"""Checkpoints of runs, written, read and restored on any number of ranks.

The file is HDF5 with arrays, JSON texts and dataclasses as groups. Mesh and nodal values are gathered on rank 0.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.spatial import KDTree

from . import compat
from .arrays import Floats, Integers
from .body.rigidbody import MeanLoad
from .errors import OutputError
from .files import opened_hdf5, write_hdf5
from .fluid import Fluid
from .fluid.transient import Past, Transient
from .mesh.cells import cell_facets, input_numbers
from .mesh.domain import Domain, named_facets
from .parallel import Comm, NumberedRows, collectively, joined, on_first

T = TypeVar("T")

FORMAT, VERSION = "incipient checkpoint", 12
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
class StoredField:
    """States (n, states, components) of a field at its nodes (n, 3), the present one first."""

    points: Floats
    values: Floats


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
    load, flow_load: at the end of the last step (k,)
    velocities: of the grain, one row for each past state of the flow
    contacts: (n, 2 gdim + 8) those with the bed: points, normals, impulses, velocities, rolling; on_bed: motion on it;
        None if contact ends the run
    """

    weights: Floats
    made_for: Floats
    states: Floats
    times: Floats
    mean_load: MeanLoad
    load: Floats
    flow_load: Floats
    length: float
    velocities: Floats
    met: bool
    remeshings: list[dict[str, Any]]
    interface_iterations: Floats
    contacts: Floats | None = None
    on_bed: dict[str, Any] | None = None


@dataclass(frozen=True, eq=False)
class StoredSurface:
    """A free surface: elevations at the nodes, zero off it (nodes, states), at `times` (states,), the present first."""

    elevations: Floats
    times: Floats


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A run between two steps.

    times: (states,) of the flow's states; turbulence: logarithms of k and epsilon or omega
    """

    scene: str
    progress: Progress
    mesh: StoredMesh
    times: Floats
    velocity: StoredField
    pressure: StoredField
    motion: StoredMotion | None = None
    body: StoredBody | None = None
    surface: StoredSurface | None = None
    turbulence: StoredField | None = None

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
            about = file.attrs
            if about.get("format") != FORMAT:
                raise OutputError(f"{path}: is not a checkpoint; give the directory of a run")
            if (number := about.get("version")) != VERSION:
                raise OutputError(
                    f"{path}: is a checkpoint of version {number}, this program reads version {VERSION}; "
                    f"resume with the program that wrote it ({about.get('program')})"
                )
            return _got(Checkpoint, file, path)


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


def numbered_nodes(mesh: Any) -> NumberedRows:
    """Rows of `mesh.geometry.x`, numbered in the original order of the nodes. Collective."""
    return NumberedRows(mesh.comm, input_numbers(mesh))


def stored_mesh(domain: Domain) -> StoredMesh:
    """The present mesh, complete on rank 0. Collective."""
    mesh, given = domain.mesh, input_numbers(domain.mesh)
    nodes = numbered_nodes(mesh)
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    cells = NumberedRows(mesh.comm, mesh.topology.original_cell_index[:owned])
    facets, tags = _tagged(domain, owned)
    return StoredMesh(
        degree=compat.geometry_degree(mesh),
        nodes=nodes.joined(mesh.geometry.x[:, : domain.gdim]),
        cells=nodes.places_of(cells.joined(given[compat.geometry_dofs(mesh)[:owned]])),
        facets=nodes.places_of(joined(mesh.comm, given[facets])),
        tags=joined(mesh.comm, tags),
        names=dict(domain.names),
    )


def stored_flow(fluid: Fluid, states: Sequence[Floats]) -> dict[str, StoredField]:
    """States (local unknowns,) of a fluid: velocity and pressure, complete on rank 0. Collective."""
    space = fluid.space
    velocities = [state[space.velocity_map] for state in states]
    pressures = [state[space.pressure_map] for state in states]
    points = space.velocity_points(), space.pressure.tabulate_dof_coordinates()
    return {
        "velocity": stored_field(space.velocity, points[0], velocities),
        "pressure": stored_field(space.pressure, points[1], pressures),
    }


def stored_field(space: Any, points: Floats, states: Sequence[Floats]) -> StoredField:
    """States (local unknowns,) of a field at its nodes (local nodes, 3), complete on rank 0. Collective."""
    values = np.stack([state.reshape(len(points), -1) for state in states], axis=1)
    owned = space.dofmap.index_map.size_local
    return StoredField(*(joined(space.mesh.comm, part[:owned]) for part in (points, values)))


def _tagged(domain: Domain, owned: int) -> tuple[NDArray[np.int32], Integers]:
    """Geometry rows (n, gdim) of the vertices of named facets of owned cells, and the facets' tags (n,)."""
    facets, corners = cell_facets(domain.mesh, owned)
    tag_of = np.full(int(max(facets.max(initial=0), domain.facets.indices.max(initial=0))) + 1, -1)
    tag_of[domain.facets.indices] = domain.facets.values
    tags = tag_of[facets]
    return corners[tags >= 0], tags[tags >= 0]


def spread_mesh(comm: MPI.Comm, stored: StoredMesh) -> Domain:
    """Distribute a mesh and its named boundaries, known on every rank. Collective."""
    cells, nodes = (
        np.array_split(one, comm.size)[comm.rank] for one in (stored.cells, stored.nodes)
    )
    mesh = compat.create_mesh(comm, cells, nodes, stored.degree)
    return Domain(mesh, named_facets(mesh, stored.facets, stored.tags), dict(stored.names))


def spread_nodes(mesh: Any, stored: Floats) -> Floats:
    """Values at the rows of `mesh.geometry.x` from stored nodal values (nodes, ...)."""
    return stored[input_numbers(mesh)]


def spread_flow(fluid: Fluid, velocity: StoredField, pressure: StoredField) -> list[Floats]:
    """Stored states (local unknowns,) on a fluid whose mesh has the stored positions."""
    space = fluid.space
    velocities = spread_field(velocity, space.velocity_points())
    pressures = spread_field(pressure, space.pressure.tabulate_dof_coordinates())
    states = []
    for of_velocity, of_pressure in zip(velocities, pressures, strict=True):
        state = np.zeros_like(fluid.state.x.array)
        state[space.velocity_map], state[space.pressure_map] = of_velocity, of_pressure
        states.append(state)
    return states


def spread_field(stored: StoredField, points: Floats) -> list[Floats]:
    """Stored states (local unknowns,) at this rank's nodes (n, 3), to round-off those of the stored field."""
    rows = KDTree(stored.points).query(points)[1]
    return [state.ravel() for state in np.moveaxis(stored.values[rows], 1, 0)]


def domain_of(kept: Checkpoint, comm: MPI.Comm) -> Domain:
    """The mesh at its initial positions. Collective."""
    domain = spread_mesh(comm, kept.mesh)
    if kept.motion is not None:
        domain.mesh.geometry.x[:] = spread_nodes(domain.mesh, kept.motion.made)
    return domain


def put_back_flow(kept: Checkpoint, transient: Transient) -> None:
    """Restore the fluid's state and the past states of the time integration. Collective."""
    fluid = transient.fluid
    present, *past = spread_flow(fluid, kept.velocity, kept.pressure)
    fluid.state.x.array[:], fluid.time = present, kept.time
    velocities = np.zeros((len(past), 0)) if kept.body is None else kept.body.velocities
    pasts = [Past(*one) for one in zip(kept.times[1:].tolist(), past, velocities, strict=True)]
    meshes = [] if kept.body is None else kept.body.remeshings
    new_mesh = meshes[-1]["time"] if meshes else -np.inf
    transient.resume(
        kept.progress.number, kept.progress.next_length, pasts, kept.progress.error, new_mesh
    )
    for name, number in kept.progress.linear.items():
        setattr(fluid.solver.statistics, name, number)

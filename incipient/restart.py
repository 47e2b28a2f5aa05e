"""Checkpoints of runs, written, read and restored on any number of ranks.

The file is HDF5 with arrays, JSON texts, and parts as groups. Mesh and nodal values are gathered on rank 0.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.spatial import KDTree

from . import compat
from .arrays import Floats, Integers
from .errors import OutputError, SceneError
from .files import opened_hdf5, write_hdf5
from .fluid.transient import Past, Transient
from .mesh.domain import Domain, cell_facets, input_numbers, named_facets
from .parallel import Comm, NumberedRows, collectively, joined, on_first

FORMAT, VERSION = "incipient checkpoint", 14
ANEW = "start a new run with: incipient run"


# Arrays and JSON values by name.
Stored = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A run between two steps. A field: `values` (n, states, components) at `points` (n, 3), the present state first.

    progress: `number` of completed time steps; `next_length` of adaptive steps; `error` of the last step, which sets
        the tolerance of the next, or None; first_motion; iterations; linear; wall_time and `total` of all sessions [s]
    mesh: degree; nodes (n, gdim) positions; cells: rows of `nodes`, in the library's order; facets (facets, gdim) rows
        of `nodes`, ascending; tags: their names' indices; names
    times: (states,) of the flow's states
    motion: positions of a moving mesh: initially `made` (nodes, 3), and `places` (nodes, n, 3), the present one first
    body: a moving grain and its coupling. Packed states: `made_for` at meshing, `states` (n, 6 or 13) at `times`;
        weights (nodes, gdim + 1) in its motion; load, flow_load (k,) and length of the last step; `velocities`, one row
        for each past state of the flow; contacts with the bed, as `ActiveContacts`; on_bed: motion on it
    surface: elevations at the nodes, zero off it (nodes, states), at `times`
    turbulence: logarithms of k and epsilon or omega
    """

    scene: str
    progress: Stored
    mesh: Stored
    times: Floats
    velocity: Stored
    pressure: Stored
    # None where absent.
    motion: Any = None
    body: Any = None
    surface: Any = None
    turbulence: Any = None

    @property
    def time(self) -> float:
        return float(self.times[0])


def write(path: Path, checkpoint: Checkpoint, comm: Comm) -> None:
    """Write the checkpoint of rank 0 atomically. Collective.

    Raises OutputError on all ranks; the old file is unchanged.
    """
    program = f"incipient {metadata.version('incipient')}"
    datasets = dict(_datasets(vars(checkpoint)))
    about = {"format": FORMAT, "version": VERSION, "program": program, "names": list(datasets)}
    on_first(comm, lambda: write_hdf5(path, datasets, about))


def read(path: Path, comm: Comm) -> Checkpoint:
    """Read a checkpoint on every rank. Collective.

    Raises SceneError on all ranks if the file is missing, OutputError if it is damaged or of another version.
    """
    with collectively(comm):
        if not path.is_file():
            raise SceneError(
                f"{path}: no such checkpoint, which unsteady runs write if they are interrupted "
                f"or output.checkpoint is set; {ANEW}"
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
            if missing := [name for name in about["names"] if name not in file]:
                raise OutputError(f"{path}: {missing[0]} is missing; {ANEW}")
            return Checkpoint(**_stored(file))


def _datasets(part: Stored, within: str = "") -> Iterator[tuple[str, np.ndarray]]:
    for name, value in part.items():
        if isinstance(value, dict) and any(isinstance(part, np.ndarray) for part in value.values()):
            yield from _datasets(value, f"{within}{name}/")
        elif isinstance(value, np.ndarray):
            yield within + name, value
        else:
            yield within + name, np.frombuffer(json.dumps(value).encode(), dtype=np.uint8)


def _stored(group: Any) -> Stored:
    part: Stored = {}
    for name, stored in group.items():
        if hasattr(stored, "keys"):
            part[name] = _stored(stored)
        else:
            values = stored[()]
            part[name] = json.loads(values.tobytes()) if values.dtype == np.uint8 else values
    return part


def numbered_nodes(mesh: Any) -> NumberedRows:
    """Rows of `mesh.geometry.x`, numbered in the original order of the nodes. Collective."""
    return NumberedRows(mesh.comm, input_numbers(mesh))


def stored_mesh(domain: Domain) -> Stored:
    """The present mesh, complete on rank 0. Collective."""
    mesh, inputs = domain.mesh, input_numbers(domain.mesh)
    nodes = numbered_nodes(mesh)
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    cells = NumberedRows(mesh.comm, mesh.topology.original_cell_index[:owned])
    facets, tags = _tagged(domain, owned)
    return {
        "degree": compat.geometry_degree(mesh),
        "nodes": nodes.joined(mesh.geometry.x[:, : domain.gdim]),
        "cells": nodes.places_of(cells.joined(inputs[compat.geometry_dofs(mesh)[:owned]])),
        "facets": nodes.places_of(joined(mesh.comm, inputs[facets])),
        "tags": joined(mesh.comm, tags),
        "names": dict(domain.names),
    }


def stored_field(space: Any, states: Sequence[Floats] | Floats) -> Stored:
    """States (local unknowns,) of a field, complete on rank 0. Collective."""
    points = space.tabulate_dof_coordinates()
    values = np.stack([state.reshape(len(points), -1) for state in states], axis=1)
    owned, comm = space.dofmap.index_map.size_local, space.mesh.comm
    return {"points": joined(comm, points[:owned]), "values": joined(comm, values[:owned])}


def _tagged(domain: Domain, owned: int) -> tuple[NDArray[np.int32], Integers]:
    """Geometry rows (n, gdim) of the vertices of named facets of owned cells, and the facets' tags (n,)."""
    facets, corners = cell_facets(domain.mesh, owned)
    tag_of = np.full(int(max(facets.max(initial=0), domain.facets.indices.max(initial=0))) + 1, -1)
    tag_of[domain.facets.indices] = domain.facets.values
    tags = tag_of[facets]
    return corners[tags >= 0], tags[tags >= 0]


def spread_mesh(comm: MPI.Comm, stored: Stored) -> Domain:
    """Distribute a mesh and its named boundaries, known on every rank. Collective."""
    cells, nodes = (
        np.array_split(stored[name], comm.size)[comm.rank] for name in ("cells", "nodes")
    )
    mesh = compat.create_mesh(comm, cells, nodes, stored["degree"])
    return Domain(mesh, named_facets(mesh, stored["facets"], stored["tags"]), stored["names"])


def spread_nodes(mesh: Any, stored: Floats) -> Floats:
    """Values at the rows of `mesh.geometry.x` from stored nodal values (nodes, ...)."""
    return stored[input_numbers(mesh)]


def spread_field(space: Any, stored: Stored) -> list[Floats]:
    """States (local unknowns,) of a field on the mesh at the stored positions, to round-off."""
    rows = KDTree(stored["points"]).query(space.tabulate_dof_coordinates())[1]
    return [state.ravel() for state in np.moveaxis(stored["values"][rows], 1, 0)]


def domain_of(kept: Checkpoint, comm: MPI.Comm) -> Domain:
    """The mesh at its initial positions. Collective."""
    domain = spread_mesh(comm, kept.mesh)
    if kept.motion is not None:
        domain.mesh.geometry.x[:] = spread_nodes(domain.mesh, kept.motion["made"])
    return domain


def put_back_flow(kept: Checkpoint, transient: Transient) -> None:
    """Restore the fluid's state and the past states of the time integration. Collective."""
    fluid, progress = transient.fluid, kept.progress
    (velocity, places), (pressure, pressure_places) = fluid.space.parts
    states = np.zeros((len(kept.times), len(fluid.state.x.array)))
    states[:, places] = spread_field(velocity, kept.velocity)
    states[:, pressure_places] = spread_field(pressure, kept.pressure)
    present, *past = states
    fluid.state.x.array[:], fluid.time = present, kept.time
    velocities, meshes = np.zeros((len(past), 0)), []
    if kept.body is not None:
        velocities, meshes = kept.body["velocities"], kept.body["remeshings"]
    pasts = [Past(*state) for state in zip(kept.times[1:].tolist(), past, velocities, strict=True)]
    new_mesh = meshes[-1]["time"] if meshes else -np.inf
    transient.resume(
        progress["number"], progress["next_length"], pasts, progress["error"], new_mesh
    )
    fluid.solver.statistics.update(progress["linear"])

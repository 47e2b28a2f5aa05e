"""Mesh and nodal values, gathered on rank 0 and distributed over any number of ranks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.spatial import KDTree

from .. import compat
from ..arrays import Floats, Integers
from ..errors import OutputError
from ..fluid import Fluid
from ..fluid.transient import Past, Transient
from ..mesh.cells import cell_facets
from ..mesh.domain import Domain, named_facets
from ..parallel import NumberedRows, collectively, joined
from .checkpoint import ANEW, Checkpoint, StoredFlow, StoredMesh, StoredValues

# Largest distance of a node from its stored position, relative to the mesh's size.
SAME_PLACE = 1e-10


def numbered_nodes(mesh: Any) -> NumberedRows:
    """Rows of `mesh.geometry.x`, numbered in the original order of the nodes. Collective."""
    return NumberedRows(mesh.comm, _given(mesh))


def stored_mesh(domain: Domain) -> StoredMesh:
    """The present mesh, complete on rank 0. Collective."""
    mesh, given = domain.mesh, _given(domain.mesh)
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


def stored_flow(fluid: Fluid, states: Sequence[Floats]) -> StoredFlow:
    """States (local unknowns,) of a fluid and its node positions, complete on rank 0. Collective."""
    space = fluid.space
    velocities = [state[space.velocity_map].reshape(-1, space.gdim) for state in states]
    pressures = [state[space.pressure_map] for state in states]
    return StoredFlow(
        _owned(space.velocity, space.velocity_points()),
        _owned(space.pressure, space.pressure.tabulate_dof_coordinates()),
        _owned(space.velocity, np.stack(velocities, axis=1)),
        _owned(space.pressure, np.stack(pressures, axis=1)),
    )


def stored_values(space: Any, states: Sequence[Floats]) -> StoredValues:
    """States (local unknowns,) of both logarithms of turbulence, complete on rank 0. Collective."""
    values = np.stack([state.reshape(-1, 2) for state in states], axis=1)
    return StoredValues(_owned(space, space.tabulate_dof_coordinates()), _owned(space, values))


def _given(mesh: Any) -> Integers:
    return np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)


def _owned(space: Any, values: np.ndarray) -> np.ndarray:
    return joined(space.mesh.comm, values[: space.dofmap.index_map.size_local])


def _tagged(domain: Domain, owned: int) -> tuple[NDArray[np.int32], Integers]:
    """Geometry rows (n, gdim) of the vertices of named facets of owned cells, and the facets' tags (n,)."""
    facets, corners = cell_facets(domain.mesh, owned)
    tag_of = np.full(int(max(facets.max(initial=0), domain.facets.indices.max(initial=0))) + 1, -1)
    tag_of[domain.facets.indices] = domain.facets.values
    tags = tag_of[facets]
    return corners[tags >= 0], tags[tags >= 0]


def spread_mesh(comm: MPI.Comm, stored: StoredMesh) -> Domain:
    """Distribute a mesh and its named boundaries, known on every rank. Collective.

    Raises OutputError on all ranks if a named facet is not in the mesh.
    """
    gdim = stored.nodes.shape[1]
    cells, nodes = (
        np.array_split(one, comm.size)[comm.rank] for one in (stored.cells, stored.nodes)
    )
    mesh = compat.create_mesh(comm, cells, nodes, stored.degree)
    facets = named_facets(mesh, stored.facets, stored.tags)
    owned = mesh.topology.index_map(gdim - 1).size_local
    known, matched = len(stored.tags), comm.allreduce(int(np.sum(facets.indices < owned)))
    if matched != known:
        why = f"{matched} of them are facets of the stored mesh"
        raise OutputError(f"{known} boundary facets are stored, {why}; {ANEW}")
    return Domain(mesh, facets, dict(stored.names))


def spread_nodes(mesh: Any, stored: Floats) -> Floats:
    """Values at the rows of `mesh.geometry.x` from stored nodal values (nodes, ...)."""
    return stored[_given(mesh)]


def spread_flow(fluid: Fluid, stored: StoredFlow) -> list[Floats]:
    """Stored states (local unknowns,) on a fluid whose mesh has the stored positions. Collective.

    Raises OutputError on all ranks if a node is at no stored position.
    """
    space, comm = fluid.space, fluid.domain.comm
    pressure_points = space.pressure.tabulate_dof_coordinates()
    velocities = _fetched(comm, stored.velocity_points, stored.velocities, space.velocity_points())
    pressures = _fetched(comm, stored.pressure_points, stored.pressures, pressure_points)
    states = []
    for number in range(velocities.shape[1]):
        state = np.zeros_like(fluid.state.x.array)
        state[space.velocity_map] = velocities[:, number].ravel()
        state[space.pressure_map] = pressures[:, number]
        states.append(state)
    return states


def spread_values(space: Any, stored: StoredValues) -> list[Floats]:
    """Stored states (local unknowns,) of both logarithms on their space. Collective.

    Raises OutputError on all ranks if a node is at no stored position.
    """
    points = space.tabulate_dof_coordinates()
    values = _fetched(space.mesh.comm, stored.points, stored.logarithms, points)
    return [values[:, number].ravel() for number in range(values.shape[1])]


def _fetched(comm: MPI.Comm, places: Floats, values: Floats, points: Floats) -> Floats:
    """Values at this rank's points (n, 3), from values (m, ...) stored at positions (m, 3). Collective."""
    distances, rows = KDTree(places).query(points)
    tolerance = SAME_PLACE * np.ptp(places, axis=0).max()
    with collectively(comm):
        if distances.max(initial=0.0) > tolerance or len(np.unique(rows)) < len(points):
            raise OutputError(f"the stored flow and the stored mesh have different nodes; {ANEW}")
    return values[rows]


def domain_of(kept: Checkpoint, comm: MPI.Comm) -> Domain:
    """The mesh at its initial positions. Collective."""
    domain = spread_mesh(comm, kept.mesh)
    if kept.motion is not None:
        domain.mesh.geometry.x[:] = spread_nodes(domain.mesh, kept.motion.made)
    return domain


def put_back_flow(kept: Checkpoint, transient: Transient) -> None:
    """Restore the fluid's state and the past states of the time integration. Collective."""
    fluid = transient.fluid
    present, *past = spread_flow(fluid, kept.flow)
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

"""A mesh and the values on its nodes: dealt out in blocks that a file can take, and spread again over any ranks.

Nothing of what is dealt out depends on how the library numbers or distributes: the mesh comes in the order in
which it was first given, values with the places of their nodes. On a remade mesh values find their nodes
by place. No rank has the whole of anything but the boundary's facets.
"""

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
from ..mesh.cells import cell_facets
from ..mesh.domain import Domain, named_facets
from ..parallel import collectively
from ..tables.rows import Numbered, Rows, compact, exchanged
from .checkpoint import StoredFlow, StoredMesh, StoredValues

# How far, relative to the mesh's size, a node may be from where its value was stored.
SAME_PLACE = 1e-10
# Number of nodes whose places each rank tells, by which nodes are dealt out evenly.
SAMPLES = 64


def numbered_nodes(mesh: Any) -> Numbered:
    """The rows of `mesh.geometry.x`, numbered in the order in which the mesh's nodes were given. Collective."""
    return Numbered(mesh.comm, *compact(mesh.comm, _given(mesh)))


def stored_mesh(domain: Domain) -> StoredMesh:
    """The mesh as it is now, this rank's blocks of it; facets on rank 0, none elsewhere. Collective."""
    mesh = domain.mesh
    numbers, total = compact(mesh.comm, _given(mesh))
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    cells = Numbered(mesh.comm, *compact(mesh.comm, mesh.topology.original_cell_index[:owned]))
    facets, tags = _tagged(domain, owned)
    return StoredMesh(
        degree=compat.geometry_degree(mesh),
        nodes=Numbered(mesh.comm, numbers, total).dealt(mesh.geometry.x[:, : domain.gdim]),
        cells=cells.dealt(numbers[compat.geometry_dofs(mesh)[:owned]]),
        facets=_joined(mesh.comm, numbers[facets]),
        tags=_joined(mesh.comm, tags),
        names=dict(domain.names),
    )


def stored_flow(fluid: Fluid, states: Sequence[Floats]) -> StoredFlow:
    """States (local unknowns,) of a fluid, and where its nodes are now, this rank's blocks of them. Collective."""
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
    """States (local unknowns,) of both logarithms of turbulence on their space, this rank's blocks. Collective."""
    values = np.stack([state.reshape(-1, 2) for state in states], axis=1)
    return StoredValues(_owned(space, space.tabulate_dof_coordinates()), _owned(space, values))


def _given(mesh: Any) -> Integers:
    """Numbers with which the local nodes were given when the mesh was made."""
    return np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)


def _owned(space: Any, values: np.ndarray) -> Rows:
    index_map = space.dofmap.index_map
    return Rows(values[: index_map.size_local], index_map.local_range[0], index_map.size_global)


def _tagged(domain: Domain, owned: int) -> tuple[NDArray[np.int32], Integers]:
    """Geometry rows (n, gdim) of the corners of named facets of owned cells, and the facets' tags (n,)."""
    facets, corners = cell_facets(domain.mesh, owned)
    tag_of = np.full(int(max(facets.max(initial=0), domain.facets.indices.max(initial=0))) + 1, -1)
    tag_of[domain.facets.indices] = domain.facets.values
    tags = tag_of[facets]
    return corners[tags >= 0], tags[tags >= 0]


def _joined(comm: MPI.Comm, rows: np.ndarray) -> np.ndarray:
    everywhere = comm.gather(np.ascontiguousarray(rows))
    return rows[:0] if everywhere is None else np.concatenate(everywhere)


def spread_mesh(comm: MPI.Comm, stored: StoredMesh) -> Domain:
    """The mesh and its named boundaries over all ranks; each gives its blocks and knows all facets. Collective.

    Raises:
        OutputError: on all ranks, when a named facet is not one of the mesh.
    """
    gdim = stored.nodes.shape[1]
    mesh = compat.create_mesh(comm, stored.cells.values, stored.nodes.values, stored.degree)
    facets = named_facets(mesh, stored.facets, stored.tags)
    owned = mesh.topology.index_map(gdim - 1).size_local
    known, found = len(stored.tags), comm.allreduce(int(np.sum(facets.indices < owned)))
    if found != known:
        why = f"{found} of them are facets of the stored mesh"
        raise OutputError(f"{known} boundary facets are stored, {why}")
    return Domain(mesh, facets, dict(stored.names))


def spread_nodes(mesh: Any, stored: Rows) -> Floats:
    """The values at the rows of `mesh.geometry.x` of those (nodes, ...) of the stored mesh. Collective."""
    return np.asarray(Numbered(mesh.comm, _given(mesh), stored.total).fetched(stored))


def spread_flow(fluid: Fluid, stored: StoredFlow) -> list[Floats]:
    """The states (local unknowns,) on a fluid whose mesh is where it was when they were stored. Collective.

    Raises:
        OutputError: on all ranks, when a node of the fluid is not where a stored one is.
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
    """The states (local unknowns,) of both logarithms on a space of theirs. Collective.

    Raises:
        OutputError: on all ranks, when a node of the space is not where a stored one is.
    """
    points = space.tabulate_dof_coordinates()
    values = _fetched(space.mesh.comm, stored.points, stored.logarithms, points)
    return [values[:, number].ravel() for number in range(values.shape[1])]


def _fetched(comm: MPI.Comm, places: Rows, values: Rows, points: Floats) -> Floats:
    """The values (n, ...) at points (n, 3) of a table whose rows belong to places. Collective."""
    return np.asarray(Numbered(comm, _matched(comm, places, points), places.total).fetched(values))


def _matched(comm: MPI.Comm, stored: Rows, points: Floats) -> Integers:
    """The number of the stored point (rows of three) at the place of each point (n, 3). Collective.

    Stored points are dealt out by their first coordinate, so that a rank that has a point knows whom to ask for it.
    Raises OutputError on all ranks where there is none, or the same one for several points.
    """
    tolerance = SAME_PLACE * _extent(comm, stored.values)
    borders = _borders(comm, stored.values[:, 0])
    numbers = np.arange(stored.first, stored.first + len(stored.values))
    owners = np.searchsorted(borders, stored.values[:, 0], side="right")
    by_owner = np.argsort(owners, kind="stable")
    table = np.column_stack([stored.values, numbers])
    here = exchanged(comm, table[by_owner], np.bincount(owners, minlength=comm.size))
    # A point so near to a border that rounding may have taken it across asks on both sides.
    first, last = (
        np.searchsorted(borders, points[:, 0] + d, side="right") for d in (-tolerance, tolerance)
    )
    times = last - first + 1
    asking = np.repeat(np.arange(len(points)), times)
    asked = (
        np.repeat(first, times)
        + np.arange(len(asking))
        - np.repeat(np.cumsum(times) - times, times)
    )
    order = np.argsort(asked, kind="stable")
    sent = np.bincount(asked, minlength=comm.size)
    received = np.array(comm.alltoall(sent.tolist()))
    questions = exchanged(comm, points[asking[order]], sent, received)
    answers = exchanged(comm, _nearest(here, questions), received, sent)
    best = np.lexsort((answers[:, 0], asking[order]))
    _, best_of_each = np.unique(asking[order][best], return_index=True)
    distances, found = answers[best][best_of_each].T
    with collectively(comm):
        if distances.max(initial=0.0) > tolerance or len(np.unique(found)) < len(points):
            raise OutputError("the stored flow has other nodes than the stored mesh")
    return found.astype(np.int64)


def _extent(comm: MPI.Comm, places: Floats) -> float:
    """The largest side of the box that has all ranks' places in it. Collective."""
    sides = np.concatenate(
        [places.max(axis=0, initial=-np.inf), -places.min(axis=0, initial=np.inf)]
    )
    comm.Allreduce(MPI.IN_PLACE, sides, op=MPI.MAX)
    return float((sides[:3] + sides[3:]).max())


def _borders(comm: MPI.Comm, values: Floats) -> Floats:
    """Numbers (ranks - 1,) between which there are about as many of all ranks' values each. Collective."""
    mine = np.quantile(values, np.linspace(0, 1, SAMPLES)) if len(values) else values
    samples = np.sort(np.concatenate(comm.allgather(mine)))
    return samples[len(samples) * np.arange(1, comm.size) // comm.size]


def _nearest(stored: Floats, points: Floats) -> Floats:
    """For each point (n, 3) how far the nearest of the stored ones (m, 4) is, and its last column, a number: (n, 2)."""
    if not len(stored):
        return np.column_stack([np.full(len(points), np.inf), np.zeros(len(points))])
    distances, rows = KDTree(stored[:, :3]).query(points)
    return np.column_stack([distances, stored[rows, 3]])

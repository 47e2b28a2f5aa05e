"""A mesh and the values on its nodes: gathered whole on rank 0, and spread again over any number of ranks.

Nothing of what is gathered depends on how the library numbers or distributes: the mesh comes in the order in
which it was first given, values with the places of their nodes. On a mesh made anew values find their nodes
by place.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import dolfinx
import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.spatial import KDTree

from .. import compat
from ..arrays import Floats, Integers
from ..errors import OutputError
from ..fluid import Fluid
from ..mesh.domain import Domain
from ..parallel import collectively
from .checkpoint import WholeFlow, WholeMesh

# How far, relative to the mesh's size, a node may be from where its value was stored.
SAME_PLACE = 1e-10


class Gatherer:
    """Brings values of what ranks number together to rank 0, each once, by ascending number. Collective.

    Args:
        numbers: (n,) global numbers of this rank's values; several ranks may have the same.
    """

    def __init__(self, comm: MPI.Comm, numbers: np.ndarray):
        self.comm = comm
        everywhere = comm.gather(np.asarray(numbers, dtype=np.int64))
        self.numbers, self._first = np.unique(np.concatenate(everywhere or [[]]), return_index=True)

    def gathered(self, values: np.ndarray) -> np.ndarray:
        """Values (n, ...) of all numbers on rank 0, none elsewhere. Collective."""
        everywhere = self.comm.gather(np.ascontiguousarray(values))
        return values[:0] if everywhere is None else np.concatenate(everywhere)[self._first]


# -- gathering --------------------------------------------------------------------------------------


def node_gatherer(mesh: Any) -> Gatherer:
    """For values at the rows of `mesh.geometry.x`: in the order in which the mesh's nodes were given. Collective."""
    return Gatherer(mesh.comm, mesh.geometry.input_global_indices)


def whole_mesh(domain: Domain) -> WholeMesh:
    """The mesh as it is now, on rank 0; arrays are empty elsewhere. Collective."""
    mesh = domain.mesh
    nodes, given = node_gatherer(mesh), _given(mesh)
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    cells = Gatherer(mesh.comm, mesh.topology.original_cell_index[:owned])
    facets, tags = _tagged(domain, owned)
    return WholeMesh(
        degree=compat.geometry_degree(mesh),
        nodes=nodes.gathered(mesh.geometry.x[:, : domain.gdim]),
        cells=np.searchsorted(nodes.numbers, cells.gathered(given[compat.geometry_dofs(mesh)[:owned]])),
        facets=np.searchsorted(nodes.numbers, _joined(mesh.comm, given[facets])),
        tags=_joined(mesh.comm, tags),
        names=dict(domain.names),
    )


def whole_flow(fluid: Fluid, states: Sequence[Floats]) -> WholeFlow:
    """States (local unknowns,) of a fluid, and where its nodes are now, on rank 0. Collective."""
    space = fluid.space
    velocities, pressures = (_dof_gatherer(part) for part in (space.velocity, space.pressure))
    blocks = [state[space.velocity_map].reshape(-1, space.gdim) for state in states]
    return WholeFlow(
        velocities.gathered(_owned(space.velocity, space.velocity_points())),
        pressures.gathered(_owned(space.pressure, space.pressure.tabulate_dof_coordinates())),
        np.array([velocities.gathered(_owned(space.velocity, block)) for block in blocks]),
        np.array([pressures.gathered(_owned(space.pressure, state[space.pressure_map])) for state in states]),
    )


def _given(mesh: Any) -> Integers:
    """Numbers with which the local nodes were given when the mesh was made."""
    return np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)


def _dof_gatherer(space: Any) -> Gatherer:
    return Gatherer(space.mesh.comm, np.arange(*space.dofmap.index_map.local_range))


def _owned(space: Any, values: np.ndarray) -> np.ndarray:
    return values[: space.dofmap.index_map.size_local]


def _tagged(domain: Domain, owned: int) -> tuple[NDArray[np.int32], Integers]:
    """Geometry rows (n, gdim) of the corners of named facets of owned cells, and the facets' tags (n,)."""
    facets, corners = _cell_facets(domain.mesh, owned)
    tag_of = dict(zip(domain.facets.indices.tolist(), domain.facets.values.tolist(), strict=True))
    tags = np.array([tag_of.get(facet, -1) for facet in facets.tolist()], dtype=np.int64)
    return corners[tags >= 0], tags[tags >= 0]


def _cell_facets(mesh: Any, cells: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """The facets (n,) of the first local cells, cell by cell, and the geometry rows (n, gdim) of their corners."""
    dimension = mesh.topology.dim
    mesh.topology.create_connectivity(dimension, dimension - 1)
    links = mesh.topology.connectivity(dimension, dimension - 1)
    facets = np.array([links.links(cell) for cell in range(cells)], dtype=np.int32).ravel()
    # A simplex's facet is numbered as the corner that it lacks.
    lacking = [[k for k in range(dimension + 1) if k != corner] for corner in range(dimension + 1)]
    corners = compat.geometry_dofs(mesh)[:cells][:, lacking].reshape(-1, dimension)
    return facets, corners


def _joined(comm: MPI.Comm, rows: np.ndarray) -> np.ndarray:
    everywhere = comm.gather(np.ascontiguousarray(rows))
    return rows[:0] if everywhere is None else np.concatenate(everywhere)


# -- spreading --------------------------------------------------------------------------------------


def spread_mesh(comm: MPI.Comm, whole: WholeMesh) -> Domain:
    """The mesh and its named boundaries over all ranks, each of which knows the whole. Collective.

    Raises:
        OutputError: on all ranks, when a named facet is not one of the mesh.
    """
    gdim = whole.nodes.shape[1]
    part = slice(None) if comm.rank == 0 else slice(0, 0)
    mesh = compat.create_mesh(comm, whole.cells[part], whole.nodes[part], whole.degree)
    topology, cells = mesh.topology, mesh.topology.index_map(gdim)
    facets, corners = _cell_facets(mesh, cells.size_local + cells.num_ghosts)
    stored = {tuple(row): tag for row, tag in zip(_rows(whole.facets), whole.tags.tolist(), strict=True)}
    tags = {
        f: stored.get(tuple(row), -1)
        for f, row in zip(facets.tolist(), _rows(_given(mesh)[corners]), strict=True)
    }
    named = np.array(sorted(f for f, tag in tags.items() if tag >= 0), dtype=np.int32)
    values = np.array([tags[f] for f in named.tolist()], dtype=np.int32)
    found = comm.allreduce(int(np.sum(named < topology.index_map(gdim - 1).size_local)))
    if found != len(stored):
        raise OutputError(
            f"{len(stored)} boundary facets are stored, {found} of them are facets of the stored mesh"
        )
    return Domain(mesh, dolfinx.mesh.meshtags(mesh, gdim - 1, named, values), dict(whole.names))


def spread_nodes(mesh: Any, whole: Floats) -> Floats:
    """The values at the rows of `mesh.geometry.x` of those (nodes, ...) of the whole mesh. Not collective."""
    return np.asarray(whole[_given(mesh)])


def spread_flow(fluid: Fluid, whole: WholeFlow) -> list[Floats]:
    """The states (local unknowns,) on a fluid whose mesh is where it was when they were gathered. Collective.

    Raises:
        OutputError: on all ranks, when a node of the fluid is not where a stored one is.
    """
    space = fluid.space
    with collectively(fluid.domain.comm):
        velocity_rows = _matched(whole.velocity_points, space.velocity_points())
        pressure_rows = _matched(whole.pressure_points, space.pressure.tabulate_dof_coordinates())
    states = []
    for velocities, pressures in zip(whole.velocities, whole.pressures, strict=True):
        state = np.zeros_like(fluid.state.x.array)
        state[space.velocity_map] = velocities[velocity_rows].ravel()
        state[space.pressure_map] = pressures[pressure_rows]
        states.append(state)
    return states


def _rows(array: np.ndarray) -> list[list[int]]:
    """Rows with ascending entries."""
    rows: list[list[int]] = np.sort(array, axis=1).tolist()
    return rows


def _matched(stored: Floats, points: Floats) -> Integers:
    """For each point (n, 3) the row of the stored one at the same place."""
    distances, rows = KDTree(stored).query(points)
    size = float(np.ptp(stored, axis=0).max())
    if distances.max(initial=0.0) > SAME_PLACE * size or len(np.unique(rows)) < len(rows):
        raise OutputError("the stored flow has other nodes than the stored mesh")
    return np.asarray(rows)

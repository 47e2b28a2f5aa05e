"""A mesh and the values on its nodes: gathered whole on rank 0, and spread again over any number of ranks.

Nothing of what is gathered depends on how the library numbers or distributes: the mesh comes in the order in
which it was first given, values with the places of their nodes. On a mesh made anew values find their nodes
by place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import dolfinx
import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.spatial import KDTree

from . import compat
from .domain import Domain
from .errors import OutputError
from .fluid import Fluid
from .parallel import collectively

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# How far, relative to the mesh's size, a node may be from where its value was stored.
SAME_PLACE = 1e-10


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
    nodes = node_gatherer(mesh)
    given = np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    cells = Gatherer(mesh.comm, mesh.topology.original_cell_index[:owned])
    corners, tags = _tagged(domain)
    once = Gatherer(mesh.comm, domain.facets.indices[tags] if mesh.comm.size == 1 else _global(domain, tags))
    return WholeMesh(
        degree=compat.geometry_degree(mesh),
        nodes=nodes.gathered(mesh.geometry.x[:, : domain.gdim]),
        cells=_compact(nodes, cells.gathered(given[compat.geometry_dofs(mesh)[:owned]])),
        facets=np.sort(_compact(nodes, once.gathered(given[corners])), axis=1),
        tags=once.gathered(domain.facets.values[tags].astype(np.int64)),
        names=domain.names,
    )

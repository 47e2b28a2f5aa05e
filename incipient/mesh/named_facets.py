"""Facets of a mesh found by the numbers with which their corners were given, and tagged with those of their names."""

from __future__ import annotations

from typing import Any

import dolfinx
import numpy as np

from .. import compat
from ..arrays import Integers


def cell_facets(mesh: Any, cells: int) -> tuple[np.ndarray, np.ndarray]:
    """The facets (n,) of the first local cells, cell by cell, and the geometry rows (n, gdim) of their corners."""
    dimension = mesh.topology.dim
    mesh.topology.create_connectivity(dimension, dimension - 1)
    facets = mesh.topology.connectivity(dimension, dimension - 1).array[: cells * (dimension + 1)]
    # A simplex's facet is numbered as the corner that it lacks.
    lacking = [[k for k in range(dimension + 1) if k != corner] for corner in range(dimension + 1)]
    corners = compat.geometry_dofs(mesh)[:cells][:, lacking].reshape(-1, dimension)
    return facets, corners


def named_facets(mesh: Any, corners: Integers, tags: Integers) -> Any:
    """The tags (k,) of facets whose corners were given as nodes of numbers (k, gdim), as tags of the mesh.

    All ranks know all of these facets; tagged are those that they have, of ghosts, too. Those that the mesh does not
    have are left out. Collective.
    """
    index_map, dimension = mesh.topology.index_map(mesh.topology.dim), mesh.topology.dim
    facets, rows = cell_facets(mesh, index_map.size_local + index_map.num_ghosts)
    numbers, wanted = np.unique(corners, return_inverse=True)
    wanted = _keys(wanted.reshape(-1, dimension), len(numbers))
    order = np.argsort(wanted, kind="stable")
    place = _places(numbers, np.asarray(mesh.geometry.input_global_indices, dtype=np.int64))[rows]
    among = (place >= 0).all(axis=1)
    found = _places(wanted[order], _keys(place[among], len(numbers)))
    named, first = np.unique(facets[among][found >= 0], return_index=True)
    values = tags[order][found[found >= 0]][first]
    return dolfinx.mesh.meshtags(
        mesh, dimension - 1, named.astype(np.int32), values.astype(np.int32)
    )


def _keys(rows: Integers, base: int) -> Integers:
    """One number (n,) for each of the rows (n, gdim) of numbers below a base, in whatever order they stand."""
    key = np.zeros(len(rows), dtype=np.int64)
    for column in np.sort(rows, axis=1).T:
        key = key * base + column
    return key


def _places(ascending: Integers, numbers: Integers) -> Integers:
    """Where numbers (n,) stand among ascending ones, (n,); -1 where they do not."""
    if not len(ascending):
        return np.full(len(numbers), -1)
    place = np.minimum(np.searchsorted(ascending, numbers), len(ascending) - 1)
    return np.where(ascending[place] == numbers, place, -1)

"""Distances from walls, and the cells next to them, on any number of ranks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from .. import compat
from ..arrays import Floats, Integers
from ..geometry.space.surfaces import nearest_on_triangles
from .cells import cell_facets, local_cells
from .domain import Domain

# Pieces of a wall, of each octave of lengths, by their middles, of which the nearest place is sought, by dimension.
NEAREST = {2: 6, 3: 12}
# Nodes of a triangle and its edges that are corners of its straight pieces; pieces of an edge, which may stand off from
# its chord by more than the thinnest cells are thick.
PIECES, PIECES_OF_EDGE = ((0, 5, 4), (1, 3, 5), (2, 4, 3), (3, 4, 5)), 8


def distances(domain: Domain, walls: Sequence[str], places: Floats) -> Floats:
    """Distances (n,) of places (n, gdim) from the next of the named walls of a domain. Collective.

    Curved walls are taken as eight straight pieces a facet, in 3-D as four.
    """
    pieces = _pieces(domain, walls)
    lengths = np.linalg.norm(pieces[:, 1:] - pieces[:, :1], axis=2).max(axis=1)
    middles, least = pieces.mean(axis=1), np.full(len(places), np.inf)
    octaves = np.floor(np.log2(lengths))
    for octave in np.unique(octaves):
        (chosen,) = np.nonzero(octaves == octave)
        number = min(NEAREST[domain.gdim], len(chosen))
        _, nearest = cKDTree(middles[chosen]).query(places, k=[*range(1, number + 1)])
        for column in chosen[nearest].T:
            least = np.minimum(least, _from_pieces(places, pieces[column]))
    return least


def _from_pieces(places: Floats, pieces: Floats) -> Floats:
    """Distance (n,) of each place (n, gdim) from its straight piece (n, gdim, gdim)."""
    if pieces.shape[1] == 2:
        starts, ends = pieces[:, 0], pieces[:, 1]
        along, away = ends - starts, places - starts
        part = np.clip((away * along).sum(axis=1) / (along * along).sum(axis=1), 0.0, 1.0)
        return np.asarray(np.linalg.norm(away - part[:, None] * along, axis=1))
    return np.asarray(np.linalg.norm(nearest_on_triangles(places, pieces) - places, axis=1))


def _pieces(domain: Domain, walls: Sequence[str]) -> Floats:
    """Corners (n, gdim, gdim) of straight pieces of walls, eight a facet, in 3-D four, on all ranks. Collective."""
    nodes = facet_nodes(domain, walls)
    if domain.gdim == 3:
        return np.concatenate([nodes[:, piece] for piece in PIECES])
    t = np.linspace(0.0, 1.0, PIECES_OF_EDGE + 1)
    along = np.column_stack([(1 - t) * (1 - 2 * t), t * (2 * t - 1), 4 * t * (1 - t)]) @ nodes
    return np.stack([along[:, :-1], along[:, 1:]], axis=2).reshape(-1, 2, 2)


def facet_nodes(domain: Domain, walls: Sequence[str]) -> Floats:
    """Nodes (facets, 3 or 6, gdim) of the facets of walls, corners first, on all ranks. Collective."""
    mesh, of_facets = domain.mesh, domain.gdim - 1
    space = compat.space(mesh, ("Lagrange", 2))
    layout = space.dofmap.dof_layout
    local = [_in_order(layout, of_facets, number) for number in range(domain.gdim + 1)]
    every, first = np.unique(cell_facets(mesh, local_cells(mesh))[0], return_index=True)
    nodes_of_facets = compat.cell_dofs(space)[:, local].reshape(-1, 3 * of_facets)
    wanted = np.unique(np.concatenate([domain.facets_of(name) for name in walls]))
    rows = nodes_of_facets[first[np.searchsorted(every, wanted)]]
    here = space.tabulate_dof_coordinates()[rows, : domain.gdim]
    return np.concatenate(domain.comm.allgather(here))


def _in_order(layout: Any, dimension: int, facet: int) -> Integers:
    """Local nodes of a facet: corners, then middles of edges, each opposite to a corner, in 2-D that of the edge."""
    nodes = layout.entity_closure_dofs(dimension, facet)
    corners = [node for node in nodes if node <= dimension + 1]
    if dimension == 1:
        return np.array([*corners, *(node for node in nodes if node not in corners)])
    edge_of = {
        frozenset(
            node for node in layout.entity_closure_dofs(1, edge) if node <= 3
        ): layout.entity_dofs(1, edge)[0]
        for edge in range(6)
    }
    return np.array([*corners, *(edge_of[frozenset(corners) - {node}] for node in corners)])


def cells_at(domain: Domain, walls: Sequence[str]) -> Integers:
    """Local cells, ghosts included, that have a corner on one of the named walls. Collective."""
    corners = compat.space(domain.mesh, ("Lagrange", 1))
    facets = np.unique(np.concatenate([domain.facets_of(name) for name in walls]))
    on_wall = np.zeros(len(corners.tabulate_dof_coordinates()), dtype=bool)
    on_wall[compat.nodes_on(corners, facets)] = True
    return np.flatnonzero(on_wall[compat.cell_dofs(corners)].any(axis=1))

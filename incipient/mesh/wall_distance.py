"""Distances from walls, and the cells next to them, on any number of ranks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from .. import compat
from ..arrays import Floats, Integers
from ..geometry.triangles import nearest_on_triangles
from .domain import Domain, cell_facets, local_cells, shape_functions

# Straight pieces of an edge, which may stand off from its chord by more than the thinnest cells are thick.
PIECES_OF_EDGE = 8
# Corners and middles of edges of a triangle by barycentric coordinates
IN_TRIANGLE = np.array([[2, 0, 0], [0, 2, 0], [0, 0, 2], [0, 1, 1], [1, 0, 1], [1, 1, 0]]) / 2.0


def distances(domain: Domain, walls: Sequence[str], places: Floats) -> Floats:
    """Distances (n,) of positions (n, gdim) from the next of the named walls of a domain. Collective.

    Curved walls are taken as eight straight pieces a facet, in 3-D as four.
    """
    pieces = _pieces(domain, walls)
    lengths = np.linalg.norm(pieces[:, 1:] - pieces[:, :1], axis=2).max(axis=1)
    middles, least = pieces.mean(axis=1), np.full(len(places), np.inf)
    octaves = np.floor(np.log2(lengths))
    for octave in np.unique(octaves):
        (chosen,) = np.nonzero(octaves == octave)
        number = min(6 if domain.gdim == 2 else 12, len(chosen))  # of pieces, by their middles
        _, nearest = cKDTree(middles[chosen]).query(places, k=[*range(1, number + 1)])
        for column in chosen[nearest].T:
            least = np.minimum(least, _from_pieces(places, pieces[column]))
    return least


def _from_pieces(places: Floats, pieces: Floats) -> Floats:
    if pieces.shape[1] == 2:
        starts, ends = pieces[:, 0], pieces[:, 1]
        along, away = ends - starts, places - starts
        part = np.clip((away * along).sum(axis=1) / (along * along).sum(axis=1), 0.0, 1.0)
        return np.asarray(np.linalg.norm(away - part[:, None] * along, axis=1))
    return np.asarray(np.linalg.norm(nearest_on_triangles(places, pieces) - places, axis=1))


def _pieces(domain: Domain, walls: Sequence[str]) -> Floats:
    pieces = np.array([(0, 5, 4), (1, 3, 5), (2, 4, 3), (3, 4, 5)])  # of a triangle
    if domain.gdim == 2:
        pieces = np.arange(PIECES_OF_EDGE)[:, None] + [0, 1]
    return _on_facets(domain, walls)[:, pieces].reshape(-1, domain.gdim, domain.gdim)


def _on_facets(domain: Domain, walls: Sequence[str]) -> Floats:
    """Ends of the pieces (facets, n, gdim) of the facets of walls, on all ranks. Collective."""
    mesh, gdim = domain.mesh, domain.gdim
    t = np.linspace(0.0, 1.0, PIECES_OF_EDGE + 1)
    on_facet = IN_TRIANGLE if gdim == 3 else np.column_stack([1 - t, t])
    places = [np.insert(on_facet, corner, 0.0, axis=1)[:, 1:] for corner in range(gdim + 1)]
    shapes = np.array([shape_functions(mesh).tabulate(0, x)[0, :, :, 0] for x in places])
    every, first = np.unique(cell_facets(mesh, local_cells(mesh))[0], return_index=True)
    wanted = np.unique(np.concatenate([domain.facets_of(name) for name in walls]))
    # A facet is numbered as the corner that it lacks.
    cells, lacking = np.divmod(first[np.searchsorted(every, wanted)], gdim + 1)
    nodes = mesh.geometry.x[compat.geometry_dofs(mesh)[cells], :gdim]
    return np.concatenate(domain.comm.allgather(shapes[lacking] @ nodes))


def cells_at(domain: Domain, walls: Sequence[str]) -> Integers:
    """Local cells, ghosts included, that have a corner on one of the named walls. Collective."""
    corners = compat.space(domain.mesh, ("Lagrange", 1))
    facets = np.unique(np.concatenate([domain.facets_of(name) for name in walls]))
    on_wall = np.zeros(len(corners.tabulate_dof_coordinates()), dtype=bool)
    on_wall[compat.nodes_on(corners, facets)] = True
    return np.flatnonzero(on_wall[compat.cell_dofs(corners)].any(axis=1))

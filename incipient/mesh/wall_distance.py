"""Distances from walls in the plane, and the cells next to them, on any number of ranks."""

from __future__ import annotations

from collections.abc import Sequence

import dolfinx
import numpy as np
from petsc4py import PETSc
from scipy.spatial import cKDTree

from .. import compat
from ..arrays import Floats, Integers
from .domain import Domain

NEAREST = (
    6  # pieces of a wall, of each octave of lengths, by their middles, of which the nearest place is sought
)


def distances(domain: Domain, walls: Sequence[str], places: Floats) -> Floats:
    """Distances (n,) of places (n, 2) from the next of the named walls of a domain in the plane. Collective.

    Curved walls are taken as two straight pieces a facet.
    """
    starts, ends = _pieces(domain, walls)
    lengths, middles = np.linalg.norm(ends - starts, axis=1), 0.5 * (starts + ends)
    octaves, least = np.floor(np.log2(lengths)), np.full(len(places), np.inf)
    for octave in np.unique(octaves):
        (chosen,) = np.nonzero(octaves == octave)
        number = min(NEAREST, len(chosen))
        _, nearest = cKDTree(middles[chosen]).query(places, k=[*range(1, number + 1)])
        for column in chosen[nearest].T:
            least = np.minimum(least, _from_pieces(places, starts[column], ends[column]))
    return least


def _from_pieces(places: Floats, starts: Floats, ends: Floats) -> Floats:
    """Distance (n,) of each place (n, 2) from its straight piece."""
    along, away = ends - starts, places - starts
    part = np.clip((away * along).sum(axis=1) / (along * along).sum(axis=1), 0.0, 1.0)
    return np.asarray(np.linalg.norm(away - part[:, None] * along, axis=1))


def _pieces(domain: Domain, walls: Sequence[str]) -> tuple[Floats, Floats]:
    """Starts and ends (n, 2) of the straight pieces of walls, two a facet, on all ranks. Collective."""
    mesh = domain.mesh
    space = compat.space(mesh, ("Lagrange", 2))
    facets = np.concatenate([domain.facets_of(name) for name in walls])
    mesh.topology.create_connectivity(1, 2)
    mesh.topology.create_connectivity(2, 1)
    cell_of, facets_of = mesh.topology.connectivity(1, 2), mesh.topology.connectivity(2, 1)
    places, dofs = space.tabulate_dof_coordinates()[:, :2], compat.cell_dofs(space)
    layout, rows = space.dofmap.dof_layout, []
    for facet in facets:
        cell = cell_of.links(facet)[0]
        local = int(np.flatnonzero(facets_of.links(cell) == facet)[0])
        middle = layout.entity_dofs(1, local)
        corners = [one for one in layout.entity_closure_dofs(1, local) if one not in middle]
        rows.append(dofs[cell][[corners[0], middle[0], corners[1]]])
    found = places[np.array(rows, dtype=np.int64).reshape(-1, 3)]
    pieces = np.concatenate(domain.comm.allgather(found))
    return np.concatenate([pieces[:, 0], pieces[:, 1]]), np.concatenate([pieces[:, 1], pieces[:, 2]])


def cells_at(domain: Domain, walls: Sequence[str]) -> Integers:
    """Local cells, ghosts included, that have a corner on one of the named walls. Collective."""
    corners = compat.space(domain.mesh, ("Lagrange", 1))
    facets = np.unique(np.concatenate([domain.facets_of(name) for name in walls]))
    on_wall = np.zeros(len(corners.tabulate_dof_coordinates()), dtype=bool)
    on_wall[compat.nodes_on(corners, facets)] = True
    return np.flatnonzero(on_wall[compat.cell_dofs(corners)].any(axis=1))


def nodes_of(space: dolfinx.fem.FunctionSpace, cells: Integers) -> Integers:
    """Local nodes of a scalar space that any rank has in some of its cells. Collective."""
    function = dolfinx.fem.Function(space)
    function.x.array[np.unique(compat.cell_dofs(space)[cells])] = 1.0
    view = compat.vec_view(function)
    view.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    view.ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)
    view.destroy()
    return np.flatnonzero(function.x.array > 0.0)

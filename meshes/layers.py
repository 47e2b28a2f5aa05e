"""Layers of thin cells along walls: the cells beyond make room, and columns of points fill it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from incipient.arrays import Floats, Integers, unit, unordered_keys
from incipient.errors import MeshError
from incipient.geometry.plane.curves import increasing_roots
from incipient.geometry.triangles import tree

from .regions import WallLayers
from .simplices import Simplices, measures

STEEPER = (
    1.1  # than wanted: ratio of the thicknesses of neighbouring layers where there is much room
)
ON_PLANE = 1e-12  # of a region's height
NO_ROOM = "there is no room for layers of cells along the walls: use another numerics.mesh_size"


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns of points on the points of walls.

    points (n, gdim): the mesh's own, and those above walls
    rows (columns, layers + 1): numbers of a column's points, the last ones alike where it has fewer layers
    share (columns, layers + 1): one at the wall, zero where the layers end
    """

    points: Floats
    rows: Integers
    share: Floats

    @classmethod
    def standing(
        cls,
        points: Floats,
        feet: Integers,
        direction: Floats,
        thickness: Floats,
        first: Floats,
        layers: WallLayers,
    ) -> Columns:
        """Columns on points of walls in directions (columns, gdim), of given thickness and first layers."""
        heights = layer_heights(thickness, first, layers)
        new = np.diff(heights, axis=1, prepend=0.0) > 0.0
        numbers = np.where(new, len(points) + np.cumsum(new.ravel()).reshape(new.shape) - 1, -1)
        rows = np.maximum.accumulate(numbers, axis=1)
        rows = np.where(rows < 0, feet[:, None], rows)
        above = points[feet, None] + heights[:, :, None] * direction[:, None]
        share = 1.0 - heights / np.where(thickness > 0.0, thickness, np.inf)[:, None]
        return cls(np.concatenate([points, above[new]]), rows, share)

    def by_point(self, count: int) -> tuple[Integers, Floats]:
        """The wall's point below each of a mesh's points (count,), -1: none, and the share there."""
        foot, share = np.full(count, -1), np.zeros(count)
        foot[self.rows] = self.rows[:, :1]
        share[self.rows] = self.share
        return foot, share


def with_layers(mesh: Simplices, layers: WallLayers) -> tuple[Simplices, Columns]:
    """Straight cells with layers along the named walls; the other sides are planes.

    The cells retreat from the walls; prisms cut into simplices fill the space. Raises MeshError without room.
    """
    walls, count = [name for name in layers.first if name in mesh.sides], len(mesh.points)
    gdim = mesh.points.shape[1]
    facets = np.sort(np.concatenate([mesh.sides[name] for name in walls]), axis=1)
    feet, number = np.unique(facets, return_inverse=True)
    of_facets, column = number.reshape(-1, gdim), np.zeros(count, dtype=np.int64)
    column[feet] = np.arange(len(feet))
    first = np.full(count, np.inf)
    for name in walls:
        first[mesh.sides[name]] = layers.first[name]
    retreat = _Retreat.of(mesh, walls, feet)
    thickness, moved = _room(mesh, retreat, of_facets, first[feet], layers)
    columns = Columns.standing(mesh.points, feet, retreat.inwards, thickness, first[feet], layers)
    prisms = stacked(columns.rows[of_facets])
    inside_out = measures(columns.points, prisms) < 0.0
    prisms[inside_out] = prisms[inside_out][:, [0, 2, 1, *range(3, gdim + 1)]]
    others, top = np.setdiff1d(np.arange(count), feet), np.arange(count)
    top[feet], columns.points[others] = columns.rows[:, -1], moved[others]
    cells = np.concatenate([top[mesh.cells], prisms])
    if (measures(columns.points, cells) <= 0.0).any():
        raise MeshError(NO_ROOM)
    of_walls = unordered_keys(_rims(facets), count)
    sides = {name: mesh.sides[name] for name in mesh.sides}
    for name, part in mesh.sides.items():
        if name not in walls:
            rims = np.sort(_rims(part), axis=1)
            rims = rims[np.isin(unordered_keys(rims, count), of_walls)]
            sides[name] = np.concatenate([top[part], stacked(columns.rows[column[rims]])])
    return Simplices(columns.points, cells, sides), columns


@dataclass(frozen=True, eq=False)
class _Retreat:
    """The harmonic displacement of a mesh whose walls move inwards, while its other sides stay in their planes.

    feet: points of the walls; inwards (feet, gdim): unit vectors
    parts: by axis the points free to move, the factors of their stiffness, and its columns of the feet
    """

    feet: Integers
    inwards: Floats
    parts: list[tuple[Integers, Any, Any]]

    @classmethod
    def of(cls, mesh: Simplices, walls: list[str], feet: Integers) -> _Retreat:
        from scipy.sparse import coo_matrix  # which take time to import, and few meshes have layers
        from scipy.sparse.linalg import splu

        points, cells, (count, gdim) = mesh.points, mesh.cells, mesh.points.shape
        corners, volumes = points[cells], np.abs(measures(points, cells))[:, None, None]
        inner = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
        slopes = np.concatenate([-inner.sum(axis=1, keepdims=True), inner], axis=1)
        faces = np.concatenate([np.delete(cells, k, axis=1) for k in range(gdim + 1)])
        facets = np.concatenate([mesh.sides[name] for name in walls])
        keys = unordered_keys(faces, count)
        order = np.argsort(keys)
        at = order[np.searchsorted(keys, unordered_keys(facets, count), sorter=order)]
        normals, held = np.zeros_like(points), np.zeros(points.shape, dtype=bool)
        np.add.at(normals, facets, (volumes * slopes)[at % len(cells), at // len(cells), None])
        for part in (part for name, part in mesh.sides.items() if name not in walls):
            flat = np.ptp(points[part], axis=1) < ON_PLANE
            for axis in range(gdim):
                held[part[flat[:, axis] | ~flat.any(axis=1)], axis] = True
        normals[held] = 0.0
        held[feet] = True
        rows, columns = np.broadcast_arrays(cells[:, :, None], cells[:, None])
        stiffness = (volumes * slopes) @ slopes.transpose(0, 2, 1)
        entries = stiffness.ravel(), (rows.ravel(), columns.ravel())
        matrix = coo_matrix(entries, shape=(count, count)).tocsr()
        parts = []
        for axis in range(gdim):
            free = np.flatnonzero(~held[:, axis])
            own = matrix[free]
            parts.append((free, splu(own[:, free].tocsc()), own[:, feet]))
        return cls(feet, unit(normals[feet]), parts)

    def moved(self, points: Floats, thickness: Floats) -> Floats:
        """Points (n, gdim) behind layers of a thickness (feet,)."""
        places, way = points.copy(), thickness[:, None] * self.inwards
        places[self.feet] += way
        for axis, (free, factors, from_feet) in enumerate(self.parts):
            places[free, axis] -= factors.solve(from_feet @ way[:, axis])
        return places


def _room(
    mesh: Simplices, retreat: _Retreat, facets: Integers, first: Floats, layers: WallLayers
) -> tuple[Floats, Floats]:
    """Thickness (feet,) of all layers, at most such that they are as thick as cells beyond, and points behind them."""
    pairs = combinations(range(facets.shape[1]), 2)
    edges = np.unique(np.concatenate([facets[:, pair] for pair in map(list, pairs)]), axis=0)
    on_wall = mesh.points[retreat.feet]
    lengths = np.linalg.norm(on_wall[edges[:, 0]] - on_wall[edges[:, 1]], axis=1)
    mean = np.bincount(edges.ravel(), np.repeat(lengths, 2)) / np.bincount(edges.ravel())
    growth = STEEPER * layers.growth
    most = first * (growth**layers.number - 1.0) / (growth - 1.0)
    thickness = np.minimum(
        np.maximum((layers.growth * mean - first) / (layers.growth - 1.0), first), most
    )
    # Of their measure, what cells that make room keep at least
    least, near = 0.2 * measures(mesh.points, mesh.cells), tree(on_wall)
    for trial in range(40):
        # Along a wall it changes by at most 0.3 of the length of edges.
        thickness = evened(thickness, edges, 0.3 * lengths)
        places = retreat.moved(mesh.points, thickness)
        narrow = mesh.cells[measures(places, mesh.cells) < least]
        if not len(narrow):
            return thickness, places
        # A cell that the nearest columns leave too narrow is between further ones.
        columns = [*range(1, min(2 + max(trial - 9, 0), len(first)))]
        touched = near.query(mesh.points[narrow].reshape(-1, mesh.points.shape[1]), columns)[1]
        thickness[np.unique(touched)] *= 0.7
    raise MeshError(NO_ROOM)


def _rims(facets: Integers) -> Integers:
    gdim = facets.shape[1]
    return np.concatenate([facets[:, list(k)] for k in combinations(range(gdim), gdim - 1)])


def stacked(rows: Integers) -> Integers:
    """The simplices between columns (k, gdim, layers + 1) on each facet of a wall.

    They have one sense where facets have: edges run with the fluid on the left, triangles turn left seen from it.
    """
    gdim, low, high = rows.shape[1], rows[:, :, :-1], rows[:, :, 1:]
    parts = []
    for k in range(gdim):
        corners = np.concatenate([low[:, : k + 1], high[:, k:]], axis=1)
        if (gdim - k) % 2 == 0:
            corners[:, [-1, -2]] = corners[:, [-2, -1]]
        parts.append(corners.transpose(0, 2, 1).reshape(-1, gdim + 1))
    cells = np.concatenate(parts)
    ordered = np.sort(cells, axis=1)
    return cells[(ordered[:, 1:] > ordered[:, :-1]).all(axis=1)]


def evened(values: Floats, links: Integers, slack: Floats) -> Floats:
    """Values (n,) lowered until they differ by at most the slack (k,) of links (k, 2)."""
    a, b = links.T
    even = values.copy()
    while True:
        before = even.copy()
        np.minimum.at(even, a, before[b] + slack)
        np.minimum.at(even, b, before[a] + slack)
        if np.array_equal(even, before):
            return even


def layer_heights(thickness: Floats, first: Floats, layers: WallLayers) -> Floats:
    """Heights (n, number + 1) above a wall at which layers end, with the given first one.

    At least one, as many as fit; further ones coincide with the last.
    """
    rows = np.log(1.0 + (layers.growth - 1.0) * thickness / first) / np.log(layers.growth)
    counts = np.clip(np.ceil(rows - 0.3), 1, layers.number)  # none for less than 0.3 of a layer
    powers = np.arange(layers.number)
    there = powers < counts[:, None]
    steepest = np.full(len(first), 2.0 * STEEPER * layers.growth)
    ratio = increasing_roots(
        lambda r: first * (there * r[:, None] ** powers).sum(axis=1) - thickness,
        np.ones(len(first)),
        steepest,
    )[:, None]
    ends = np.cumsum(there * ratio**powers, axis=1)
    ends = np.where(powers < counts[:, None] - 1.0, ends / ends[:, -1:], 1.0)
    return np.asarray(thickness[:, None] * np.column_stack([np.zeros(len(first)), ends]))

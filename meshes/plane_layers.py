"""Layers of thin triangles along walls of any shape in the plane, and free triangles between them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from incipient.arrays import Floats, Integers, planar_cross
from incipient.interrupt import handlers_kept

from .region import WallLayers
from .wall_layers import steps

with handlers_kept():  # at its import gmsh takes interrupts for itself
    import gmsh

# How thick all layers at a place of a wall may be, over the radius of the largest circle that touches it there and
# reaches beyond no other wall.
ROOM = 0.6
EVENNESS = 0.4  # by which thickness changes along a wall at most, over the length of edges
THINNEST = 0.5  # of the first layer as wanted: where there is no more room, there are no layers
FAN = np.radians(30.0)  # turn between the columns of cells around a corner that sticks out, at most
SKEWEST = 0.5  # cosine between a column and the normal of an edge, at the least taken into account
CLOSE = (
    1e-6  # cosine between a normal and the way to another place, below which they are on one line
)


@dataclass(frozen=True, eq=False)
class Boundary:
    """The boundary of a region in edges: a closed loop after the other, the fluid on the left.

    points (n, 2), edges (m, 2) and their middles (m, 2) on the curves, names (m,) of what they are part of
    """

    points: Floats
    edges: Integers
    middles: Floats
    names: tuple[str, ...]

    @classmethod
    def read(cls, curves: dict[str, list[int]]) -> Boundary:
        """The edges of order two that gmsh holds on curves by name."""
        rows, names = [np.empty((0, 3), dtype=np.int64)], list[str]()
        for name, tags in curves.items():
            for tag in tags:
                rows.append(
                    gmsh.model.mesh.getElementsByType(8, tag)[1].astype(np.int64).reshape(-1, 3)
                )
                names += [name] * len(rows[-1])
        nodes, places, _ = gmsh.model.mesh.getNodes()
        row = np.full(int(nodes.max()) + 1, -1)
        row[nodes.astype(np.int64)] = np.arange(len(nodes))
        points, found = np.reshape(places, (-1, 3))[:, :2], row[np.concatenate(rows)]
        order, flipped = _around(points, found[:, :2])
        edges = np.where(flipped[:, None], found[order, 1::-1], found[order, :2])
        return cls(points, edges, points[found[order, 2]], tuple(names[k] for k in order))


def _around(points: Floats, edges: Integers) -> tuple[Integers, Integers]:
    """The order (m,) of edges around their loops, and which are to be turned, so that the inside is on the left."""
    at: dict[int, list[int]] = {}
    for k, ends in enumerate(edges.tolist()):
        for end in ends:
            at.setdefault(end, []).append(k)
    loops, left = [], set(range(len(edges)))
    while left:
        k = min(left)
        start, here = edges[k].tolist()
        loop = [(k, False)]
        left.discard(k)
        while here != start:
            k = next(one for one in at[here] if one in left)
            left.discard(k)
            a, b = edges[k].tolist()
            loop.append((k, b == here))
            here = a if b == here else b
        loops.append(loop)
    turned = []
    for loop in loops:
        corners = points[[edges[k][int(flip)] for k, flip in loop]]
        area = planar_cross(corners, np.roll(corners, -1, axis=0)).sum()
        turned.append(
            ([*loop] if area > 0 else [(k, not flip) for k, flip in reversed(loop)], abs(area))
        )
    outer = max(range(len(turned)), key=lambda k: turned[k][1])
    result = []
    for number, (loop, _) in enumerate(turned):
        result += loop if number == outer else [(k, not flip) for k, flip in reversed(loop)]
    return np.array([k for k, _ in result]), np.array([flip for _, flip in result])


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns of cells, a row of points each, that stand on points of walls.

    foot (n,):       point of the boundary
    direction (n, 2): into the fluid; longer than one where a column is not normal to its wall
    wanted, most (n,): thickness of the first layer, and of all together
    ends (j, 2):     columns at the end of a wall, and the edge along which they stand of a boundary without layers
    ends (j, 2):     columns at the end of a wall, and the edge of a boundary without layers along which they stand
    """

    foot: Integers
    direction: Floats
    wanted: Floats
    most: Floats
    pairs: Integers
    edges: Integers
    ends: Integers


def columns_on(boundary: Boundary, layers: WallLayers) -> Columns:
    """The columns on the walls of a boundary that have layers."""
    points, edges = boundary.points, boundary.edges
    along = points[edges[:, 1]] - points[edges[:, 0]]
    lengths = np.linalg.norm(along, axis=1)
    along = along / lengths[:, None]
    normals = np.column_stack([-along[:, 1], along[:, 0]])
    first = np.array([layers.first.get(name, 0.0) for name in boundary.names])
    before = np.empty(len(points), dtype=np.int64)
    before[edges[:, 1]] = np.arange(len(edges))
    foot, direction, wanted, most = list[int](), list[Floats](), list[float](), list[float]()
    left, right = (
        np.full(len(edges), -1),
        np.full(len(edges), -1),
    )  # column at the start, and at the end, of an edge
    pairs, below, ends = list[tuple[int, int]](), list[int](), list[tuple[int, int]]()
    for after, (point, _) in enumerate(edges.tolist()):
        ahead = int(before[point])
        walls = [k for k in (ahead, after) if first[k]]
        if not walls:
            continue
        size, number = float(lengths[walls].mean()), len(foot)
        turned = [normals[k] for k in walls]
        if len(walls) == 1:
            side = after if walls[0] == ahead else ahead
            way = along[side] if side == after else -along[side]
            turned = [way / max(float(way @ turned[0]), SKEWEST)]
            ends.append((number, side))
        else:
            turn = float(
                np.arctan2(planar_cross(along[ahead], along[after]), along[ahead] @ along[after])
            )
            parts = int(np.ceil(-turn / FAN - 1e-9)) if turn < -FAN else 0
            turned = _fan(normals[ahead], turn, parts)
        thin = float(first[walls].min())
        for one in turned:
            foot.append(point)
            direction.append(one)
            wanted.append(thin)
            most.append(max((layers.growth * size - thin) / (layers.growth - 1.0), thin))
        around = list(pairwise(range(number, len(foot))))
        pairs += around
        below += [-1 - after] * len(around)
        right[ahead], left[after] = number, len(foot) - 1
    for k in np.flatnonzero(first):
        pairs.append((int(left[k]), int(right[k])))
        below.append(int(k))
    return Columns(
        foot=np.array(foot),
        direction=np.array(direction),
        wanted=np.array(wanted),
        most=np.array(most),
        pairs=np.array(pairs),
        edges=np.array(below),
        ends=np.array(ends, dtype=np.int64).reshape(-1, 2),
    )


def _fan(normal: Floats, turn: float, parts: int) -> list[Floats]:
    """Directions between two normals a turn apart: the middle one, or those around a corner that sticks out."""

    def turned(angle: float) -> Floats:
        c, s = np.cos(angle), np.sin(angle)
        return np.array([c * normal[0] - s * normal[1], s * normal[0] + c * normal[1]])

    if not parts:
        return [turned(0.5 * turn) / max(np.cos(0.5 * turn), SKEWEST)]
    return [turned(turn * k / parts) for k in range(parts + 1)]


def room_at(boundary: Boundary, columns: Columns, part: float = ROOM) -> Floats:
    """How thick (n,) all layers together are at most, along walls slowly changing."""
    ends = set(columns.ends[:, 1].tolist())
    # Sides along which columns stand are no obstacles to them.
    kept = [k for k, name in enumerate(boundary.names) if k not in ends]
    sides = {boundary.names[k] for k in ends}
    kept = [k for k in kept if boundary.names[k] not in sides]
    places = np.concatenate(
        [boundary.points[np.unique(boundary.edges[kept])], boundary.middles[kept]]
    )
    found = columns.most.copy()
    feet = boundary.points[columns.foot]
    lengths = np.linalg.norm(columns.direction, axis=1)
    units = columns.direction / lengths[:, None]
    for k, (x, n) in enumerate(zip(feet, units, strict=True)):
        away = places - x
        square = (away**2).sum(axis=1)
        height = away @ n
        there = height > CLOSE * np.sqrt(square)
        if there.any():
            radius = float((0.5 * square[there] / height[there]).min())
            found[k] = min(found[k], part * radius / lengths[k])
    return _even(found, columns, feet)


def _even(thickness: Floats, columns: Columns, feet: Floats) -> Floats:
    """Thickness (n,) that changes slowly along walls, and none where there is room for hardly any."""
    a, b = columns.pairs.T
    apart = EVENNESS * np.linalg.norm(feet[a] - feet[b], axis=1)
    found = thickness.copy()
    while True:
        before = found.copy()
        np.minimum.at(found, a, before[b] + apart)
        np.minimum.at(found, b, before[a] + apart)
        if np.array_equal(found, before):
            break
    return np.where(found < THINNEST * columns.wanted, 0.0, found)


@dataclass(frozen=True, eq=False)
class Layered:
    """The layers along walls: points (n, 2) of which the first are the boundary's, and what stands on them.

    rows (columns, layers + 1): points of each column, the last ones alike where it has fewer layers
    share (columns, layers + 1): one at the wall, zero where the layers end
    """

    points: Floats
    rows: Integers
    share: Floats
    cells: Integers

    @property
    def tops(self) -> Integers:
        """Points (columns,) where the layers end."""
        return self.rows[:, -1]


def layers_on(
    boundary: Boundary, columns: Columns, thickness: Floats, layers: WallLayers
) -> Layered:
    """The cells of layers that together are as thick (n,) as given."""
    high = steps(thickness, columns.wanted, layers)
    new = np.diff(high, axis=1, prepend=0.0) > 0.0
    count = len(boundary.points)
    numbers = np.where(new, count + np.cumsum(new.ravel()).reshape(new.shape) - 1, -1)
    rows = np.maximum.accumulate(numbers, axis=1)
    rows = np.where(rows < 0, columns.foot[:, None], rows)
    heights = boundary.points[columns.foot, None] + high[:, :, None] * columns.direction[:, None]
    points = np.concatenate([boundary.points, heights[new]])
    share = 1.0 - high / np.where(thickness > 0.0, thickness, np.inf)[:, None]
    a, b = rows[columns.pairs].transpose(1, 0, 2)
    quads = np.stack([a[:, :-1], b[:, :-1], b[:, 1:], a[:, 1:]], axis=-1).reshape(-1, 4)
    return Layered(points, rows, share, _cut(points, quads))


def _cut(points: Floats, quads: Integers) -> Integers:
    """Triangles (m, 3) of quadrilaterals (n, 4) along the shorter diagonal, those without area left out."""
    a, b, c, d = points[quads].transpose(1, 0, 2)
    first = ((a - c) ** 2).sum(axis=1) <= ((b - d) ** 2).sum(axis=1)
    # Where two corners are one there is one triangle only, whatever the diagonal.
    both = [
        np.where(first[:, None], quads[:, one], quads[:, other])
        for one, other in (((0, 1, 2), (0, 1, 3)), ((0, 2, 3), (1, 2, 3)))
    ]
    found = np.concatenate(both)
    ordered = np.sort(found, axis=1)
    return found[(ordered[:, 1:] > ordered[:, :-1]).all(axis=1)]

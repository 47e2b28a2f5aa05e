"""Layers of thin cells along walls, put between the walls and the tetrahedra of a mesh in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from incipient.arrays import Floats, Integers
from incipient.errors import MeshError

from .region import PART, WallLayers
from .tetrahedra import SIDES, Tetrahedra

STEEPER = (
    1.1  # than wanted: ratio of the thicknesses of neighbouring layers where there is much room
)
EVENNESS = 0.3  # by which thickness changes along a wall at most, over the length of edges
LEAST_VOLUME, LESS, MOST_TRIALS = (
    0.2,
    0.7,
    40,
)  # of cells that make room; the factor of layers that leave too little
FEWER = 0.3  # of a layer, for which no further one is made
FACES = ((1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2))  # of a tetrahedron, opposite to its corners


@dataclass(frozen=True, eq=False)
class Columns:
    """Which points of a mesh lie above the points of a wall.

    foot (n,):  the point of the wall below each point, -1 where there is none
    share (n,): one at the wall, zero where the layers end
    """

    foot: Integers
    share: Floats


def layered(made: Tetrahedra, layers: WallLayers) -> tuple[Tetrahedra, Columns]:
    """Straight cells with layers along the walls that are named; the other sides are planes.

    The cells at a wall draw back from it, and prisms of three tetrahedra each fill the room.

    Raises:
        MeshError: there is no room for layers.
    """
    walls = [name for name in layers.first if name in made.sides]
    triangles = np.sort(np.concatenate([made.sides[name] for name in walls]), axis=1)
    feet = np.unique(triangles)
    number = len(made.points)
    wanted = np.full(number, np.inf)
    for name in walls:
        wanted[made.sides[name]] = layers.first[name]
    inwards = _inwards(made, walls, feet)
    thickness = _room(made, triangles, feet, inwards, wanted, layers)
    ends = steps(thickness[feet], wanted[feet], layers)  # (feet, layers + 1)
    row = np.full(number, -1)
    row[feet] = np.arange(len(feet))
    # What was on a wall is where the layers end, of which there are fewer where they are thin; points below are new.
    new = ends < ends[:, -1:]
    numbers = np.tile(feet[:, None], (1, layers.number + 1))
    numbers[new] = number + np.arange(new.sum())
    heights = (made.points[feet, None] + ends[:, :, None] * inwards[feet, None])[new]
    points = np.concatenate([made.points, heights])
    points[feet] += ends[:, -1:] * inwards[feet]
    foot, share = np.full(len(points), -1), np.zeros(len(points))
    foot[numbers] = numbers[:, :1]
    share[numbers] = 1.0 - ends / ends[:, -1:]
    columns = numbers[row[triangles]]  # (triangles, 3, layers + 1)
    a, b, c = columns.transpose(1, 0, 2)
    low, high = slice(None, -1), slice(1, None)
    parts = [
        (a[:, low], b[:, low], c[:, low], c[:, high]),
        (a[:, low], b[:, low], b[:, high], c[:, high]),
        (a[:, low], a[:, high], b[:, high], c[:, high]),
    ]
    prisms = _whole([np.stack(part, axis=-1).reshape(-1, 4) for part in parts])
    sides = {
        name: numbers[row[part], 0] if name in walls else _widened(part, triangles, numbers, row)
        for name, part in made.sides.items()
    }
    cells = np.concatenate([made.cells, _turned(points, prisms)])
    if (volumes(points, cells) <= 0.0).any():
        raise MeshError(
            "there is no room for layers of cells along the walls: use another numerics.mesh_size"
        )
    return Tetrahedra(points, cells, sides), Columns(foot, share)


def volumes(points: Floats, cells: Integers) -> Floats:
    """Volumes (m,) of straight cells (m, 4), negative where they are inside out."""
    a, b, c, d = points[cells].transpose(1, 0, 2)
    return np.asarray(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0)


def _turned(points: Floats, cells: Integers) -> Integers:
    """The cells with two corners exchanged where they are inside out."""
    inside_out = volumes(points, cells) < 0.0
    return np.where(inside_out[:, None], cells[:, [0, 2, 1, 3]], cells)


def _keys(parts: Integers, number: int) -> Integers:
    """A number (m,) for each edge or triangle of corners (m, 2 or 3)."""
    found = np.zeros(len(parts), dtype=np.int64)
    for column in np.sort(parts, axis=1).T:
        found = found * number + column
    return found


def _inwards(made: Tetrahedra, walls: list[str], feet: Integers) -> Floats:
    """Unit vectors (n, 3) into the fluid at points of walls, along the plane sides on which they are."""
    points, found = made.points, np.zeros_like(made.points)
    triangles = np.concatenate([made.sides[name] for name in walls])
    faces = np.concatenate([made.cells[:, face] for face in FACES])
    opposite = made.cells.T.ravel()
    keys = _keys(faces, len(points))
    order = np.argsort(keys)
    at = order[np.searchsorted(keys, _keys(triangles, len(points)), sorter=order)]
    a, b, c = points[triangles].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    normals *= np.sign(np.einsum("ij,ij->i", normals, points[opposite[at]] - a))[:, None]
    for column in triangles.T:
        np.add.at(found, column, normals)
    for name, part in made.sides.items():
        if name not in walls:
            for axis in range(3):
                flat = np.ptp(points[part][:, :, axis], axis=1) < 1e-12
                found[np.unique(part[flat]), axis] = 0.0
    found[feet] /= np.linalg.norm(found[feet], axis=1, keepdims=True)
    return found


def _room(
    made: Tetrahedra,
    triangles: Integers,
    feet: Integers,
    inwards: Floats,
    first: Floats,
    layers: WallLayers,
) -> Floats:
    """How thick (n,) all layers together are at points of walls: so that the cells beyond stay sound."""
    edges = np.unique(np.concatenate([triangles[:, side] for side in SIDES]), axis=0)
    lengths = np.linalg.norm(made.points[edges[:, 0]] - made.points[edges[:, 1]], axis=1)
    total, count = np.zeros(len(made.points)), np.zeros(len(made.points))
    for column in edges.T:
        np.add.at(total, column, lengths)
        np.add.at(count, column, 1.0)
    thickness = np.zeros(len(made.points))
    growth = STEEPER * layers.growth
    most = first[feet] * (growth**layers.number - 1.0) / (growth - 1.0)
    thickness[feet] = np.minimum(PART * total[feet] / count[feet], most)
    on_wall = np.zeros(len(made.points), dtype=bool)
    on_wall[feet] = True
    touched = made.cells[on_wall[made.cells].any(axis=1)]
    before = volumes(made.points, touched)
    for _ in range(MOST_TRIALS):
        _even(thickness, edges, lengths)
        places = made.points + thickness[:, None] * inwards
        narrow = touched[volumes(places, touched) < LEAST_VOLUME * before]
        if not len(narrow):
            return thickness
        thickness[np.unique(narrow)] *= LESS
    raise MeshError(
        "there is no room for layers of cells along the walls: use another numerics.mesh_size"
    )


def _even(thickness: Floats, edges: Integers, lengths: Floats) -> None:
    """Let thickness change slowly along walls."""
    for _ in range(3):
        a, b = edges.T
        most = np.full(len(thickness), np.inf)
        np.minimum.at(most, a, thickness[b] + EVENNESS * lengths)
        np.minimum.at(most, b, thickness[a] + EVENNESS * lengths)
        np.minimum(thickness, most, out=thickness)


def steps(thickness: Floats, first: Floats, layers: WallLayers) -> Floats:
    """Heights (n, number + 1) above a wall at which layers end, the first of them as wanted.

    As many as there is room for, at least one; those beyond are where the last one is.
    """
    rows = np.log(1.0 + (layers.growth - 1.0) * thickness / first) / np.log(layers.growth)
    counts = np.clip(np.ceil(rows - FEWER), 1, layers.number)
    powers = np.arange(layers.number)
    there = powers < counts[:, None]
    low, high = np.ones(len(first)), np.full(len(first), 2.0 * STEEPER * layers.growth)
    for _ in range(50):
        middle = 0.5 * (low + high)
        thick = first * (there * middle[:, None] ** powers).sum(axis=1) > thickness
        low, high = np.where(thick, low, middle), np.where(thick, middle, high)
    ends = np.cumsum(there * low[:, None] ** powers, axis=1)
    ends = np.where(powers < counts[:, None] - 1.0, ends / ends[:, -1:], 1.0)
    return np.asarray(thickness[:, None] * np.column_stack([np.zeros(len(first)), ends]))


def _widened(side: Integers, triangles: Integers, numbers: Integers, row: Integers) -> Integers:
    """Triangles (k, 3) of a plane side with those that layers add to it where a wall ends in it."""
    edges = np.sort(np.concatenate([side[:, pair] for pair in SIDES]), axis=1)
    of_walls = np.concatenate([triangles[:, pair] for pair in SIDES])
    size = len(row)
    edges = edges[np.isin(_keys(edges, size), _keys(of_walls, size))]
    a, b = numbers[row[edges]].transpose(1, 0, 2)
    lower, upper = (a[:, :-1], b[:, :-1], b[:, 1:]), (a[:, :-1], b[:, 1:], a[:, 1:])
    return _whole([side, *(np.stack(part, axis=-1).reshape(-1, 3) for part in (lower, upper))])


def _whole(parts: list[Integers]) -> Integers:
    """The cells, or triangles, (m, corners) of parts that have no corner twice."""
    found = np.concatenate(parts)
    ordered = np.sort(found, axis=1)
    return found[(ordered[:, 1:] > ordered[:, :-1]).all(axis=1)]

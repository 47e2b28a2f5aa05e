"""Triangulations of level surfaces: a grid's cells cut into tetrahedra, and these by the surface."""

from collections.abc import Callable
from itertools import permutations

import numpy as np

from incipient.arrays import Floats
from incipient.geometry.space.surfaces import Surface, vector_areas

BLOCK = 20_000  # points at which a level is asked for at once


def in_blocks(level: Callable[[Floats], Floats], x: Floats) -> Floats:
    """The level (n,) at points (n, 3), asked for a few at a time so that pairs with many pieces fit into memory."""
    parts = np.array_split(x, 1 + len(x) // BLOCK)
    return np.concatenate([level(part) for part in parts])


def level_surface(
    level: Callable[[Floats], Floats], axes: tuple[Floats, Floats, Floats]
) -> Surface:
    """The surface level = 0 within a grid given by its abscissae along three axes; it faces growing levels.

    Each cell is cut into six tetrahedra about its diagonal (Kuhn), in each of which the level is taken to be linear,
    so that the triangles fit together without holes. Where the surface meets the grid's outside its vertices lie there.
    """
    shape = tuple(len(axis) for axis in axes)
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    values = in_blocks(level, points)
    values[values == 0.0] = 1e-300
    tetrahedra = _crossed_tetrahedra(values.reshape(shape))
    above = values[tetrahedra] > 0.0
    number = above.sum(axis=1)
    pieces = []
    for lonely, count in ((True, 1), (False, 3)):
        chosen = tetrahedra[number == count]
        alone = np.argmax(above[number == count] == lonely, axis=1)
        rest = [
            np.take_along_axis(chosen, ((alone + k) % 4)[:, None], 1)[:, 0] for k in (0, 1, 2, 3)
        ]
        pieces.append(np.stack([np.column_stack([rest[0], rest[k]]) for k in (1, 2, 3)], axis=1))
    halves = tetrahedra[number == 2]
    order = np.argsort(~above[number == 2], axis=1, kind="stable")
    a, b, c, d = np.take_along_axis(halves, order, 1).T
    ac, bc, bd, ad = (np.column_stack(pair) for pair in ((a, c), (b, c), (b, d), (a, d)))
    pieces += [np.stack([ac, bc, bd], axis=1), np.stack([ac, bd, ad], axis=1)]
    return _joined(points, values, np.concatenate(pieces))


def _crossed_tetrahedra(values: Floats) -> np.ndarray:
    """The grid's tetrahedra (m, 4) on whose corners the values have both signs."""
    index = np.arange(values.size).reshape(values.shape)
    steps = np.array([index[1, 0, 0], index[0, 1, 0], index[0, 0, 1]])
    positive = values > 0.0
    corner = [
        positive[
            i : values.shape[0] - 1 + i, j : values.shape[1] - 1 + j, k : values.shape[2] - 1 + k
        ]
        for i in (0, 1)
        for j in (0, 1)
        for k in (0, 1)
    ]
    count = np.sum(corner, axis=0)
    first = index[:-1, :-1, :-1][(count > 0) & (count < 8)]
    ways = [np.cumsum([0, *steps[list(way)]]) for way in permutations(range(3))]
    tetrahedra = np.concatenate([first[:, None] + way for way in ways])
    above = (values.ravel()[tetrahedra] > 0.0).sum(axis=1)
    return np.asarray(tetrahedra[(above > 0) & (above < 4)])


def _joined(points: Floats, values: Floats, crossings: np.ndarray) -> Surface:
    """Triangles from the grid's edges (m, 3 corners, 2 ends) that the surface crosses."""
    ends = np.sort(crossings.reshape(-1, 2), axis=1)
    edges, corner = np.unique(ends, axis=0, return_inverse=True)
    low, high = values[edges[:, 0]], values[edges[:, 1]]
    # Crossings very near a point of the grid would make needles.
    share = np.clip(low / (low - high), 0.02, 0.98)[:, None]
    places = points[edges[:, 0]] + share * (points[edges[:, 1]] - points[edges[:, 0]])
    triangles = corner.reshape(-1, 3)
    up = points[edges[:, 1]] - points[edges[:, 0]]
    up = up * np.sign(high - low)[:, None]
    areas = vector_areas(places[triangles])
    turned = (areas * up[triangles].sum(axis=1)).sum(axis=1) < 0.0
    triangles[turned] = triangles[turned, ::-1]
    return Surface(places, triangles)

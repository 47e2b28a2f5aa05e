"""The nodes of a mesh in space carried onto the exact surfaces, as far as no cell folds over."""

from dataclasses import replace

import numpy as np

from incipient.arrays import Floats, Integers
from incipient.geometry.space.remeshing import ExactSurface

from .tetrahedra import EDGES, SIDES, Tetrahedra
from .wall_layers import Columns

LESS, LEAST_BEND = (
    0.5,
    0.2,
)  # the factor of bends where cells fold over, and the share below which they are straight
LEAST = 0.1  # of a straight cell's volume: the least that the curved one's map may have anywhere
FARTHEST = (
    0.3  # of its edge's length: a node that moves farther has found another part of the surface
)
ON_PLANE = 1e-12  # of a region's height


def curved(
    made: Tetrahedra,
    surfaces: dict[str, ExactSurface],
    walls: tuple[tuple[int, float], ...],
    columns: Columns | None = None,
) -> tuple[Tetrahedra, int]:
    """The cells with their points where they belong, and how many edges stay straight because cells would fold.

    surfaces: what the named triangles of the boundary approximate
    walls:    axis and place of the plane sides, on which points stay
    columns:  points above those of walls, which follow them; None: there are no layers
    """
    straight, places, quadratic = made.points, made.points.copy(), made.cells.shape[1] > 4
    moved = np.empty(0, dtype=int)
    for name, exact in surfaces.items():
        triangles = made.sides[name]
        corners = np.unique(triangles[:, :3])
        places[corners] = exact.project(places[corners], _held(places[corners], walls))
        if not quadratic:
            continue
        ends, middles = _edges(triangles)
        centres = places[ends].mean(axis=1)
        target = exact.project(centres, _held(straight[middles], walls))
        length = np.linalg.norm(places[ends[:, 0]] - places[ends[:, 1]], axis=1)
        near = np.linalg.norm(target - centres, axis=1) <= FARTHEST * length
        places[middles[near]] = target[near]
        moved = np.union1d(moved, middles[near])
    curved_cells = replace(made, points=places)
    if not quadratic:
        return curved_cells, 0
    # Corners may have moved by a rounding: middles that are not curved lie between them.
    between = np.zeros(len(places), dtype=bool)
    between[made.cells[:, 4:]] = True
    between[moved] = False
    _put_between(places, made.cells, np.flatnonzero(between))
    leads = np.arange(len(places))
    if columns is not None:
        moved = np.union1d(moved, _follow(places, made.cells, moved, columns, leads))
    return curved_cells, _unfold(places, made.cells, moved, leads, 0.0 if columns is None else LESS)


def _follow(
    places: Floats, cells: Integers, moved: Integers, columns: Columns, leads: Integers
) -> Integers:
    """Move the middles of edges above curved edges of walls as these, the less the farther; which.

    `leads` (points,) becomes the middle at the wall that each of them follows.
    """
    count, is_moved = len(places), np.zeros(len(places), dtype=bool)
    is_moved[moved] = True
    ends = np.concatenate([cells[:, pair] for pair in EDGES])
    middles = cells[:, 4:].T.ravel()
    _, first = np.unique(middles, return_index=True)
    ends, middles = ends[first], middles[first]
    feet = np.sort(columns.foot[ends], axis=1)
    keys = feet[:, 0] * count + feet[:, 1]
    below = is_moved[middles]
    order = np.argsort(keys[below])
    known, shift = keys[below][order], (places[middles] - places[ends].mean(axis=1))[below][order]
    first = middles[below][order]
    share = columns.share[ends].mean(axis=1)
    follows = (feet[:, 0] >= 0) & (share > 0.0) & ~below & np.isin(keys, known)
    chosen = middles[follows]
    below_these = np.searchsorted(known, keys[follows])
    places[chosen] += share[follows, None] * shift[below_these]
    leads[chosen] = first[below_these]
    return chosen


def _held(x: Floats, walls: tuple[tuple[int, float], ...]) -> np.ndarray:
    """Which coordinates (n, 3) of points (n, 3) are those of a plane side."""
    held = np.zeros(x.shape, dtype=bool)
    for axis, place in walls:
        held[:, axis] |= np.abs(x[:, axis] - place) <= ON_PLANE
    return held


def _edges(triangles: Integers) -> tuple[Integers, Integers]:
    """The ends (k, 2) and middles (k,) of the sides of triangles of order two, each once."""
    ends = np.concatenate([triangles[:, side] for side in SIDES])
    middles, first = np.unique(triangles[:, 3:].T.ravel(), return_index=True)
    return ends[first], middles


def _put_between(places: Floats, cells: Integers, middles: Integers) -> None:
    """Put some of the middles of edges halfway between the edges' ends."""
    chosen = np.zeros(len(places), dtype=bool)
    chosen[middles] = True
    for k, (a, b) in enumerate(EDGES):
        rows = cells[chosen[cells[:, 4 + k]]]
        places[rows[:, 4 + k]] = 0.5 * (places[rows[:, a]] + places[rows[:, b]])


def _unfold(places: Floats, cells: Integers, moved: Integers, leads: Integers, less: float) -> int:
    """Bend edges of cells that fold over less, by a factor, with those that follow or lead them.

    How many become straight is returned.
    """
    bends = places.copy()
    _put_between(bends, cells, moved)
    between = bends[moved]
    bends = places[moved] - between
    share, changed = np.ones(len(places)), np.zeros(len(places), dtype=bool)
    changed[moved] = True
    while True:
        touched = cells[changed[cells[:, 4:]].any(axis=1)]
        bad = touched[least_stretch(places[touched]) < LEAST]
        led = np.unique(leads[np.intersect1d(bad[:, 4:], moved)])
        led = led[share[led] > 0.0]
        if not len(led):
            return int((share[leads[moved]] == 0.0).sum())
        share[led] = np.where(share[led] > LEAST_BEND, less * share[led], 0.0)
        changed[:] = False
        changed[moved] = np.isin(leads[moved], led)
        places[moved] = between + share[leads[moved], None] * bends


def least_stretch(nodes: Floats) -> Floats:
    """A lower bound (m,) of the determinants of tetrahedra of order two (m, 10, 3), in units of the straight ones'.

    The determinant is a cubic: its least control point in Bernstein's form is a lower bound of it everywhere.
    """
    thirds = [
        [i, j, k, 3 - i - j - k] for i in range(4) for j in range(4 - i) for k in range(4 - i - j)
    ]
    lattice = np.array(thirds) / 3.0
    slopes = np.stack([_slopes(point).T for point in lattice])
    # Components first, cells last: one product of matrices, and determinants of whole rows of numbers.
    rates = slopes.reshape(-1, 10) @ nodes.transpose(1, 2, 0).reshape(10, -1)
    a, b, c = rates.reshape(len(lattice), 3, 3, -1).transpose(1, 2, 0, 3)
    straight = np.linalg.det(nodes[:, 1:4] - nodes[:, :1])
    values = _determinant(a, b, c) / straight
    return np.asarray((np.linalg.inv(_bernstein(lattice)) @ values).min(axis=0))


def _determinant(a: Floats, b: Floats, c: Floats) -> Floats:
    """The determinants (...) of matrices with rows a, b, c (3, ...)."""
    return np.asarray(
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )


def _slopes(barycentric: Floats) -> Floats:
    """Derivatives (10 nodes, 3) of the shape functions in the three directions from the first corner."""
    by = np.zeros((10, 4))
    for i in range(4):
        by[i, i] = 4.0 * barycentric[i] - 1.0
    for k, (a, b) in enumerate(EDGES):
        by[4 + k, a], by[4 + k, b] = 4.0 * barycentric[b], 4.0 * barycentric[a]
    return np.asarray(by[:, 1:] - by[:, :1])


def _bernstein(points: Floats) -> Floats:
    """The cubic Bernstein polynomials at points given by barycentric coordinates, (points, 20)."""
    powers = np.round(3.0 * points).astype(int)
    factorial = np.array([1.0, 1.0, 2.0, 6.0])
    return np.asarray(
        6.0 / factorial[powers].prod(axis=1) * (points[:, None, :] ** powers[None]).prod(axis=2)
    )

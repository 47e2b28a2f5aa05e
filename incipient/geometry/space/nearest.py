"""Nearest points on triangles in space, by trees of their centroids or points: quick for very many, too."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from incipient.arrays import Floats, planar_cross, unit
from incipient.geometry.space.surfaces import Surface

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

BLOCK = 1_000_000  # pairs of points and triangles that are looked at together
RAY = unit(
    np.array([0.36419, 0.27183, 0.89124])
)  # no direction in which grains have faces and edges
ROUND_OFF = 1e-9  # of the largest triangle: added to how far a point may be
CLOSE = 2.0  # spacings of the triangles: farther away the nearest vertex alone tells the distance
CLEAR = 1e-9  # how far a ray must pass an edge to be counted: an area, in squares of the triangles' size


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles (m, 3 corners, 3), which may be segments or points, in an order in which they are found by place."""

    corners: Floats

    @cached_property
    def _reach(self) -> Floats:
        """The largest distance (m,) of a triangle's corners from its centroid."""
        middle = self.corners.mean(axis=1, keepdims=True)
        return np.asarray(np.linalg.norm(self.corners - middle, axis=2).max(axis=1))

    @cached_property
    def _centroids(self) -> "cKDTree":
        return _tree(self.corners.mean(axis=1))

    @cached_property
    def _corners(self) -> "cKDTree":
        return _tree(self.corners.reshape(-1, 3))

    @cached_property
    def _frame(self) -> Floats:
        """Columns (3, 3): two directions across the ray and its own."""
        first = unit(np.cross(RAY, [1.0, 0.0, 0.0]))
        return np.column_stack([first, np.cross(RAY, first), RAY])

    @cached_property
    def _shadow(self) -> tuple[Floats, "cKDTree"]:
        """The triangles as seen along the ray, their third components their heights, and where their centroids are."""
        seen = self.corners @ self._frame
        return seen, _tree(seen[..., :2].mean(axis=1))

    def near(self, points: Floats, within: float | Floats) -> tuple[np.ndarray, np.ndarray]:
        """Rows of points (n, 3) and triangles (k,) each that may be as near as `within` (a length, or (n,))."""
        # A point at a corner is as far from a centroid as the triangle reaches: round-off must not lose it.
        around = np.broadcast_to(within, len(points)) + ROUND_OFF * self._reach.max()
        row, triangle = _matches(self._centroids, points, around + self._reach.max())
        apart = np.linalg.norm(points[row] - self._centroids.data[triangle], axis=1)
        close = apart <= self._reach[triangle] + around[row]
        return row[close], triangle[close]

    def nearest(self, points: Floats, slack: float) -> tuple[Floats, np.ndarray, np.ndarray]:
        """The nearest points (n, 3); rows of points and triangles (k,) each that are as near but for a slack."""
        found, before = [(np.empty((0, 3)), np.empty(0, int), np.empty(0, int))], 0
        for block in self._blocks(points):
            row, triangle = self.near(block, self._corners.query(block)[0] + slack)
            feet = nearest_on_triangles(block[row], self.corners[triangle])
            apart = np.linalg.norm(feet - block[row], axis=1)
            order = np.lexsort([apart, row])
            best = order[np.unique(row[order], return_index=True)[1]]
            sharing = apart <= apart[best][row] + slack
            found.append((feet[best], before + row[sharing], triangle[sharing]))
            before += len(block)
        feet, row, triangle = (np.concatenate(column) for column in zip(*found, strict=True))
        return feet, row, triangle

    def _blocks(self, points: Floats) -> Iterator[Floats]:
        """Points a few at a time, so that what is near them does not fill the memory."""
        reach = self._corners.query(points)[0] + self._reach.max()
        pairs = int(self._centroids.query_ball_point(points, reach, return_length=True).sum())
        return (block for block in np.array_split(points, 1 + pairs // BLOCK) if len(block))

    def winding(self, points: Floats) -> Floats:
        """How often the triangles, a closed surface, wind around each of the points (n, 3): 1 inside, 0 outside.

        By the sides from which a ray crosses them; by their solid angles for points whose ray meets an edge.
        """
        seen, tree = self._shadow
        place, extent = points @ self._frame, self._reach.max()
        row, triangle = _matches(tree, place[:, :2], np.full(len(points), extent))
        a, b, c = (seen[triangle, i, :2] - place[row, :2] for i in range(3))
        shares = np.column_stack([planar_cross(b, c), planar_cross(c, a), planar_cross(a, b)])
        twice = shares.sum(axis=1)
        least = (shares * np.sign(twice)[:, None]).min(axis=1)
        crossed = least > CLEAR * extent**2
        height = (shares * seen[triangle, :, 2]).sum(axis=1) / np.where(crossed, twice, 1.0)
        crossed &= height > place[row, 2]
        times = np.bincount(row, np.sign(twice) * crossed, minlength=len(points))
        unclear = np.unique(row[np.abs(least) <= CLEAR * extent**2])
        for some in np.array_split(unclear, 1 + len(unclear) * len(seen) // BLOCK):
            times[some] = _solid_angles(points[some], self.corners)
        return np.asarray(times)


def _tree(points: Floats) -> "cKDTree":
    from scipy.spatial import cKDTree  # which takes time to import

    return cKDTree(points)


def _matches(tree: "cKDTree", points: Floats, within: Floats) -> tuple[np.ndarray, np.ndarray]:
    """Rows of points (n, d) and indices of a tree's points (k,) each that are within distances (n,)."""
    found = tree.query_ball_point(points, within)
    counts = np.fromiter(map(len, found), int, len(found))
    indices = np.fromiter(chain.from_iterable(found), int, counts.sum())
    return np.repeat(np.arange(len(points)), counts), indices


def nearest_on_triangles(x: Floats, corners: Floats) -> Floats:
    """The nearest points (..., 3) of triangles (..., 3 corners, 3) to points (..., 3); leading axes broadcast."""
    a = corners[..., 0, :]
    ab, ac, away = corners[..., 1, :] - a, corners[..., 2, :] - a, x - a
    aa, bb, cross = (ab * ab).sum(-1), (ac * ac).sum(-1), (ab * ac).sum(-1)
    p, q = (away * ab).sum(-1), (away * ac).sum(-1)
    determinant = np.maximum(aa * bb - cross**2, 1e-300)
    u, v = (p * bb - q * cross) / determinant, (q * aa - p * cross) / determinant
    inside = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
    best = a + u[..., None] * ab + v[..., None] * ac
    squared = np.where(inside, ((best - x) ** 2).sum(-1), np.inf)
    for i in range(3):
        start = corners[..., i, :]
        side = corners[..., (i + 1) % 3, :] - start
        along = ((x - start) * side).sum(-1) / np.maximum((side * side).sum(-1), 1e-300)
        foot = start + np.clip(along, 0.0, 1.0)[..., None] * side
        away_squared = ((foot - x) ** 2).sum(-1)
        closer = away_squared < squared
        best, squared = (
            np.where(closer[..., None], foot, best),
            np.where(closer, away_squared, squared),
        )
    return np.asarray(best)


def _solid_angles(x: Floats, corners: Floats) -> Floats:
    """How often a closed surface winds around each of the points (n, 3): 1 inside, 0 outside.

    The sum of the triangles' solid angles (van Oosterom and Strackee 1983).
    """
    a, b, c = (corners[:, i] - x[:, None] for i in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=2) for v in (a, b, c))
    volume = (a * np.cross(b, c)).sum(-1)
    other = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
    return np.asarray((2.0 * np.arctan2(volume, other)).sum(axis=1) / (4.0 * np.pi))


class NearestOf:
    """Which of some points (m, 3) is nearest."""

    def __init__(self, points: Floats):
        self.tree = _tree(points)

    def __call__(self, x: Floats) -> tuple[Floats, np.ndarray]:
        """The distances (n,) of points (n, 3) from the nearest one, and its numbers (n,)."""
        distance, number = self.tree.query(x)
        return distance, number

    def distances(self, x: Floats, count: int, radii: Floats) -> Floats:
        """The distances (count, n) of points (n, 3) from balls of radii (m,) about the `count` nearest points.

        Infinite where there are fewer.
        """
        away, which = self.tree.query(x, [*range(1, 1 + count)])
        return np.asarray((away - np.append(radii, 0.0)[which]).T)

    def within(self, x: Floats, distances: Floats) -> list[np.ndarray]:
        """Numbers of the points within distances (n,) of each of others (n, d)."""
        return [np.array(one, dtype=int) for one in self.tree.query_ball_point(x, distances)]

    def most_within(self, reach: float) -> int:
        """How many of the points lie within a distance of any one of them, itself included; at least 1."""
        if not self.tree.n:
            return 1
        return int(self.tree.query_ball_point(self.tree.data, reach, return_length=True).max())


class Cloud:
    """Triangles with their distance from points, which is that of the triangles around the nearest vertex."""

    def __init__(self, surface: Surface):
        self.corners, self.spacing = surface.corners, surface.spacing
        self.vertices = NearestOf(surface.points)
        flat = surface.triangles.ravel()
        order = np.argsort(flat, kind="stable")
        count = np.bincount(flat, minlength=len(surface.points))
        place = np.arange(len(flat)) - np.repeat(np.cumsum(count) - count, count)
        self.around = np.zeros((len(count), max(int(count.max(initial=0)), 1)), dtype=int)
        self.around += order[np.minimum(np.cumsum(count) - count, len(order) - 1)][:, None] // 3
        self.around[flat[order], place] = order // 3

    def distance(self, x: Floats) -> Floats:
        """The distances (n,) of points (n, 3)."""
        distance, nearest = self.vertices(x)
        near = np.flatnonzero(distance < CLOSE * self.spacing)
        feet = nearest_on_triangles(x[near, None], self.corners[self.around[nearest[near]]])
        distance[near] = np.minimum(
            distance[near], np.linalg.norm(feet - x[near, None], axis=2).min(axis=1)
        )
        return distance

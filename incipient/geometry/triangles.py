"""Search among many triangles, which may be segments or points."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from incipient.arrays import Floats

if TYPE_CHECKING:
    from scipy.spatial import cKDTree


@dataclass(frozen=True, eq=False)
class Triangles:
    """Spatial index of triangles (m, 3, 3), which may be segments or points."""

    corners: Floats

    @cached_property
    def _reach(self) -> Floats:
        middle = self.corners.mean(axis=1, keepdims=True)
        return np.asarray(np.linalg.norm(self.corners - middle, axis=2).max(axis=1))

    @cached_property
    def _centroids(self) -> "cKDTree":
        return tree(self.corners.mean(axis=1))

    @cached_property
    def _corners(self) -> "cKDTree":
        return tree(self.corners.reshape(-1, 3))

    def near(self, points: Floats, within: float | Floats) -> tuple[np.ndarray, np.ndarray]:
        """Rows of points (n, 3) and triangles (k,) that may be as near as `within` (a length, or (n,))."""
        # A point at a corner is as far from a centroid as the triangle reaches: round-off must not lose it.
        around = np.broadcast_to(within, len(points)) + 1e-9 * self._reach.max()
        row, triangle = _matches(self._centroids, points, around + self._reach.max())
        apart = np.linalg.norm(points[row] - self._centroids.data[triangle], axis=1)
        close = apart <= self._reach[triangle] + around[row]
        return row[close], triangle[close]

    def nearest(self, points: Floats, slack: float) -> tuple[Floats, np.ndarray, np.ndarray]:
        """Nearest points (n, 3); rows and triangles (k,) that are as near but for a slack."""
        result, before = [(np.empty((0, 3)), np.empty(0, int), np.empty(0, int))], 0
        for block in self._blocks(points):
            row, triangle = self.near(block, self._corners.query(block)[0] + slack)
            feet = nearest_on_triangles(block[row], self.corners[triangle])
            apart = np.linalg.norm(feet - block[row], axis=1)
            order = np.lexsort([apart, row])
            best = order[np.unique(row[order], return_index=True)[1]]
            sharing = apart <= apart[best][row] + slack
            result.append((feet[best], before + row[sharing], triangle[sharing]))
            before += len(block)
        feet, row, triangle = (np.concatenate(column) for column in zip(*result, strict=True))
        return feet, row, triangle

    def _blocks(self, points: Floats) -> Iterator[Floats]:
        reach = self._corners.query(points)[0] + self._reach.max()
        pairs = int(self._centroids.query_ball_point(points, reach, return_length=True).sum())
        return (block for block in np.array_split(points, 1 + pairs // 1_000_000) if len(block))


def tree(points: Floats) -> "cKDTree":
    """The spatial index of points (n, d)."""
    from scipy.spatial import cKDTree  # which takes time to import

    return cKDTree(points)


def _matches(index: "cKDTree", points: Floats, within: Floats) -> tuple[np.ndarray, np.ndarray]:
    result = index.query_ball_point(points, within)
    counts = np.fromiter(map(len, result), int, len(result))
    indices = np.fromiter(chain.from_iterable(result), int, counts.sum())
    return np.repeat(np.arange(len(points)), counts), indices


def nearest_on_triangles(x: Floats, corners: Floats) -> Floats:
    """The nearest points (..., 3) of triangles (..., 3, 3) to points (..., 3)."""
    shape = np.broadcast_shapes(x.shape[:-1], corners.shape[:-2])
    if (corners == corners[..., :1, :]).all():  # points, of spheres
        return np.broadcast_to(corners[..., 0, :], (*shape, 3)).copy()
    from trimesh.triangles import closest_point  # which takes time to import

    points, triangles = np.broadcast_to(x, (*shape, 3)), np.broadcast_to(corners, (*shape, 3, 3))
    nearest = closest_point(triangles.reshape(-1, 3, 3), points.reshape(-1, 3))
    return np.asarray(nearest.reshape(*shape, 3))


def neighbours(ends: Floats, corners: Floats) -> tuple[np.ndarray, np.ndarray]:
    """Segments (n, 2, 3) and triangles (m, 3, 3) that may meet, as pairs of numbers (k,)."""
    half = 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    # Triangles of like size are sought together: a large one would make the search for small ones wide.
    kind = np.round(np.log2(np.maximum(longest, 1e-300))).astype(int)
    pairs = []
    for item in np.unique(kind):
        mine = np.flatnonzero(kind == item)
        row, triangle = Triangles(corners[mine]).near(ends.mean(axis=1), half)
        pairs.append((row, mine[triangle]))
    row, triangle = (np.concatenate(column) for column in zip(*pairs, strict=True))
    return row, triangle

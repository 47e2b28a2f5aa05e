"""Distances from many triangles, quickly for very many points: from the nearest vertex and the triangles around it."""

from __future__ import annotations

import numpy as np

from incipient.arrays import Floats
from incipient.geometry.space.nearest import nearest_on_triangles
from incipient.geometry.space.surfaces import Surface

CLOSE = 2.0  # spacings of the triangles: farther away the nearest vertex alone tells the distance


class NearestOf:
    """Which of some points (m, 3) is nearest."""

    def __init__(self, points: Floats):
        from scipy.spatial import cKDTree  # which takes time to import

        self.tree = cKDTree(points)

    def __call__(self, x: Floats) -> tuple[Floats, np.ndarray]:
        """The distances (n,) of points (n, 3) from the nearest one, and its numbers (n,)."""
        distance, number = self.tree.query(x)
        return distance, number

    def distances(self, x: Floats, count: int) -> Floats:
        """The distances (count, n) of points (n, 3) from the `count` nearest ones, infinite where there are fewer."""
        return np.asarray(self.tree.query(x, [*range(1, 1 + count)])[0].T)

    def most_within(self, reach: float) -> int:
        """How many of the points lie within a distance of any one of them, itself included; at least 1."""
        if not self.tree.n:
            return 1
        return int(self.tree.query_ball_point(self.tree.data, reach, return_length=True).max())


class Cloud:
    """Triangles whose distance from points is told: that of the triangles around the nearest of their points."""

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
        distance[near] = np.minimum(distance[near], np.linalg.norm(feet - x[near, None], axis=2).min(axis=1))
        return distance

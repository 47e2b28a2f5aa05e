"""The edges of triangles, and what lies beside them."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from incipient.arrays import Floats
from incipient.geometry.space.surfaces import sides


class Topology:
    """Edges (k, 2) of triangles (m, 3), each once, its lower point first.

    of_sides (m, 3): the edge from each corner of a triangle to its next one.
    """

    def __init__(self, triangles: np.ndarray):
        self.triangles = triangles
        directed = np.sort(sides(triangles), axis=1)
        width = int(triangles.max(initial=0)) + 1
        keys, inverse = np.unique(
            directed[:, 0].astype(np.int64) * width + directed[:, 1], return_inverse=True
        )
        self.edges = np.column_stack([keys // width, keys % width])
        self.of_sides = inverse.reshape(3, -1).T
        self._keys, self._width = keys, width

    def number(self, pairs: np.ndarray) -> np.ndarray:
        """Which edge joins each of the pairs (n, 2) of points, -1 if none does."""
        low, high = pairs.min(axis=1), pairs.max(axis=1)
        key = low.astype(np.int64) * self._width + high
        place = np.minimum(np.searchsorted(self._keys, key), len(self._keys) - 1)
        return np.where((self._keys[place] == key) & (high < self._width), place, -1)

    @cached_property
    def beside(self) -> np.ndarray:
        """The two triangles (k, 2) at each edge; the second is -1 on the surface's own edge."""
        flat = self.of_sides.T.ravel()
        triangle = np.tile(np.arange(len(self.triangles)), 3)
        order = np.argsort(flat, kind="stable")
        first = np.searchsorted(flat[order], np.arange(len(self.edges)))
        count = np.bincount(flat, minlength=len(self.edges))
        second = np.where(count > 1, triangle[order[np.minimum(first + 1, len(order) - 1)]], -1)
        return np.column_stack([triangle[order[first]], second])

    @cached_property
    def open(self) -> np.ndarray:
        """Whether each edge has a triangle on one side only, (k,)."""
        return np.asarray(self.beside[:, 1] < 0)

    @cached_property
    def opposite(self) -> np.ndarray:
        """The corners (k, 2) of the triangles beside each edge that are not on it; -1 where there is no triangle."""
        sums = self.triangles.sum(axis=1)
        return np.where(self.beside >= 0, sums[self.beside] - self.edges.sum(axis=1)[:, None], -1)


def lowest_around(values: Floats, edges: np.ndarray, count: int) -> Floats:
    """The least (count,) of the values (k,) of the edges at each point."""
    least = np.full(count, np.inf)
    for end in (0, 1):
        np.minimum.at(least, edges[:, end], values)
    return least

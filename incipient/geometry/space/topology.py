"""The edges of triangles, and their neighbours."""

from functools import cached_property

import numpy as np

from incipient.arrays import Floats


class Topology:
    """Edges (k, 2) of triangles (m, 3), each once, its lower point first.

    of_sides (m, 3): the edge from each corner of a triangle to its next one.
    """

    def __init__(self, triangles: np.ndarray):
        self.triangles = triangles
        following = triangles[:, [1, 2, 0]]
        width = int(triangles.max(initial=0)) + 1
        low, high = np.minimum(triangles, following), np.maximum(triangles, following)
        keys = (low.astype(np.int64) * width + high).T.ravel()
        order = np.argsort(keys, kind="stable")
        keys = keys[order]
        new = np.concatenate([[True], keys[1:] != keys[:-1]])[: len(keys)]
        inverse = np.empty(len(keys), dtype=np.int64)
        inverse[order] = np.cumsum(new) - 1
        self._keys, self._width, self._order, self._first = (
            keys[new],
            width,
            order,
            np.flatnonzero(new),
        )
        self.edges = np.column_stack([self._keys // width, self._keys % width])
        self.of_sides = inverse.reshape(3, -1).T

    def number(self, pairs: np.ndarray) -> np.ndarray:
        """Which edge joins each of the pairs (n, 2) of points, -1 if none does."""
        low, high = pairs.min(axis=1), pairs.max(axis=1)
        key = low.astype(np.int64) * self._width + high
        place = np.minimum(np.searchsorted(self._keys, key), len(self._keys) - 1)
        return np.where((self._keys[place] == key) & (high < self._width), place, -1)

    @cached_property
    def beside(self) -> np.ndarray:
        """The two triangles (k, 2) at each edge; the second is -1 on the surface's own edge."""
        triangle = self._order % max(len(self.triangles), 1)
        last = np.concatenate([self._first[1:], [len(triangle)]])[: len(self._first)]
        following = np.minimum(self._first + 1, len(triangle) - 1)
        second = np.where(last - self._first > 1, triangle[following], -1)
        return np.column_stack([triangle[self._first], second])

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


def summed(of: np.ndarray, values: Floats, count: int) -> Floats:
    """The sums (count,) or (count, d) of values (k,) or (k, d), each added to its own in their order."""
    if values.ndim == 1:
        return np.asarray(np.bincount(of, values, count), dtype=np.float64)
    return np.column_stack([np.bincount(of, column, count) for column in values.T])

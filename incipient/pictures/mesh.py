"""Quadratic triangles (VTK's node order) prepared for drawing: straight triangles and boundary curves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

_EDGES = ((0, 1, 3), (1, 2, 4), (2, 0, 5))  # start, end, mid-side node
QUARTERS = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))  # straight triangles of a quadratic one


@dataclass(frozen=True)
class QuadraticMesh:
    """Points (nodes, 2) and cells (cells, 6) of a plane mesh."""

    points: np.ndarray
    cells: np.ndarray

    @cached_property
    def quarters(self) -> np.ndarray:
        """(4 cells, 3) linear triangles on the nodes themselves."""
        return self.cells[:, QUARTERS].reshape(-1, 3)

    @cached_property
    def loops(self) -> list[np.ndarray]:
        """Closed boundary curves as edges (n, 3): start, end, mid-side node; fluid on the left, the outer one first."""
        loops = chained(self._boundary())
        return sorted(loops, key=lambda edges: -enclosed_area(self.points, edges))

    def _boundary(self) -> np.ndarray:
        """(edges, 3) of the edges that belong to one cell, directed with the fluid on the left."""
        corners = self.points[self.cells[:, :3]]
        (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
        clockwise = ax * by - ay * bx < 0
        edges = self.cells[:, _EDGES]
        edges[clockwise] = edges[clockwise][:, :, [1, 0, 2]]
        edges = edges.reshape(-1, 3)
        _, first, count = np.unique(edges[:, 2], return_index=True, return_counts=True)
        return edges[first[count == 1]]


def chained(edges: np.ndarray) -> list[np.ndarray]:
    """Directed edges (n, 3) put in order, one array per closed curve."""
    following = {start: i for i, start in enumerate(edges[:, 0])}
    left, loops = set(range(len(edges))), []
    while left:
        index, loop = min(left), []
        while index in left:
            left.discard(index)
            loop.append(index)
            index = following.get(edges[index, 1], -1)
        loops.append(edges[loop])
    return loops


def directed(edges: np.ndarray) -> np.ndarray:
    """Edges (n, 3) of one curve, closed or with two ends, each turned to start where the one before ends, in order."""
    at: dict[int, list[int]] = {}
    for i, (start, end, _) in enumerate(edges):
        at.setdefault(start, []).append(i)
        at.setdefault(end, []).append(i)
    node = next((end for end, beside in at.items() if len(beside) == 1), edges[0, 0])
    index, ordered, used = at[node][0], [], set()
    while index >= 0:
        used.add(index)
        start, end, middle = edges[index]
        ordered.append((start, end, middle) if start == node else (end, start, middle))
        node = ordered[-1][1]
        index = next((i for i in at[node] if i not in used), -1)
    return np.array(ordered)


def curve(points: np.ndarray, edges: np.ndarray, parts: int = 6) -> np.ndarray:
    """(n parts, 2) points along successive quadratic edges, without the last edge's end."""
    s = np.arange(parts)[:, None] / parts
    start, end, middle = (points[edges[:, i]][:, None] for i in range(3))
    along = (1 - s) * (1 - 2 * s) * start + s * (2 * s - 1) * end + 4 * s * (1 - s) * middle
    return along.reshape(-1, 2)


def enclosed_area(points: np.ndarray, edges: np.ndarray) -> float:
    """Area inside a closed curve of edges, negative if it runs clockwise."""
    x, y = curve(points, edges, 2).T
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2)

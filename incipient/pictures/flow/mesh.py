"""Quadratic triangles (VTK's node order) made ready for drawing: subdivision, boundary, values at points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from matplotlib.tri import Triangulation

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

    def within(self, view: tuple[float, float, float, float]) -> QuadraticMesh:
        """The cells that touch a rectangle (left, right, bottom, top); the points stay."""
        x0, x1, y0, y1 = view
        low, high = self.points[self.cells].min(axis=1), self.points[self.cells].max(axis=1)
        seen = (low[:, 0] <= x1) & (high[:, 0] >= x0) & (low[:, 1] <= y1) & (high[:, 1] >= y0)
        return QuadraticMesh(self.points, self.cells[seen])

    def subdivided(
        self, values: np.ndarray, parts: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points (n, 2), linear triangles (m, 3) and values (n,), each cell's side cut into `parts`."""
        barycentric, triangles = _lattice(parts)
        shapes = _shape_functions(barycentric)
        points = (shapes @ self.points[self.cells]).reshape(-1, 2)
        offsets = len(barycentric) * np.arange(len(self.cells))
        connected = (offsets[:, None, None] + triangles).reshape(-1, 3)
        return points, connected, (values[self.cells] @ shapes.T).ravel()

    def evaluated(self, values: np.ndarray, points: np.ndarray) -> np.ndarray:
        """(n,) nodal values as a quadratic field at points (n, 2); nan outside the mesh."""
        quarter = triangles_of(self.points, self.quarters).get_trifinder()(*points.T)
        found = np.full(len(points), np.nan)
        inside = quarter >= 0
        cells = self.cells[quarter[inside] // 4]
        places = _reference_places(self.points[cells], points[inside])
        found[inside] = np.sum(_shape_functions(places) * values[cells], axis=1)
        return found

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


def triangles_of(points: np.ndarray, triangles: np.ndarray) -> Triangulation:
    """matplotlib's triangulation of points (n, 2) and linear triangles (m, 3)."""
    return Triangulation(points[:, 0], points[:, 1], triangles)


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


def _lattice(parts: int) -> tuple[np.ndarray, np.ndarray]:
    """Barycentric points (n, 3) of a triangle whose sides are cut into `parts`, and its triangles (m, 3)."""
    index: dict[tuple[int, int], int] = {}
    points: list[tuple[int, int, int]] = []
    for i in range(parts + 1):
        for j in range(parts + 1 - i):
            index[i, j] = len(points)
            points.append((parts - i - j, i, j))
    upright = [(index[i, j], index[i + 1, j], index[i, j + 1]) for i, j in index if i + j < parts]
    inner = [(i, j) for i, j in index if i + j < parts - 1]
    inverted = [(index[i + 1, j], index[i + 1, j + 1], index[i, j + 1]) for i, j in inner]
    return np.array(points) / parts, np.array(upright + inverted)


def _shape_functions(barycentric: np.ndarray) -> np.ndarray:
    """(n, 6) quadratic Lagrange shape functions at barycentric points (n, 3)."""
    a, b, c = barycentric.T
    corners = a * (2 * a - 1), b * (2 * b - 1), c * (2 * c - 1)
    return np.column_stack([*corners, 4 * a * b, 4 * b * c, 4 * c * a])


def _reference_places(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n, 3) barycentric places of points (n, 2) in quadratic cells of nodes (n, 6, 2); Newton's method."""
    places = np.full((len(points), 3), 1 / 3)
    for _ in range(8):
        missing = points - np.einsum("ni,nid->nd", _shape_functions(places), corners)
        a, b, c = places.T
        none = np.zeros_like(a)
        by_b = np.column_stack([1 - 4 * a, 4 * b - 1, none, 4 * (a - b), 4 * c, -4 * c])
        by_c = np.column_stack([1 - 4 * a, none, 4 * c - 1, -4 * b, 4 * b, 4 * (a - c)])
        jacobian = np.stack([np.einsum("ni,nid->nd", by, corners) for by in (by_b, by_c)], axis=-1)
        step = np.linalg.solve(jacobian, missing[:, :, None])[:, :, 0]
        places += np.column_stack([-step.sum(axis=1), step])
    return places

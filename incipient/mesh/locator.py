"""Where points lie in the cells of a mesh, and functions' values there. Nothing here is collective.

The search is by whole arrays: pairs of points and cells whose bounding balls hold them come from a tree of the
points, the straight simplex on each cell's vertices rules most of them out, and curved cells are pulled back by
Newton's method. Reference coordinates alone decide, so that a neighbour is never taken for the right cell.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import compat
from ..arrays import Floats, Integers
from .cells import shape_functions, with_first

# Barycentric coordinates down to this count as inside.
INSIDE = -1e-9
# Points, and pairs of points and cells, dealt with at a time, which limits the memory taken.
POINTS, PAIRS = 50_000, 20_000
# Cells looked at to find the nearest one, by the distance of their middles, and of these pulled back to.
NEAR, NEAREST = 64, 8
NEWTON_STEPS = 30


@dataclass(frozen=True)
class Places:
    """Cells of one rank that hold points, or are nearest to them.

    cells:      (n,) local numbers, -1 where there is none
    reference:  (n, gdim) coordinates in the reference cell, outside of it where the cell does not hold the point
    distances:  (n,) from the cell: zero inside, infinite where there is no cell; never too small, and where an
                edge of the cell is nearest, not a face or vertex, somewhat too large in skew cells
    remoteness: (n,) by which cells compare: the distance, and a little for lying far out by the cell's own measure
    """

    cells: Integers
    reference: Floats
    distances: Floats
    remoteness: Floats

    @property
    def found(self) -> NDArray[np.bool_]:
        """(n,) whether there is a cell."""
        return self.cells >= 0

    def at(self, rows: Any) -> Places:
        """The places of some of the points."""
        return Places(
            self.cells[rows], self.reference[rows], self.distances[rows], self.remoteness[rows]
        )

    def within(self, reach: float) -> Places:
        """The places, those farther out of their cells in barycentric coordinates moved to near points of these."""
        coordinates = with_first(self.reference)
        far = coordinates.min(axis=1) < -reach
        return replace(
            self, reference=np.where(far[:, None], _clipped(coordinates)[:, 1:], self.reference)
        )

    @classmethod
    def joined(cls, parts: list[Places]) -> Places:
        """The places of several sets of points, one after the other."""
        fields = ("cells", "reference", "distances", "remoteness")
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in fields))


class Locator:
    """Finds points in the cells that this rank owns, simplices of any order, where the mesh is now."""

    def __init__(self, mesh: Any):
        self.gdim = int(mesh.geometry.dim)
        owned = mesh.topology.index_map(mesh.topology.dim).size_local
        self._nodes: Floats = mesh.geometry.x[compat.geometry_dofs(mesh)[:owned], : self.gdim]
        self._element = shape_functions(mesh)
        hull = np.einsum("bn,cng->cbg", _to_bernstein(self._element), self._nodes)
        vertices = self._nodes[:, : self.gdim + 1]
        self._origins = vertices[:, 0]
        self._inverses = _inverses((vertices[:, 1:] - vertices[:, :1]).transpose(0, 2, 1))
        self._middles = vertices.mean(axis=1)
        self._radii = np.linalg.norm(hull - self._middles[:, None], axis=2).max(axis=1)
        slopes = np.concatenate(
            [-self._inverses.sum(axis=1, keepdims=True), self._inverses], axis=1
        )
        products = slopes @ slopes.transpose(0, 2, 1)
        # How barycentric coordinates change on the way straight to the face where one of them vanishes.
        self._ways = products / np.einsum("cii->ci", products)[..., None]
        # A cell lies in the hull of its Bernstein points: no point of it has smaller coordinates.
        each = np.arange(len(hull))[:, None]
        self._least = np.minimum(self._straight(hull, each).min(axis=1), 0.0) + 10 * INSIDE
        self.box = _box(hull.reshape(-1, self.gdim))

    def inside(self, points: Floats) -> Places:
        """A cell that holds each of the points (n, at least gdim); none where no cell does."""
        points = np.asarray(points, dtype=float)[:, : self.gdim]
        parts = [points[k : k + POINTS] for k in range(0, len(points), POINTS)]
        return Places.joined([_nowhere(0, self.gdim), *(self._inside(part) for part in parts)])

    def nearest(self, points: Floats) -> Places:
        """The cell nearest to each of the points (n, at least gdim); none only where this rank has no cells.

        The points are thought to lie outside of all cells. The nearest is sought among the `NEAR` cells whose
        middles are. Where the cell's map has no inverse at the point, the place is a near point of the cell.
        """
        points = np.asarray(points, dtype=float)[:, : self.gdim]
        if not len(self._nodes):
            return _nowhere(len(points), self.gdim)
        parts = [points[k : k + POINTS // NEAR] for k in range(0, len(points), POINTS // NEAR)]
        return Places.joined([_nowhere(0, self.gdim), *(self._nearest(part) for part in parts)])

    def _inside(self, points: Floats) -> Places:
        places = _nowhere(len(points), self.gdim)
        rows, cells = self._pairs(points)
        coordinates = self._straight(points[rows], cells)
        kept = (coordinates >= self._least[cells]).all(axis=1)
        rows, cells = rows[kept], cells[kept]
        reference, good = self._pulled_back(points[rows], cells, coordinates[kept, 1:])
        depths = np.where(good, with_first(reference).min(axis=1), -np.inf)
        # In ascending order of depth, so that the deepest is written last.
        order = np.argsort(depths, kind="stable")
        order = order[depths[order] >= INSIDE]
        places.cells[rows[order]], places.reference[rows[order]] = cells[order], reference[order]
        places.distances[rows[order]] = places.remoteness[rows[order]] = 0.0
        return places

    def _pairs(self, points: Floats) -> tuple[Integers, Integers]:
        """Numbers of points and of cells whose bounding balls hold them."""
        if not len(points):
            return np.empty(0, np.int64), np.empty(0, np.int64)
        low, high = _box(points)
        reach = self._radii[:, None] * (1 - 10 * INSIDE)
        near = np.flatnonzero(
            ((self._middles + reach >= low) & (self._middles - reach <= high)).all(axis=1)
        )
        held = _tree(points).query_ball_point(
            self._middles[near], reach[near, 0], return_sorted=False
        )
        counts = np.fromiter(map(len, held), np.int64, len(near))
        rows = np.fromiter(chain.from_iterable(held), np.int64, int(counts.sum()))
        return rows, np.repeat(near, counts)

    @cached_property
    def _tree(self) -> Any:
        return _tree(self._middles)

    def _nearest(self, points: Floats) -> Places:
        count = min(NEAR, len(self._nodes))
        cells = self._tree.query(points, count)[1].reshape(len(points), count)
        coordinates = self._straight(points[:, None], cells)
        # A flat cell has no coordinates: it is the last to be taken.
        distances = np.nan_to_num(self._straight_distances(points, cells, coordinates), nan=np.inf)
        best = np.argsort(distances, axis=1, kind="stable")[:, :NEAREST]
        cells = np.take_along_axis(cells, best, 1)
        start = np.nan_to_num(np.take_along_axis(coordinates, best[..., None], 1)[..., 1:])
        return self._nearest_of(points, cells, start)

    def _straight_distances(self, points: Floats, cells: Integers, coordinates: Floats) -> Floats:
        vertices = self._nodes[cells, : self.gdim + 1]
        near = [
            np.einsum("pkv,pkvg->pkg", c, vertices) for c in self._near_points(coordinates, cells)
        ]
        return np.minimum(*(np.linalg.norm(x - points[:, None], axis=2) for x in near))

    def _near_points(self, coordinates: Floats, cells: Integers) -> tuple[Floats, Floats]:
        """Barycentric coordinates (..., gdim + 1) of two points of each cell, one of them near to that given.

        Towards the middle of the cell, and straight to the face that it is farthest beyond and from there so.
        """
        face = coordinates.argmin(axis=-1)[..., None]
        beyond = np.minimum(np.take_along_axis(coordinates, face, -1), 0.0)
        return _clipped(coordinates), _clipped(
            coordinates - beyond * self._ways[cells, face[..., 0]]
        )

    def _nearest_of(self, points: Floats, cells: Integers, start: Floats) -> Places:
        """The nearest of some cells (n, k), of which coordinates (n, k, gdim) in the straight ones are known."""
        shape, flat = cells.shape, cells.ravel()
        targets = np.repeat(points, shape[1], axis=0)
        start = start.reshape(-1, self.gdim)
        reference, good = self._pulled_back(targets, flat, start)
        reference = np.where(good[:, None], reference, _clipped(with_first(start))[:, 1:])
        coordinates = with_first(reference)
        near = [self.mapped(c[:, 1:], flat) for c in self._near_points(coordinates, flat)]
        distances = np.minimum(*(np.linalg.norm(x - targets, axis=1) for x in near))
        # Several cells share a vertex: take the one that is left least by its own measure.
        overshoot = np.maximum(-coordinates.min(axis=1), 0.0) * self._radii[flat]
        remoteness = (distances + 1e-6 * overshoot).reshape(shape)
        chosen = np.arange(len(points)) * shape[1] + remoteness.argmin(axis=1)
        return Places(flat, reference, distances, remoteness.ravel()).at(chosen)

    def _straight(self, points: Floats, cells: Integers) -> Floats:
        """(..., gdim + 1) barycentric coordinates in the straight simplices on the cells' vertices."""
        return with_first(
            np.einsum("...kg,...g->...k", self._inverses[cells], points - self._origins[cells])
        )

    def mapped(self, reference: Floats, cells: Integers) -> Floats:
        """(n, gdim) places in space of reference coordinates in cells."""
        table = self._element.tabulate(0, reference)[0, :, :, 0]
        return np.asarray(np.einsum("pn,png->pg", table, self._nodes[cells]))

    def _pulled_back(
        self, points: Floats, cells: Integers, start: Floats
    ) -> tuple[Floats, NDArray[np.bool_]]:
        """(n, gdim) reference coordinates of points in cells and (n,) whether they were found."""
        if self._element.degree == 1 or not len(points):
            return start, np.ones(len(points), dtype=bool)
        parts = [slice(k, k + PAIRS) for k in range(0, len(points), PAIRS)]
        reference, good = zip(
            *(self._newton(points[k], self._nodes[cells[k]], start[k]) for k in parts), strict=True
        )
        return np.concatenate(reference), np.concatenate(good)

    def _newton(
        self, points: Floats, nodes: Floats, start: Floats
    ) -> tuple[Floats, NDArray[np.bool_]]:
        reference, left = start.copy(), np.arange(len(points))
        for _ in range(NEWTON_STEPS):
            table = (
                self._element.tabulate(1, reference[left])[..., 0].transpose(1, 0, 2) @ nodes[left]
            )
            jacobians, misfit = table[:, 1:].transpose(0, 2, 1), table[:, 0] - points[left]
            steps = np.einsum("pkg,pg->pk", _inverses(jacobians), misfit)
            lengths = np.linalg.norm(steps, axis=1)
            # No step longer than the cell: far out the map may bend back.
            reference[left] -= steps / np.maximum(lengths, 1.0)[:, None]
            left = left[~(lengths < 1e-9)]
            if not len(left):
                break
        good = np.isfinite(reference).all(axis=1)
        good[left] = False
        return reference, good


def evaluate(function: Any, places: Places) -> Floats:
    """(n, components) values of a scalar or vector function at places in this rank's cells, all of them found.

    Outside of its cell the function's polynomial goes on. Ghosts must be up to date.
    """
    space = function.function_space
    block = space.dofmap.index_map_bs
    nodes = function.x.array.reshape(-1, block)[compat.cell_dofs(space)[places.cells]]
    return np.asarray(np.einsum("pn,pnb->pb", compat.tabulate(space, places.reference), nodes))


def _to_bernstein(element: Any) -> Floats:
    """(n, n) matrix from a polynomial's values at an equispaced element's nodes to its Bernstein coefficients."""
    degree, nodes = element.degree, with_first(element.points)
    exponents = np.rint(degree * nodes).astype(int)
    ways = [factorial(degree) // int(np.prod([factorial(k) for k in row])) for row in exponents]
    table = np.prod(nodes[:, None, :] ** exponents[None], axis=2) * np.array(ways)
    return np.asarray(np.linalg.inv(table))


def _inverses(matrices: Floats) -> Floats:
    """Inverses of (n, g, g) matrices; not a number where there is none."""
    singular = ~(np.abs(np.linalg.det(matrices)) > 0.0)
    inverses = np.linalg.inv(
        np.where(singular[:, None, None], np.eye(matrices.shape[-1]), matrices)
    )
    inverses[singular] = np.nan
    return np.asarray(inverses)


def _clipped(coordinates: Floats) -> Floats:
    """A near point of the simplex for points outside."""
    kept = np.maximum(coordinates, 0.0)
    return np.asarray(kept / kept.sum(axis=-1, keepdims=True))


def _box(points: Floats) -> Floats:
    """(2, g) lowest and highest coordinates; nothing is between them if there are no points."""
    return np.array([points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)])


def _nowhere(count: int, gdim: int) -> Places:
    far = np.full(count, np.inf)
    return Places(np.full(count, -1), np.zeros((count, gdim)), far, far.copy())


def _tree(points: Floats) -> Any:
    from scipy.spatial import cKDTree  # which takes time to import, and most runs sample nothing

    return cKDTree(points)

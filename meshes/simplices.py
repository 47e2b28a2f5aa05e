"""Triangles and tetrahedra as arrays, with the named parts of their boundary."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from incipient.arrays import Floats, Integers, determinants, unordered_keys

from .session import gmsh

# Ends of the edges of lines, triangles and tetrahedra in the order of gmsh's second-order nodes, by dimension
EDGES = {
    1: ((0, 1),),
    2: ((0, 1), (1, 2), (2, 0)),
    3: ((0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3)),
}
SHAPES = ("Point", "Line", "Triangle", "Tetrahedron")
LEAST = 0.1  # of a straight cell's measure: the least that the curved one's map may have anywhere


@dataclass(frozen=True, eq=False)
class Simplices:
    """Points (n, gdim), cells (m, nodes), and boundary facets (k, nodes) by name."""

    points: Floats
    cells: Integers
    sides: dict[str, Integers]
    order: int = 1

    @classmethod
    def read(cls, entities: dict[str, list[int]], dimension: int, order: int = 1) -> Simplices:
        """The cells that gmsh holds, points numbered by tag; `entities` are its boundaries by name."""
        tags, places, _ = gmsh.model.mesh.getNodes()
        points = np.full((int(tags.max()) + 1, dimension), np.nan)
        points[tags.astype(np.int64)] = np.reshape(places, (-1, 3))[:, :dimension]
        sides = {
            name: np.concatenate([elements(dimension - 1, order, tag) for tag in members])
            for name, members in entities.items()
        }
        return cls(points, elements(dimension, order), sides, order)

    def of_order(self, order: int) -> Simplices:
        if order == 1:
            return self
        count, dimension = self.points.shape
        rows = _means(self.cells, dimension, order)
        keys, first = np.unique(unordered_keys(rows, count), return_index=True)

        def with_nodes(cells: Integers, dim: int) -> Integers:
            own = unordered_keys(_means(cells, dim, order), count)
            return np.column_stack(
                [cells, count + np.searchsorted(keys, own).reshape(len(cells), -1)]
            )

        sides = {name: with_nodes(part, dimension - 1) for name, part in self.sides.items()}
        points = np.vstack([self.points, self.points[rows[first]].mean(axis=1)])
        return Simplices(points, with_nodes(self.cells, dimension), sides, order)

    def used(self) -> Simplices:
        kept, cells = np.unique(self.cells, return_inverse=True)
        sides = {name: np.searchsorted(kept, part) for name, part in self.sides.items()}
        return replace(
            self, points=self.points[kept], cells=cells.reshape(self.cells.shape), sides=sides
        )

    def curved(
        self,
        middles: Integers,
        places: Floats,
        free: np.ndarray | None = None,
        feet: Integers | None = None,
        share: Floats | None = None,
    ) -> tuple[Simplices, Integers]:
        """The second-order cells with middles (k,) of edges moved, less where cells would fold, and which are.

        Free nodes move along. Where cells still fold edges are straight; in layers they are bent less.

        free: (n, gdim) which coordinates of nodes may change; None: none
        feet, share: (n,) the wall's point below each corner in layers (-1: none), and the fraction of the wall's bend
            that edges follow; None: no layers
        """
        points, cells, pairs = self.points.copy(), self.cells, EDGES[self.points.shape[1]]
        of_edges = cells[:, -len(pairs) :]
        ends = np.zeros((len(points), 2), dtype=np.int64)
        ends[of_edges] = cells[:, pairs]
        every = np.unique(of_edges)
        points[every] = points[ends[every]].mean(axis=1)
        between, bends, leads = points.copy(), np.zeros_like(points), np.arange(len(points))
        bends[middles] = places - between[middles]
        if feet is not None and share is not None:
            keys = unordered_keys(np.maximum(feet[ends], 0), len(points))
            follows = (share[ends].mean(axis=1) > 0.0) & (feet[ends] >= 0).all(axis=1)
            follows[middles] = False
            order = np.argsort(keys[middles])
            known = keys[middles][order]
            chosen = every[follows[every] & np.isin(keys[every], known)]
            leads[chosen] = middles[order][np.searchsorted(known, keys[chosen])]
            bends[chosen] = share[ends[chosen]].mean(axis=1)[:, None] * bends[leads[chosen]]
        if free is not None:
            bends += np.where(free, _making_room(between, cells, bends), 0.0)
            others = every[~bends[every].any(axis=1)]
            bends[others] = bends[ends[others]].mean(axis=1)
        moved = bends.any(axis=1)
        less, scale, changed = 0.0 if feet is None else 0.5, np.ones(len(points)), moved
        while True:
            points[changed] = (between + scale[leads, None] * bends)[changed]
            touched = cells[changed[cells].any(axis=1)]
            bad = touched[jacobian_lower_bound(points[touched]) < LEAST]
            led = np.unique(leads[bad[moved[bad]]])
            led = led[scale[led] > 0.0]
            if not len(led):
                return replace(self, points=points), np.flatnonzero(moved & (scale[leads] < 1.0))
            # Edges that would bend by less than a fifth become straight.
            scale[led] = np.where(scale[led] > 0.2, less * scale[led], 0.0)
            changed = moved & np.isin(leads, led)


def _making_room(points: Floats, cells: Integers, bends: Floats) -> Floats:
    folding = cells[jacobian_lower_bound((points + bends)[cells]) < LEAST]
    count = bends[folding].any(axis=2).sum(axis=1)
    means = (bends[folding].sum(axis=1) / count[:, None]).repeat(cells.shape[1], axis=0)
    of = folding.ravel()
    sums = np.column_stack([np.bincount(of, column, len(points)) for column in means.T])
    return np.asarray(sums / np.bincount(of, minlength=len(points)).clip(1)[:, None])


def measures(points: Floats, cells: Integers) -> Floats:
    """Doubled areas or six-fold volumes (m,) of straight cells (m, gdim + 1), negative if inside out."""
    corners = points[cells]
    return determinants((corners[:, 1:] - corners[:, :1]).transpose(1, 2, 0))


def jacobian_lower_bound(nodes: Floats) -> Floats:
    """Lower bound (m,) of the determinants of second-order cells (m, nodes, gdim) over the straight ones'.

    The determinant is a polynomial of order gdim: its least Bernstein coefficient is below it.
    """
    dimension = nodes.shape[2]
    powers = np.array(
        [
            row
            for row in product(range(dimension + 1), repeat=dimension + 1)
            if sum(row) == dimension
        ]
    )
    lattice = powers / dimension
    by = np.zeros(
        (len(lattice), nodes.shape[1], dimension + 1)
    )  # derivatives by barycentric coordinates
    for i in range(dimension + 1):
        by[:, i, i] = 4.0 * lattice[:, i] - 1.0
    for k, (a, b) in enumerate(EDGES[dimension], start=dimension + 1):
        by[:, k, a], by[:, k, b] = 4.0 * lattice[:, b], 4.0 * lattice[:, a]
    slopes = (by[:, :, 1:] - by[:, :, :1]).transpose(0, 2, 1).reshape(-1, nodes.shape[1])
    # Components first, cells last: one product of matrices, and determinants of whole rows of numbers.
    rates = slopes @ nodes.transpose(1, 2, 0).reshape(nodes.shape[1], -1)
    rates = rates.reshape(len(lattice), dimension, dimension, -1).transpose(1, 2, 0, 3)
    straight = determinants((nodes[:, 1 : dimension + 1] - nodes[:, :1]).transpose(1, 2, 0))
    factorials = np.array([1.0, 1.0, 2.0, 6.0])
    bernstein = (lattice[:, None] ** powers[None]).prod(axis=2)
    bernstein *= factorials[dimension] / factorials[powers].prod(axis=1)
    return np.asarray((np.linalg.inv(bernstein) @ (determinants(rates) / straight)).min(axis=0))


def _nodes(dimension: int, order: int) -> list[tuple[int, ...]]:
    """The corners of which each of gmsh's nodes behind a cell's corners is the mean."""
    steps = range(1, order)
    along = [(a,) * (order - k) + (b,) * k for a, b in EDGES[dimension] for k in steps]
    return [*along, (0, 1, 2)] if (dimension, order) == (2, 3) else along


def _means(cells: Integers, dimension: int, order: int) -> Integers:
    return np.asarray(cells[:, np.array(_nodes(dimension, order))].reshape(-1, order))


def kind_of(dimension: int, order: int) -> int:
    """gmsh's number of a kind of cells."""
    return int(gmsh.model.mesh.getElementType(SHAPES[dimension], order))


def elements(dimension: int, order: int, entity: int = -1) -> Integers:
    """Tags of the nodes (m, nodes) of gmsh's cells, of all entities or of one."""
    nodes = gmsh.model.mesh.getElementsByType(kind_of(dimension, order), entity)[1]
    return np.asarray(
        nodes.astype(np.int64).reshape(-1, dimension + 1 + len(_nodes(dimension, order)))
    )

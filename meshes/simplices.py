"""Triangles and tetrahedra as arrays, with the named parts of their boundary: read from gmsh, curved, put back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from incipient.arrays import Floats, Integers, determinants, unordered_keys

from .session import gmsh

# In cells of order two gmsh has the corners first, then the middles of these edges.
EDGES = {2: ((0, 1), (1, 2), (2, 0)), 3: ((0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3))}
# gmsh's kinds of edges, triangles and tetrahedra by dimension and order, and the number of their nodes
KINDS = {(1, 1): 1, (1, 2): 8, (1, 3): 26, (2, 1): 2, (2, 2): 9, (2, 3): 21, (3, 1): 4, (3, 2): 11}
NODES = {1: 2, 8: 3, 26: 4, 2: 3, 9: 6, 21: 10, 4: 4, 11: 10}
LESS, LEAST_BEND = (
    0.5,
    0.2,
)  # factor of bends where cells fold; fraction below which edges are straight
LEAST = 0.1  # of a straight cell's measure: the least that the curved one's map may have anywhere


@dataclass(frozen=True, eq=False)
class Simplices:
    """Points (n, gdim), cells (m, nodes) of them, and of the boundary facets (k, nodes) by the name of the part."""

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
        """These straight cells of order one, or of order two with points in the middle of their edges."""
        if order == 1:
            return self
        count, dimension = self.points.shape
        pairs = np.concatenate([self.cells[:, pair] for pair in EDGES[dimension]])
        keys, inverse = np.unique(unordered_keys(pairs, count), return_inverse=True)
        middles = 0.5 * (self.points[keys // count] + self.points[keys % count])
        cells = np.column_stack([self.cells, count + inverse.reshape(-1, len(self.cells)).T])
        of_side = EDGES[2][: 1 if dimension == 2 else 3]
        sides = {
            name: np.column_stack(
                [part]
                + [
                    count + np.searchsorted(keys, unordered_keys(part[:, pair], count))
                    for pair in of_side
                ]
            )
            for name, part in self.sides.items()
        }
        return Simplices(np.vstack([self.points, middles]), cells, sides, 2)

    def used(self) -> Simplices:
        """These cells without points of no cell."""
        kept, cells = np.unique(self.cells, return_inverse=True)
        sides = {name: np.searchsorted(kept, part) for name, part in self.sides.items()}
        return replace(
            self, points=self.points[kept], cells=cells.reshape(self.cells.shape), sides=sides
        )

    def put(self) -> None:
        """Make the current gmsh model, which is empty, one of these cells, with the parts named."""
        model, numbers, dimension = (
            gmsh.model,
            np.arange(1, len(self.points) + 1),
            self.points.shape[1],
        )
        entities = {name: model.addDiscreteEntity(dimension - 1) for name in self.sides}
        fluid = model.addDiscreteEntity(dimension, -1, list(entities.values()))
        places = np.zeros((len(self.points), 3))
        places[:, :dimension] = self.points
        model.mesh.addNodes(dimension, fluid, numbers, places.ravel())
        kind, of_sides = KINDS[dimension, self.order], KINDS[dimension - 1, self.order]
        model.mesh.addElementsByType(fluid, kind, [], (self.cells + 1).ravel())
        model.addPhysicalGroup(dimension, [fluid], 1)
        model.setPhysicalName(dimension, 1, "fluid")
        for tag, (name, entity) in enumerate(entities.items(), start=1):
            model.mesh.addElementsByType(entity, of_sides, [], (self.sides[name] + 1).ravel())
            model.addPhysicalGroup(dimension - 1, [entity], tag)
            model.setPhysicalName(dimension - 1, tag, name)

    def curved(
        self,
        middles: Integers,
        places: Floats,
        feet: Integers | None = None,
        share: Floats | None = None,
    ) -> tuple[Simplices, int]:
        """These cells of order two with middles (k,) of edges moved, and how many edges stay straight.

        Where cells would fold over, edges are straight; in layers they are bent less, step by step.

        feet, share: (n,) the wall's point below each corner in layers (-1: none), and by how much of their bend the
            edges follow the wall's; None: there are no layers
        """
        points, cells, pairs = self.points.copy(), self.cells, EDGES[self.points.shape[1]]
        of_edges = cells[:, -len(pairs) :]
        ends = np.zeros((len(points), 2), dtype=np.int64)
        ends[of_edges] = cells[:, pairs]
        every = np.unique(of_edges)
        points[every] = points[ends[every]].mean(axis=1)
        between, bends, leads = points.copy(), np.zeros_like(points), np.arange(len(points))
        moved = np.zeros(len(points), dtype=bool)
        moved[middles], bends[middles] = True, places - between[middles]
        if feet is not None and share is not None:
            keys = unordered_keys(np.maximum(feet[ends], 0), len(points))
            follows = (share[ends].mean(axis=1) > 0.0) & (feet[ends] >= 0).all(axis=1)
            follows[middles] = False
            order = np.argsort(keys[middles])
            known = keys[middles][order]
            chosen = every[follows[every] & np.isin(keys[every], known)]
            leads[chosen] = middles[order][np.searchsorted(known, keys[chosen])]
            bends[chosen] = share[ends[chosen]].mean(axis=1)[:, None] * bends[leads[chosen]]
            moved[chosen] = True
        less, scale, changed = 0.0 if feet is None else LESS, np.ones(len(points)), moved
        while True:
            points[changed] = (between + scale[leads, None] * bends)[changed]
            touched = cells[changed[of_edges].any(axis=1)]
            bad = touched[jacobian_lower_bound(points[touched]) < LEAST][:, -len(pairs) :]
            led = np.unique(leads[bad[moved[bad]]])
            led = led[scale[led] > 0.0]
            if not len(led):
                return replace(self, points=points), int((scale[leads[moved]] == 0.0).sum())
            scale[led] = np.where(scale[led] > LEAST_BEND, less * scale[led], 0.0)
            changed = moved & np.isin(leads, led)


def measures(points: Floats, cells: Integers) -> Floats:
    """Doubled areas, or six-fold volumes (m,) of straight cells (m, gdim + 1), negative where they are inside out."""
    corners = points[cells]
    return determinants((corners[:, 1:] - corners[:, :1]).transpose(1, 2, 0))


def jacobian_lower_bound(nodes: Floats) -> Floats:
    """A lower bound (m,) of the determinants of cells of order two (m, nodes, gdim), in units of the straight ones'.

    The determinant is a polynomial of order gdim: the least of its control points in Bernstein's form is below it.
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


def elements(dimension: int, order: int, entity: int = -1) -> Integers:
    """Tags of the nodes (m, nodes) of gmsh's cells of a dimension and order, of all entities or of one."""
    kind = KINDS[dimension, order]
    nodes = gmsh.model.mesh.getElementsByType(kind, entity)[1].astype(np.int64)
    return np.asarray(nodes.reshape(-1, NODES[kind]))

"""Triangles as arrays, with the named edges of their boundary: raised to order two, put into gmsh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from incipient.arrays import Floats, Integers, planar_cross
from incipient.errors import MeshError
from incipient.interrupt import handlers_kept

from .model import name_parts

with handlers_kept():  # at its import gmsh takes interrupts for itself
    import gmsh

SIDES = (
    (0, 1),
    (1, 2),
    (2, 0),
)  # whose middles follow the corners of gmsh's triangles of order two
KINDS = {
    (1, 1): 1,
    (1, 2): 8,
    (2, 1): 2,
    (2, 2): 9,
}  # gmsh's kinds of edges and triangles, by dimension and order
LEAST = 0.1  # of a straight cell's area: the least that the curved one's map may have at its nodes
# Derivatives of the six shape functions by both coordinates, at the six nodes, by which the map is judged.
_AT = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])


@dataclass(frozen=True, eq=False)
class Triangles:
    """Points (n, 2), triangles (m, 3 or 6) of them, and of the boundary edges (k, 2 or 3) by the name of the part."""

    points: Floats
    cells: Integers
    sides: dict[str, Integers]

    def curved(self, edges: Integers, shifts: Floats) -> Triangles:
        """These straight cells of order two: the middles of some edges (k, 2) are shifted (k, 2), but where cells fold.

        Raises:
            MeshError: cells fold all the same.
        """
        count = len(self.points)
        keys, inverse = np.unique(
            np.concatenate([_keys(self.cells[:, pair], count) for pair in SIDES]),
            return_inverse=True,
        )
        straight = 0.5 * (self.points[keys // count] + self.points[keys % count])
        cells = np.column_stack([self.cells, count + inverse.reshape(3, -1).T])
        asked, wanted = _keys(edges, count), np.zeros_like(straight)
        there = np.isin(asked, keys)
        wanted[np.searchsorted(keys, asked[there])] = shifts[there]
        for _ in range(len(SIDES) + 1):
            points = np.concatenate([self.points, straight + wanted])
            folded = cells[least_stretch(points[cells]) < LEAST][:, 3:] - count
            if not wanted[folded].any():
                break
            wanted[folded] = 0.0
        if len(folded):
            raise MeshError("cells fold over: use another numerics.mesh_size")
        sides = {
            name: np.column_stack([part, count + np.searchsorted(keys, _keys(part, count))])
            for name, part in self.sides.items()
        }
        return Triangles(points, cells, sides)

    def used(self) -> Triangles:
        """These cells without points of no cell."""
        kept, cells = np.unique(self.cells, return_inverse=True)
        sides = {name: np.searchsorted(kept, part) for name, part in self.sides.items()}
        return Triangles(self.points[kept], cells.reshape(self.cells.shape), sides)

    def put(self) -> None:
        """Make the current gmsh model, which is empty, one of these cells, with the parts named."""
        model, numbers = gmsh.model, np.arange(1, len(self.points) + 1)
        order = 1 if self.cells.shape[1] == 3 else 2
        entities = {name: model.addDiscreteEntity(1) for name in self.sides}
        surface = model.addDiscreteEntity(2, -1, list(entities.values()))
        places = np.column_stack([self.points, np.zeros(len(self.points))])
        model.mesh.addNodes(2, surface, numbers, places.ravel())
        model.mesh.addElementsByType(surface, KINDS[2, order], [], (self.cells + 1).ravel())
        for name, entity in entities.items():
            model.mesh.addElementsByType(
                entity, KINDS[1, order], [], (self.sides[name] + 1).ravel()
            )
        name_parts(2, surface, {name: [entity] for name, entity in entities.items()})


def areas(points: Floats, cells: Integers) -> Floats:
    """Doubled areas (m,) of straight triangles (m, 3), negative where they are inside out."""
    a, b, c = points[cells].transpose(1, 0, 2)
    return np.asarray(planar_cross(b - a, c - a))


def least_stretch(nodes: Floats) -> Floats:
    """The least determinant (m,) at the nodes of triangles of order two (m, 6, 2), over the straight ones'."""
    s, t = _AT.T
    zero = np.zeros_like(s)
    by_s = np.stack([4 * (s + t) - 3, 4 * s - 1, zero, 4 - 8 * s - 4 * t, 4 * t, -4 * t], axis=1)
    by_t = np.stack([4 * (s + t) - 3, zero, 4 * t - 1, -4 * s, 4 * s, 4 - 4 * s - 8 * t], axis=1)
    found = planar_cross(by_s @ nodes, by_t @ nodes)
    a, b, c = nodes[:, :3].transpose(1, 0, 2)
    return np.asarray((found / planar_cross(b - a, c - a)[:, None]).min(axis=1))


def _keys(edges: Integers, count: int) -> Integers:
    """A number (m,) for each edge (m, 2), the same from whichever end it is seen."""
    return np.asarray(edges.min(axis=1) * count + edges.max(axis=1))

"""Tetrahedra as arrays, with the named triangles of their boundary: read from gmsh, raised to order two, put back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from incipient.arrays import Floats, Integers
from incipient.interrupt import handlers_kept

from .model import name_parts

with handlers_kept():  # at its import gmsh takes interrupts for itself
    import gmsh

# In cells of order two gmsh has the corners first, then the middles of these edges; in triangles likewise.
EDGES = ((0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3))
SIDES = ((0, 1), (1, 2), (2, 0))
KINDS = {
    3: 2,
    6: 9,
    4: 4,
    10: 11,
}  # gmsh's kinds of triangles and tetrahedra by the number of their nodes


@dataclass(frozen=True, eq=False)
class Tetrahedra:
    """Points (n, 3), cells (m, 4 or 10) of them, and of the boundary triangles (k, 3 or 6) by the name of the part."""

    points: Floats
    cells: Integers
    sides: dict[str, Integers]

    @classmethod
    def read(cls, entities: dict[str, int]) -> Tetrahedra:
        """The straight cells that gmsh holds, without points of no cell; `entities` are its surfaces by name."""
        tags, places, _ = gmsh.model.mesh.getNodes()
        table = np.empty((int(tags.max()) + 1, 3))
        table[tags.astype(np.int64)] = np.reshape(places, (-1, 3))
        cells = _of_kind(KINDS[4], 4)
        used = np.unique(cells)
        row = np.full(len(table), -1)
        row[used] = np.arange(len(used))
        sides = {name: row[_of_kind(KINDS[3], 3, entity)] for name, entity in entities.items()}
        return cls(table[used], row[cells], sides)

    def of_order(self, order: int) -> Tetrahedra:
        """These straight cells of order one, or of order two with points in the middle of their edges."""
        if order == 1:
            return self
        count = len(self.points)
        keys, inverse = np.unique(
            np.concatenate([_keys(self.cells, pair, count) for pair in EDGES]), return_inverse=True
        )
        middles = self.points[keys // count] + self.points[keys % count]
        cells = np.column_stack([self.cells, count + inverse.reshape(len(EDGES), -1).T])
        sides = {
            name: np.column_stack(
                [part, *(count + np.searchsorted(keys, _keys(part, pair, count)) for pair in SIDES)]
            )
            for name, part in self.sides.items()
        }
        return Tetrahedra(np.vstack([self.points, 0.5 * middles]), cells, sides)

    def put(self) -> None:
        """Make the current gmsh model, which is empty, one of these cells, with the parts named."""
        model, numbers = gmsh.model, np.arange(1, len(self.points) + 1)
        entities = {name: model.addDiscreteEntity(2) for name in self.sides}
        volume = model.addDiscreteEntity(3, -1, list(entities.values()))
        model.mesh.addNodes(3, volume, numbers, self.points.ravel())
        for entity, cells in (
            (volume, self.cells),
            *zip(entities.values(), self.sides.values(), strict=True),
        ):
            model.mesh.addElementsByType(entity, KINDS[cells.shape[1]], [], (cells + 1).ravel())
        name_parts(3, volume, {name: [entity] for name, entity in entities.items()})


def _of_kind(kind: int, nodes: int, entity: int = -1) -> Integers:
    """Tags of the nodes (m, nodes) of gmsh's cells of a kind, of all entities or of one."""
    return np.asarray(
        gmsh.model.mesh.getElementsByType(kind, entity)[1].astype(np.int64).reshape(-1, nodes)
    )


def _keys(cells: Integers, pair: tuple[int, int], count: int) -> Integers:
    """A number (m,) for an edge of each of the cells, the same from whichever end it is seen."""
    a, b = cells[:, pair[0]], cells[:, pair[1]]
    return np.asarray(np.minimum(a, b) * count + np.maximum(a, b))

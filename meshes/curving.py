"""The nodes of a mesh in space carried onto the exact surfaces, as far as no cell folds over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from incipient.arrays import Floats, Integers
from incipient.geometry.space.remeshing import ExactSurface
from incipient.interrupt import handlers_kept

with handlers_kept():  # at its import gmsh takes interrupts for itself
    import gmsh

# Of tetrahedra of order two gmsh has the corners first, then the middles of these edges; of triangles likewise.
EDGES = ((0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3))
SIDES = ((0, 1), (1, 2), (2, 0))
LEAST = 0.1  # of a straight cell's volume: the least that the curved one's map may have anywhere
FARTHEST = 0.3  # of its edge's length: a node that moves farther has found another part of the surface
ON_PLANE = 1e-12  # of a region's height
TRIANGLE, QUADRATIC_TRIANGLE, TETRAHEDRON, QUADRATIC_TETRAHEDRON = 2, 9, 4, 11  # gmsh's kinds of cells


@dataclass(frozen=True, eq=False)
class Nodes:
    """The nodes of the mesh that gmsh holds: their tags (n,) and places (n, 3); rows found by `row` of a tag."""

    tags: Integers
    places: Floats
    row: Integers

    @classmethod
    def read(cls) -> Nodes:
        """The nodes as they are."""
        tags, places, _ = gmsh.model.mesh.getNodes()
        tags = tags.astype(np.int64)
        row = np.full(int(tags.max()) + 1, -1)
        row[tags] = np.arange(len(tags))
        return cls(tags, np.reshape(places, (-1, 3)).copy(), row)

    def cells(self, kind: int, entity: int = -1, per_cell: int = 0) -> Integers:
        """The rows (m, nodes) of the cells of a kind, of all entities or of one."""
        _, members = gmsh.model.mesh.getElementsByType(kind, entity)
        return np.asarray(self.row[members.astype(np.int64)].reshape(-1, per_cell))


def curved(
    surfaces: dict[int, ExactSurface], walls: tuple[tuple[int, float], ...], order: int
) -> tuple[Nodes, int]:
    """The nodes where they belong, and how many edges stay straight because cells beside them would fold.

    surfaces: what the triangles of gmsh's entities approximate
    walls:    axis and place of the plane sides, on which nodes stay
    """
    nodes = Nodes.read()
    cells = nodes.cells(*((QUADRATIC_TETRAHEDRON, -1, 10) if order == 2 else (TETRAHEDRON, -1, 4)))
    places = nodes.places
    straight = places.copy()
    kind, size = (QUADRATIC_TRIANGLE, 6) if order == 2 else (TRIANGLE, 3)
    moved = np.empty(0, dtype=int)
    for entity, exact in surfaces.items():
        triangles = nodes.cells(kind, entity, size)
        corners = np.unique(triangles[:, :3])
        places[corners] = exact.project(places[corners], _held(places[corners], walls))
        if order == 1:
            continue
        ends, middles = _edges(triangles)
        centres = places[ends].mean(axis=1)
        target = exact.project(centres, _held(straight[middles], walls))
        length = np.linalg.norm(places[ends[:, 0]] - places[ends[:, 1]], axis=1)
        near = np.linalg.norm(target - centres, axis=1) <= FARTHEST * length
        places[middles[near]] = target[near]
        moved = np.union1d(moved, middles[near])
    if order == 1:
        return nodes, 0
    # Corners may have moved by a rounding: middles that are not curved lie between them.
    _put_between(places, cells, np.setdiff1d(np.unique(cells[:, 4:]), moved))
    return nodes, _unfold(places, cells, moved)


def _held(x: Floats, walls: tuple[tuple[int, float], ...]) -> np.ndarray:
    """Which coordinates (n, 3) of points (n, 3) are those of a plane side."""
    held = np.zeros(x.shape, dtype=bool)
    for axis, place in walls:
        held[:, axis] |= np.abs(x[:, axis] - place) <= ON_PLANE
    return held


def _edges(triangles: Integers) -> tuple[Integers, Integers]:
    """The ends (k, 2) and middles (k,) of the sides of triangles of order two, each once."""
    ends = np.concatenate([triangles[:, side] for side in SIDES])
    middles, first = np.unique(triangles[:, 3:].T.ravel(), return_index=True)
    return ends[first], middles


def _put_between(places: Floats, cells: Integers, middles: Integers) -> None:
    """Put some of the middles of edges halfway between the edges' ends."""
    chosen = np.zeros(len(places), dtype=bool)
    chosen[middles] = True
    for k, (a, b) in enumerate(EDGES):
        rows = cells[chosen[cells[:, 4 + k]]]
        places[rows[:, 4 + k]] = 0.5 * (places[rows[:, a]] + places[rows[:, b]])


def _unfold(places: Floats, cells: Integers, moved: Integers) -> int:
    """Straighten the edges of cells that fold over; how many."""
    straightened = np.empty(0, dtype=int)
    for _ in range(10):
        is_moved = np.zeros(len(places), dtype=bool)
        is_moved[moved] = True
        touched = cells[is_moved[cells[:, 4:]].any(axis=1)]
        bad = touched[least_stretch(places[touched]) < LEAST]
        back = np.intersect1d(bad[:, 4:], moved)
        if not len(back):
            break
        _put_between(places, cells, back)
        straightened, moved = np.union1d(straightened, back), np.setdiff1d(moved, back)
    return len(straightened)


def least_stretch(nodes: Floats) -> Floats:
    """A lower bound (m,) of the determinants of tetrahedra of order two (m, 10, 3), in units of the straight ones'.

    The determinant is a cubic: its least control point in Bernstein's form is a lower bound of it everywhere.
    """
    lattice = (
        np.array([[i, j, k, 3 - i - j - k] for i in range(4) for j in range(4 - i) for k in range(4 - i - j)])
        / 3.0
    )
    slopes = np.stack([_slopes(point) for point in lattice])
    rates = np.einsum("pke,mkd->mpde", slopes, nodes)
    corners = nodes[:, 1:4] - nodes[:, :1]
    values = np.linalg.det(rates) / np.linalg.det(corners)[:, None]
    return np.asarray((values @ np.linalg.inv(_bernstein(lattice)).T).min(axis=1))


def _slopes(barycentric: Floats) -> Floats:
    """Derivatives (10 nodes, 3) of the shape functions in the three directions from the first corner."""
    by = np.zeros((10, 4))
    for i in range(4):
        by[i, i] = 4.0 * barycentric[i] - 1.0
    for k, (a, b) in enumerate(EDGES):
        by[4 + k, a], by[4 + k, b] = 4.0 * barycentric[b], 4.0 * barycentric[a]
    return np.asarray(by[:, 1:] - by[:, :1])


def _bernstein(points: Floats) -> Floats:
    """The cubic Bernstein polynomials at points given by barycentric coordinates, (points, 20)."""
    powers = np.round(3.0 * points).astype(int)
    factorial = np.array([1.0, 1.0, 2.0, 6.0])
    return np.asarray(
        6.0 / factorial[powers].prod(axis=1) * (points[:, None, :] ** powers[None]).prod(axis=2)
    )

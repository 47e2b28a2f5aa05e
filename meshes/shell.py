"""The whole boundary of a region in space as triangles: grains and bed exactly, the plane sides as gmsh meshes them."""

from dataclasses import dataclass

import numpy as np

from incipient.arrays import Floats
from incipient.errors import MeshError
from incipient.geometry.space.remeshing import Topology
from incipient.geometry.space.surfaces import Surface, connected
from incipient.interrupt import handlers_kept

with handlers_kept():  # at its import gmsh takes interrupts for itself
    import gmsh

SAME = 1e-10  # of a region's height: points so near each other are one


@dataclass(frozen=True, eq=False)
class Shell:
    """Points (n, 3) of the frame and, by the name of the boundary, triangles (m, 3) of them."""

    points: Floats
    triangles: dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Walls:
    """The plane sides: at the least and the largest x and y, (2,) each, and at z = 1; all in the frame."""

    low: Floats
    high: Floats
    names: tuple[str, ...]

    def of_edges(self, points: Floats, edges: np.ndarray) -> list[np.ndarray]:
        """The edges (k, 2) that lie in each of the four upright sides."""
        ends = points[edges]
        return [
            edges[(ends[:, :, axis] == place).all(axis=1)]
            for axis, place in (
                (0, self.low[0]),
                (0, self.high[0]),
                (1, self.low[1]),
                (1, self.high[1]),
            )
        ]


def closed_shell(walls: Walls, bed: Surface, bodies: dict[str, Surface]) -> Shell:
    """The bed's and the grains' triangles with those of the walls, whose edges they share.

    A gmsh model with the sizes wanted as background field must be there; its geometry is drawn here, and removed.
    Raises MeshError if the walls cannot be meshed.
    """
    corners = _Corners(walls, bed)
    drawing = _Drawing()
    sides = [drawing.lines(bed.points, edges) for edges in walls.of_edges(bed.points, _rim(bed))]
    top = [drawing.point(place) for place in corners.top]
    upright = [
        drawing.line(drawing.point(low), high)
        for low, high in zip(corners.bottom, top, strict=True)
    ]
    upper = [drawing.line(top[i], top[(i + 1) % 4]) for i in range(4)]
    # Corners run (low, low), (high, low), (high, high), (low, high); the sides are x low, x high, y low, y high.
    rims = [
        [*sides[0], upright[0], upper[3], upright[3]],
        [*sides[1], upright[1], upper[1], upright[2]],
        [*sides[2], upright[0], upper[0], upright[1]],
        [*sides[3], upright[3], upper[2], upright[2]],
        upper,
    ]
    cut = [loop for body in bodies.values() for loop in drawing.loops(walls, body)]
    plates = [
        drawing.plate([rim, *(loop for side, loop in cut if side == number)])
        for number, rim in enumerate(rims)
    ]
    gmsh.model.geo.synchronize()
    gmsh.model.mesh.generate(2)
    found = [_triangles_of(plate) for plate in plates]
    gmsh.model.mesh.clear()
    gmsh.model.removeEntities(gmsh.model.getEntities(), recursive=True)
    return _put_together(walls, bed, bodies, found)


class _Corners:
    """The lower corners on the bed and the upper ones, four each."""

    def __init__(self, walls: Walls, bed: Surface):
        (a, b), (c, d) = walls.low, walls.high
        self.bottom, self.top = [], []
        for x, y in ((a, b), (c, b), (c, d), (a, d)):
            at = np.flatnonzero((bed.points[:, 0] == x) & (bed.points[:, 1] == y))
            if len(at) != 1:
                raise MeshError("the bed does not reach into a corner of the domain")
            self.bottom.append(bed.points[at[0]])
            self.top.append(np.array([x, y, 1.0]))


class _Drawing:
    """Draws points and straight lines, each place and each line once."""

    def __init__(self) -> None:
        self.points: dict[tuple[float, ...], int] = {}
        self.tags: dict[tuple[int, int], int] = {}

    def point(self, x: Floats) -> int:
        """The tag of the point at a place (3,), drawn if it is new."""
        place = tuple(float(c) for c in x)
        if place not in self.points:
            self.points[place] = gmsh.model.geo.addPoint(*place)
        return self.points[place]

    def line(self, start: int, end: int) -> int:
        """The tag of the line between two points, in whichever direction it was drawn first."""
        key = (min(start, end), max(start, end))
        if key not in self.tags:
            self.tags[key] = gmsh.model.geo.addLine(*key)
        return self.tags[key]

    def lines(self, points: Floats, edges: np.ndarray) -> list[int]:
        """The edges (k, 2) drawn so that gmsh leaves them whole."""
        found = [self.line(self.point(points[a]), self.point(points[b])) for a, b in edges.tolist()]
        for line in found:
            gmsh.model.geo.mesh.setTransfiniteCurve(line, 2)
        return found

    def loops(self, walls: Walls, surface: Surface) -> list[tuple[int, list[int]]]:
        """The closed lines along the edge of a surface, each with the number of the upright side that it lies in."""
        rim = _rim(surface)
        if not len(rim):
            return []
        label = connected(len(surface.points), rim)
        sides = enumerate(walls.of_edges(surface.points, rim))
        return [
            (number, self.lines(surface.points, edges[label[edges[:, 0]] == one]))
            for number, edges in sides
            for one in np.unique(label[edges[:, 0]])
        ]

    def plate(self, loops: list[list[int]]) -> int:
        """A plane surface between its outer line and those within it, whose pieces may be in any order."""
        turned = [gmsh.model.geo.addCurveLoop(self._in_order(loop)) for loop in loops]
        return int(gmsh.model.geo.addPlaneSurface(turned))

    def _in_order(self, lines: list[int]) -> list[int]:
        """Lines that close, one after the other, negative where they are gone along backwards."""
        ends = {tag: pair for pair, tag in self.tags.items()}
        at: dict[int, list[int]] = {}
        for line in lines:
            for end in ends[line]:
                at.setdefault(end, []).append(line)
        line = lines[0]
        ordered, place = [line], ends[line][1]
        while len(ordered) < len(lines):
            line = next(other for other in at[place] if other != line)
            start, end = ends[line]
            ordered.append(line if start == place else -line)
            place = end if start == place else start
        return ordered


def _rim(surface: Surface) -> np.ndarray:
    """The edges (k, 2) that have a triangle on one side only."""
    topology = Topology(surface.triangles)
    return np.asarray(topology.edges[topology.open])


def _triangles_of(plate: int) -> Floats:
    """The corners (m, 3, 3) of a plane surface's triangles."""
    tags, places, _ = gmsh.model.mesh.getNodes()
    table = np.zeros((int(tags.max(initial=0)) + 1, 3))
    table[tags.astype(int)] = np.reshape(places, (-1, 3))
    _, nodes = gmsh.model.mesh.getElementsByType(2, plate)
    if not len(nodes):
        raise MeshError("the geometry could not be meshed: a side of the domain has no triangles")
    return np.asarray(table[nodes.astype(int)].reshape(-1, 3, 3))


def _put_together(
    walls: Walls, bed: Surface, bodies: dict[str, Surface], plates: list[Floats]
) -> Shell:
    """All triangles with the points that they share taken as one."""
    parts = [("", part) for part in (bed, *bodies.values())]
    names = [walls.names[5], *bodies, *walls.names[:5]]
    tables = [part.corners for _, part in parts] + plates
    points = np.concatenate([table.reshape(-1, 3) for table in tables])
    _, first, number = np.unique(
        np.round(points / SAME), axis=0, return_index=True, return_inverse=True
    )
    number = number.ravel()
    triangles: dict[str, list[np.ndarray]] = {}
    start = 0
    for name, table in zip(names, tables, strict=True):
        count = 3 * len(table)
        triangles.setdefault(name, []).append(number[start : start + count].reshape(-1, 3))
        start += count
    return Shell(points[first], {name: np.vstack(pieces) for name, pieces in triangles.items()})

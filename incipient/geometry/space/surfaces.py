"""Triangulated surfaces: spheres, boxes, refinement, and what can be asked of a triangulation."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from incipient.arrays import Floats, cross, unit
from incipient.errors import SceneError

MOST_POINTS = 60_000  # of a sampled surface: finer wishes are cut down to that

Indices = np.ndarray  # (m, 2) or (m, 3) of integers


@dataclass(frozen=True, eq=False)
class Surface:
    """Points (n, 3) and triangles (m, 3) of their indices, counter-clockwise seen from outside."""

    points: Floats
    triangles: Indices

    @cached_property
    def edges(self) -> Indices:
        """The sides of the triangles (k, 2), each once."""
        return np.unique(np.sort(sides(self.triangles), axis=1), axis=0)

    @property
    def corners(self) -> Floats:
        """The triangles' corners, (m, 3 corners, 3)."""
        return self.points[self.triangles]

    @cached_property
    def spacing(self) -> float:
        """The length of the longest side."""
        ends = self.points[sides(self.triangles)]
        return float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).max(initial=0.0))


def sides(triangles: Indices) -> Indices:
    """The directed sides of triangles (m, 3), (3m, 2)."""
    return np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


def vector_areas(corners: Floats) -> Floats:
    """Normals (m, 3) of triangles (m, 3 corners, 3), as long as the areas."""
    return np.asarray(0.5 * cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def sphere(frequency: int) -> Surface:
    """The unit sphere: an icosahedron whose sides are cut into `frequency` parts."""
    golden = 0.5 * (1.0 + np.sqrt(5.0))
    short, long = [-1.0, 1.0], [-golden, golden]
    points = [p for a in short for b in long for p in ((0.0, a, b), (a, b, 0.0), (b, 0.0, a))]
    split = _split(hull_of(np.array(points)), frequency)
    return Surface(unit(split.points), split.triangles)


def hull_of(points: Floats) -> Surface:
    """The convex hull of points (n, 3) about the origin as triangles seen counter-clockwise from outside."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except QhullError:
        why = "the polyhedron has no volume; give vertices that are not all in one plane"
        raise SceneError(why) from None
    number = np.full(len(points), -1)
    number[hull.vertices] = np.arange(len(hull.vertices))
    triangles = number[hull.simplices]
    corners = points[hull.simplices]
    inward = (vector_areas(corners) * hull.equations[:, :3]).sum(axis=1) < 0.0
    triangles[inward] = triangles[inward, ::-1]
    return Surface(points[hull.vertices], triangles)


def box(half_sides: Floats, spacing: float) -> Surface:
    """A box about the origin whose sides are cut into parts of at most `spacing`."""
    counts = np.ceil(2.0 * half_sides / spacing)
    counts = np.clip(
        counts * min(1.0, (MOST_POINTS / max(6.0 * counts.max() ** 2, 1.0)) ** 0.5), 1, None
    )
    points, triangles, offset = [], [], 0
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for sign in (-1.0, 1.0):
            places, cells = grid(*(np.linspace(-1, 1, int(counts[k]) + 1) for k in (u, v)))
            face = np.empty((len(places), 3))
            face[:, axis], face[:, u], face[:, v] = sign, places[:, 0], places[:, 1]
            points.append(face * half_sides)
            triangles.append((cells if sign > 0 else cells[:, ::-1]) + offset)
            offset += len(places)
    return merged(np.vstack(points), np.vstack(triangles), 1e-9 * float(half_sides.min()))


def grid(us: Floats, vs: Floats) -> tuple[Floats, Indices]:
    """Points (n, 2) of a grid with these abscissae and ordinates, and its triangles (m, 3)."""
    u, v = np.meshgrid(us, vs, indexing="ij")
    index = np.arange(u.size).reshape(u.shape)
    a, b, c, d = (
        k.ravel() for k in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
    )
    cells = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return np.column_stack([u.ravel(), v.ravel()]), cells


def merged(points: Floats, triangles: Indices, tolerance: float) -> Surface:
    """The surface whose points that agree to a tolerance are one, without triangles of fewer than three points.

    Points of no triangle are left out.
    """
    rounded = np.round(points / tolerance)
    _, first, inverse = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    triangles = inverse.ravel()[triangles]
    a, b, c = triangles.T
    used, triangles = np.unique(triangles[(a != b) & (b != c) & (c != a)], return_inverse=True)
    return Surface(points[first][used], triangles.reshape(-1, 3))


def refined(surface: Surface, spacing: float) -> Surface:
    """The surface with its triangles cut into equal parts until no side is longer than `spacing`.

    All triangles are cut alike, so that neighbours keep sharing their points.
    """
    parts = max(1, int(np.ceil(surface.spacing / spacing)))
    most = max(1, int(np.sqrt(2.0 * MOST_POINTS / max(len(surface.triangles), 1))))
    return surface if min(parts, most) == 1 else _split(surface, min(parts, most))


def _split(surface: Surface, parts: int) -> Surface:
    """Every triangle cut into parts^2 similar ones."""
    i, j = (
        k.ravel() for k in np.meshgrid(np.arange(parts + 1), np.arange(parts + 1), indexing="ij")
    )
    keep = i + j <= parts
    i, j = i[keep], j[keep]
    number = np.full((parts + 2, parts + 2), -1)
    number[i, j] = np.arange(len(i))
    up = np.column_stack([number[i, j], number[i + 1, j], number[i, j + 1]])
    down = np.column_stack([number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]])
    cells = np.vstack([up[(up >= 0).all(axis=1)], down[(down >= 0).all(axis=1)]])
    weights = np.column_stack([parts - i - j, i, j]) / parts
    points = np.einsum("pk,mkd->mpd", weights, surface.corners)
    offsets = len(i) * np.arange(len(surface.triangles))
    triangles = (cells[None] + offsets[:, None, None]).reshape(-1, 3)
    extent = float(np.ptp(surface.points, axis=0).max())
    return merged(points.reshape(-1, 3), triangles, 1e-9 * extent)


def joined(surfaces: list[Surface]) -> Surface:
    """Several surfaces as one."""
    offsets = np.cumsum([0, *(len(surface.points) for surface in surfaces[:-1])])
    triangles = [
        surface.triangles + offset for surface, offset in zip(surfaces, offsets, strict=True)
    ]
    return Surface(np.vstack([surface.points for surface in surfaces]), np.vstack(triangles))


def require_closed(surface: Surface, name: str) -> None:
    """Refuse a surface that does not enclose one volume.

    Raises SceneError with the number of open edges, of edges shared by more than two triangles, or of
    separate parts, or if neighbouring triangles disagree on what is outside.
    """
    directed = sides(surface.triangles)
    _, inverse, counts = np.unique(
        np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    open_edges, crowded = int((counts == 1).sum()), int((counts > 2).sum())
    if open_edges:
        raise SceneError(
            f"{name} is not watertight: it has {open_edges} open edges; close its holes"
        )
    if crowded:
        raise SceneError(
            f"{name} has {crowded} edges with more than two triangles; separate its sheets"
        )
    forward = np.bincount(inverse.ravel(), weights=directed[:, 0] < directed[:, 1])
    if (forward != 1).any():
        raise SceneError(f"{name} has triangles that face different ways; orient them outwards")
    parts = len(np.unique(connected(len(surface.points), surface.triangles)[surface.triangles]))
    if parts > 1:
        raise SceneError(f"{name} has {parts} separate parts; a grain is one body, join them")


def connected(count: int, links: Indices) -> Indices:
    """A label for each of `count` points, the same for those joined by edges or triangles (m, k)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    first, others = np.repeat(links[:, 0], links.shape[1] - 1), links[:, 1:].ravel()
    graph = coo_matrix((np.ones(len(first)), (first, others)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])

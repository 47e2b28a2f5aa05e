"""Triangulated surfaces: searching, making, checking and cutting."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from incipient.arrays import Floats, cross, unit
from incipient.errors import SceneError, refuse_broken

if TYPE_CHECKING:
    from scipy.spatial import cKDTree


MOST_POINTS = 60_000  # of a sampled surface: finer wishes are cut down to that
# Part of an edge's length, and of barycentric coordinates in a triangle: what only touches does not cross.
BESIDE = 1e-9
BESIDE_POINT = 0.02  # of a step of a grid, by which a level surface keeps off its points

Indices = np.ndarray  # (m, 2) or (m, 3) of integers


@dataclass(frozen=True, eq=False)
class Triangles:
    """Spatial index of triangles (m, 3, 3), which may be segments or points."""

    corners: Floats

    @cached_property
    def _reach(self) -> Floats:
        middle = self.corners.mean(axis=1, keepdims=True)
        return np.asarray(np.linalg.norm(self.corners - middle, axis=2).max(axis=1))

    @cached_property
    def _centroids(self) -> "cKDTree":
        return tree(self.corners.mean(axis=1))

    @cached_property
    def _corners(self) -> "cKDTree":
        return tree(self.corners.reshape(-1, 3))

    def near(self, points: Floats, within: float | Floats) -> tuple[np.ndarray, np.ndarray]:
        """Rows of points (n, 3) and triangles (k,) that may be as near as `within` (a length, or (n,))."""
        # A point at a corner is as far from a centroid as the triangle reaches: round-off must not lose it.
        around = np.broadcast_to(within, len(points)) + 1e-9 * self._reach.max()
        close = self._centroids.query_ball_point(points, around + self._reach.max())
        counts = np.fromiter(map(len, close), int, len(close))
        row = np.repeat(np.arange(len(points)), counts)
        triangle = np.fromiter(chain.from_iterable(close), int, counts.sum())
        apart = np.linalg.norm(points[row] - self._centroids.data[triangle], axis=1)
        near = apart <= self._reach[triangle] + around[row]
        return row[near], triangle[near]

    def nearest(self, points: Floats, slack: float) -> tuple[Floats, np.ndarray, np.ndarray]:
        """Nearest points (n, 3); rows and triangles (k,) that are as near but for a slack."""
        result, before = [(np.empty((0, 3)), np.empty(0, int), np.empty(0, int))], 0
        for block in self._blocks(points):
            row, triangle = self.near(block, self._corners.query(block)[0] + slack)
            feet = nearest_on_triangles(block[row], self.corners[triangle])
            apart = np.linalg.norm(feet - block[row], axis=1)
            order = np.lexsort([apart, row])
            best = order[np.unique(row[order], return_index=True)[1]]
            sharing = apart <= apart[best][row] + slack
            result.append((feet[best], before + row[sharing], triangle[sharing]))
            before += len(block)
        feet, row, triangle = (np.concatenate(column) for column in zip(*result, strict=True))
        return feet, row, triangle

    def _blocks(self, points: Floats) -> Iterator[Floats]:
        reach = self._corners.query(points)[0] + self._reach.max()
        pairs = int(self._centroids.query_ball_point(points, reach, return_length=True).sum())
        return (block for block in np.array_split(points, 1 + pairs // 1_000_000) if len(block))


def tree(points: Floats) -> "cKDTree":
    """The spatial index of points (n, d)."""
    from scipy.spatial import cKDTree  # which takes time to import

    return cKDTree(points)


def nearest_on_triangles(x: Floats, corners: Floats) -> Floats:
    """The nearest points (..., 3) of triangles (..., 3, 3) to points (..., 3)."""
    shape = np.broadcast_shapes(x.shape[:-1], corners.shape[:-2])
    if (corners == corners[..., :1, :]).all():  # points, of spheres
        return np.broadcast_to(corners[..., 0, :], (*shape, 3)).copy()
    from trimesh.triangles import closest_point  # which takes time to import

    points, triangles = np.broadcast_to(x, (*shape, 3)), np.broadcast_to(corners, (*shape, 3, 3))
    nearest = closest_point(triangles.reshape(-1, 3, 3), points.reshape(-1, 3))
    return np.asarray(nearest.reshape(*shape, 3))


def neighbours(ends: Floats, corners: Floats) -> tuple[np.ndarray, np.ndarray]:
    """Segments (n, 2, 3) and triangles (m, 3, 3) that may meet, as pairs of numbers (k,)."""
    half = 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    longest = longest_sides(corners)
    # Triangles of like size are sought together: a large one would make the search for small ones wide.
    kind = np.round(np.log2(np.maximum(longest, 1e-300))).astype(int)
    pairs = []
    for item in np.unique(kind):
        mine = np.flatnonzero(kind == item)
        row, triangle = Triangles(corners[mine]).near(ends.mean(axis=1), half)
        pairs.append((row, mine[triangle]))
    row, triangle = (np.concatenate(column) for column in zip(*pairs, strict=True))
    return row, triangle


class Topology:
    """Edges (k, 2) of triangles (m, 3), each once, its lower point first.

    of_sides (m, 3): the edge from each corner of a triangle to its next one.
    """

    def __init__(self, triangles: np.ndarray):
        self.triangles = triangles
        following = triangles[:, [1, 2, 0]]
        width = int(triangles.max(initial=0)) + 1
        low, high = np.minimum(triangles, following), np.maximum(triangles, following)
        keys = (low.astype(np.int64) * width + high).T.ravel()
        self._keys, self._first, inverse = np.unique(keys, return_index=True, return_inverse=True)
        self._width = width
        self.edges = np.column_stack(np.divmod(self._keys, width))
        self.of_sides = inverse.reshape(3, -1).T

    def number(self, pairs: np.ndarray) -> np.ndarray:
        """Numbers (n,) of the edges between pairs (n, 2) of points; -1: none."""
        low, high = pairs.min(axis=1), pairs.max(axis=1)
        key = low.astype(np.int64) * self._width + high
        place = np.minimum(np.searchsorted(self._keys, key), len(self._keys) - 1)
        return np.where((self._keys[place] == key) & (high < self._width), place, -1)

    @cached_property
    def beside(self) -> np.ndarray:
        """The two triangles (k, 2) at each edge; the second is -1 on the surface's boundary."""
        last = np.empty(len(self._keys), dtype=np.int64)
        last[self.of_sides.T.ravel()] = np.arange(self.of_sides.size)
        triangles = np.column_stack([self._first, last]) % max(len(self.triangles), 1)
        triangles[self._first == last, 1] = -1
        return triangles

    @cached_property
    def open(self) -> np.ndarray:
        return np.asarray(self.beside[:, 1] < 0)

    @cached_property
    def opposite(self) -> np.ndarray:
        """Corners (k, 2) opposite to each edge; -1: no triangle."""
        sums = self.triangles.sum(axis=1)
        return np.where(self.beside >= 0, sums[self.beside] - self.edges.sum(axis=1)[:, None], -1)


@dataclass(frozen=True, eq=False)
class Surface:
    """Points (n, 3) and triangles (m, 3), counter-clockwise seen from outside."""

    points: Floats
    triangles: Indices

    @cached_property
    def topology(self) -> Topology:
        return Topology(self.triangles)

    @property
    def corners(self) -> Floats:
        return self.points[self.triangles]

    @cached_property
    def spacing(self) -> float:
        return float(longest_sides(self.corners).max(initial=0.0))


def longest_sides(corners: Floats) -> Floats:
    """The lengths (m,) of the longest sides of triangles (m, 3, 3)."""
    sides = corners - np.roll(corners, 1, axis=1)
    return np.asarray(np.linalg.norm(sides, axis=2).max(axis=1))


def vector_areas(corners: Floats) -> Floats:
    """Normals (m, 3) of triangles (m, 3, 3), as long as the areas."""
    return np.asarray(0.5 * cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def sphere(frequency: int) -> Surface:
    """The unit sphere: an icosahedron whose sides are cut into `frequency` parts."""
    golden = 0.5 * (1.0 + np.sqrt(5.0))
    short, long = [-1.0, 1.0], [-golden, golden]
    points = [p for a in short for b in long for p in ((0.0, a, b), (a, b, 0.0), (b, 0.0, a))]
    split = _split(hull_of(np.array(points)), frequency)
    return Surface(unit(split.points), split.triangles)


def hull_of(points: Floats) -> Surface:
    """The convex hull of points (n, 3) about the origin."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except QhullError:
        raise SceneError(
            "the polyhedron has no volume; give vertices that are not all in one plane"
        ) from None
    used, triangles = np.unique(hull.simplices, return_inverse=True)
    triangles, corners = triangles.reshape(-1, 3), points[hull.simplices]
    inward = (vector_areas(corners) * hull.equations[:, :3]).sum(axis=1) < 0.0
    triangles[inward] = triangles[inward, ::-1]
    return Surface(points[used], triangles)


def box(half_sides: Floats, spacing: float) -> Surface:
    """A box about the origin, its sides cut into parts of at most `spacing`."""
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
    """Points (n, 2) and triangles (m, 3) of a grid with these abscissae and ordinates."""
    u, v = np.meshgrid(us, vs, indexing="ij")
    index = np.arange(u.size).reshape(u.shape)
    a, b, c, d = (
        k.ravel() for k in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
    )
    cells = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return np.column_stack([u.ravel(), v.ravel()]), cells


def merged(points: Floats, triangles: Indices, tolerance: float) -> Surface:
    """The surface with points that agree to a tolerance as one, without collapsed triangles."""
    rounded = np.round(points / tolerance)
    _, first, inverse = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    used, triangles = renumbered(inverse.ravel()[triangles])
    return Surface(points[first][used], triangles)


def ordered(triangles: Indices) -> Indices:
    """Triangles (m, 3) in an order that the numbers of their points alone decide."""
    first = triangles.argmin(axis=1)[:, None]
    turned = np.take_along_axis(triangles, (first + np.arange(3)) % 3, axis=1)
    return np.asarray(turned[np.lexsort(turned.T[::-1])])


def renumbered(triangles: Indices) -> tuple[Indices, Indices]:
    """The points (n,) of triangles (m, 3) that are not collapsed, and these by their numbers among them."""
    a, b, c = triangles.T
    used, numbers = np.unique(triangles[(a != b) & (b != c) & (c != a)], return_inverse=True)
    return used, numbers.reshape(-1, 3)


def refined(surface: Surface, spacing: float) -> Surface:
    """The surface with all triangles cut alike until no side is longer than `spacing`."""
    parts = max(1, int(np.ceil(surface.spacing / spacing)))
    most = max(1, int(np.sqrt(2.0 * MOST_POINTS / max(len(surface.triangles), 1))))
    return surface if min(parts, most) == 1 else _split(surface, min(parts, most))


def _split(surface: Surface, parts: int) -> Surface:
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
    from trimesh.util import append_faces  # which takes time to import

    return Surface(*append_faces([s.points for s in surfaces], [s.triangles for s in surfaces]))


def require_closed(surface: Surface, name: str) -> None:
    """Raise SceneError, with the reason, for a surface that does not enclose one volume."""
    number, following = surface.topology.of_sides, surface.triangles[:, [1, 2, 0]]
    counts = np.bincount(number.ravel())
    ahead = np.bincount(number.ravel(), (surface.triangles < following).ravel())
    parts = len(np.unique(connected(len(surface.points), surface.triangles)[surface.triangles]))
    open_edges, crowded = int((counts == 1).sum()), int((counts > 2).sum())
    refuse_broken(
        (open_edges, f"{name} is not watertight: it has {open_edges} open edges; close its holes"),
        (crowded, f"{name} has {crowded} edges with more than two triangles; separate its sheets"),
        (
            (ahead != 1).any(),
            f"{name} has triangles that face different ways; orient them outwards",
        ),
        (parts > 1, f"{name} has {parts} separate parts; a grain is one body, join them"),
    )


def connected(count: int, links: Indices) -> Indices:
    """A label for each of `count` points, the same for those joined by edges or triangles (m, k)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    first, others = np.repeat(links[:, 0], links.shape[1] - 1), links[:, 1:].ravel()
    graph = coo_matrix((np.ones(len(first)), (first, others)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def repaired(surface: Surface) -> Surface:
    """The surface with equal points as one, each triangle once, and all triangles in one sense."""
    extent = float(np.ptp(surface.points, axis=0).max())
    # Files of 32-bit numbers write the same point differently.
    surface = merged(surface.points, surface.triangles, 2e-7 * max(extent, 1e-300))
    _, once = np.unique(np.sort(surface.triangles, axis=1), axis=0, return_index=True)
    triangles = surface.triangles[np.sort(once)]
    directed = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    if len(np.unique(directed, axis=0)) < len(directed):  # neighbours go along a side the same way
        import pyvista  # which takes time to import

        mesh = pyvista.PolyData(surface.points, np.insert(triangles, 0, 3, axis=1))
        mesh = mesh.compute_normals(consistent_normals=True, split_vertices=False)
        triangles = mesh.faces.reshape(-1, 4)[:, 1:]
    return Surface(surface.points, triangles)


def require_plain(surface: Surface, name: str) -> None:
    """Raise SceneError for a surface that intersects itself, with the number of triangles."""
    count = len(crossed(surface))
    if count:
        raise SceneError(f"{name} runs through itself in {count} triangles; remesh it")


def crossed(surface: Surface) -> np.ndarray:
    """Triangles (k,) that edges run through with which they share no point."""
    edges, corners = surface.topology.edges, surface.corners
    ends = surface.points[edges]
    row, triangle = neighbours(ends, corners)
    apart = (edges[row][:, :, None] != surface.triangles[triangle][:, None]).all(axis=(1, 2))
    row, triangle = row[apart], triangle[apart]
    return np.unique(triangle[_runs_through(ends[row], corners[triangle])])


def _runs_through(ends: Floats, corners: Floats) -> np.ndarray:
    along, first = ends[:, 1] - ends[:, 0], corners[:, 1] - corners[:, 0]
    second = corners[:, 2] - corners[:, 0]
    # start + t along = corner + u first + v second
    matrix = np.stack([-along, first, second], axis=2)
    scale = np.linalg.norm(along, axis=1) * np.linalg.norm(cross(first, second), axis=1)
    proper = np.abs(np.linalg.det(matrix)) > BESIDE * scale
    matrix = np.where(proper[:, None, None], matrix, np.eye(3))
    t, u, v = np.linalg.solve(matrix, (ends[:, 0] - corners[:, 0])[..., None])[..., 0].T
    least = np.min([t, u, v, 1.0 - t, 1.0 - u - v], axis=0)
    return np.asarray(proper & (least > BESIDE))


def grouped(owner: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Values (k,) of each of `count` owners (k,) in a row, filled up with its last value."""
    values = values[np.argsort(owner, kind="stable")]
    number = np.bincount(owner, minlength=count)
    place = np.minimum(np.arange(number.max(initial=1)), number[:, None] - 1)
    return np.asarray(values[(np.cumsum(number) - number)[:, None] + place])


class Cloud:
    """Triangles whose distance is that of those around the nearest vertex."""

    def __init__(self, surface: Surface):
        self.corners, self.spacing = surface.corners, surface.spacing
        self.vertices = tree(surface.points)
        flat = surface.triangles.ravel()
        self.around = grouped(flat, np.arange(len(flat)) // 3, len(surface.points))

    def distance(self, x: Floats) -> Floats:
        distance, nearest = self.vertices.query(x)
        # Farther away the nearest vertex alone tells the distance.
        near = np.flatnonzero(distance < 2.0 * self.spacing)
        feet = nearest_on_triangles(x[near, None], self.corners[self.around[nearest[near]]])
        distance[near] = np.minimum(
            distance[near], np.linalg.norm(feet - x[near, None], axis=2).min(axis=1)
        )
        return distance


def in_blocks(level: Callable[[Floats], Floats], x: Floats) -> Floats:
    """The level (n,) at points (n, 3), 20,000 at a time."""
    parts = np.array_split(x, 1 + len(x) // 20_000)
    return np.concatenate([level(part) for part in parts])


def level_surface(
    level: Callable[[Floats], Floats], axes: tuple[Floats, Floats, Floats]
) -> Surface:
    """The surface level = 0 within a grid of abscissae along three axes; it faces growing levels."""
    import pyvista  # which takes time to import

    grid = pyvista.StructuredGrid(*np.meshgrid(*axes, indexing="ij"))
    values = in_blocks(level, np.asarray(grid.points, dtype=float))
    # Vertices very near a point of the grid would make needles: the surface is moved a little beside it.
    step = min(float(np.diff(axis).min()) for axis in axes)
    values = np.where(np.abs(values) < BESIDE_POINT * step, BESIDE_POINT * step, values)
    cut = grid.contour([0.0], values)
    points, triangles = np.asarray(cut.points, dtype=float), cut.faces.reshape(-1, 4)[:, 1:]
    areas, middles = vector_areas(points[triangles]), points[triangles].mean(axis=1)
    rise = in_blocks(level, middles + 0.1 * step * unit(areas)) - in_blocks(level, middles)
    return Surface(points, triangles if rise.sum() > 0.0 else triangles[:, ::-1])


def halved(surface: Surface) -> Surface:
    """The part of a surface with y >= 0, with the vertices of its new edge exactly on y = 0."""
    points, ends = surface.points.copy(), surface.topology.edges
    lengths = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    shortest = np.full(len(points), np.inf)
    np.minimum.at(shortest, ends.T.ravel(), np.tile(lengths, 2))
    # A vertex so near the cut is moved onto it.
    points[np.abs(points[:, 1]) < 0.2 * shortest, 1] = 0.0
    from trimesh.intersections import slice_faces_plane  # which takes time to import

    normal, origin = np.array([0.0, 1.0, 0.0]), np.zeros(3)
    points, triangles = slice_faces_plane(points, surface.triangles, normal, origin)[:2]
    points[np.abs(points[:, 1]) < 1e-9 * surface.spacing, 1] = 0.0
    inside = (points[triangles, 1] > 0.0).any(axis=1)
    return merged(points, triangles[inside], 1e-9 * surface.spacing)

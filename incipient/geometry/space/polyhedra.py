"""Grains in space with flat faces: boxes with rounded edges, convex polyhedra, surfaces read from files."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, rows, unit
from incipient.errors import SceneError
from incipient.geometry import moments
from incipient.geometry.space import surfaces
from incipient.geometry.space.solid import Core, Solid, require_positive
from incipient.geometry.space.surfaces import Surface

BLOCK = 2_000_000  # pairs of points and triangles that are looked at together


@dataclass(frozen=True)
class Box(Solid):
    """A box with sides (3,) whose edges and corners are rounded with `edge_radius` (0: sharp)."""

    sides: tuple[float, float, float]
    edge_radius: float = 0.0

    def __post_init__(self) -> None:
        require_positive("side", *self.sides)
        if not 0.0 <= self.edge_radius <= 0.5 * min(self.sides):
            raise SceneError(
                f"edge_radius {self.edge_radius} is not between 0 and half the shortest side; change it"
            )

    @property
    def _half(self) -> Floats:
        """Half the sides of the box that the ball is rolled around."""
        return 0.5 * np.array(self.sides) - self.edge_radius

    @property
    def size(self) -> float:
        """The diagonal, less what the rounding takes off."""
        return float(2.0 * np.linalg.norm(self._half) + 2.0 * self.edge_radius)

    @cached_property
    def _moments(self) -> moments.Moments:
        return moments.rounded_box(self._half, self.edge_radius)

    @property
    def volume(self) -> float:
        """By parts: the core, its faces, edges and corners, each with what the ball adds."""
        return self._moments.volume

    @property
    def inertia(self) -> Floats:
        """By the same parts."""
        return moments.inertia_of(self._moments.second)

    @cached_property
    def cores(self) -> tuple[Core, ...]:
        """The box that the ball is rolled around, flat or thin where the rounding takes a whole side."""
        corners = surfaces.box(np.ones(3), 2.0)
        return (Core(corners.points * self._half, corners.triangles, self.edge_radius),)

    def level(self, x: ArrayLike) -> Floats:
        """The signed distance at points (n, 3)."""
        beyond = np.abs(rows(x)) - self._half
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        return np.asarray(outside + np.minimum(beyond.max(axis=1), 0.0) - self.edge_radius)

    def normal(self, x: ArrayLike) -> Floats:
        """Outward unit normals (n, 3) at points (n, 3), at sharp edges and corners the bisector."""
        x = rows(x)
        beyond = np.abs(x) - self._half
        inside = (beyond <= 1e-12 * self.size).all(axis=1, keepdims=True)
        nearest = beyond >= beyond.max(axis=1, keepdims=True) - 1e-12 * self.size
        direction = np.where(inside, nearest, np.maximum(beyond, 0.0))
        return unit(direction * np.where(x < 0.0, -1.0, 1.0))

    def surface(self, spacing: float) -> Surface:
        """The faces of the sharp box, pressed onto the rounded one along its normals."""
        sharp = surfaces.box(0.5 * np.array(self.sides), spacing)
        if self.edge_radius == 0.0:
            return sharp
        near = np.clip(sharp.points, -self._half, self._half)
        return Surface(near + self.edge_radius * unit(sharp.points - near), sharp.triangles)


@dataclass(frozen=True, init=False)
class Polyhedron(Solid):
    """The convex hull of points (n, 3), shifted to its centroid. Raises SceneError if it has no volume."""

    vertices: tuple[tuple[float, float, float], ...]

    def __init__(self, vertices: Sequence[Sequence[float]] | Floats) -> None:
        corners = np.array(vertices, dtype=float)
        if corners.ndim != 2 or corners.shape[1] != 3 or len(corners) < 4 or not np.isfinite(corners).all():
            raise SceneError("a polyhedron needs four or more vertices of three finite coordinates; add them")
        hull = _hull(corners - corners.mean(axis=0))
        points = hull.points - moments.polyhedron(hull.corners).centroid
        object.__setattr__(self, "vertices", tuple((float(x), float(y), float(z)) for x, y, z in points))

    @cached_property
    def _hull(self) -> Surface:
        return _hull(np.array(self.vertices))

    @cached_property
    def _faces(self) -> tuple[Floats, Floats]:
        """Outward unit normals (m, 3) of the faces' triangles and their distances from the origin (m,)."""
        normals = unit(surfaces.vector_areas(self._hull.corners))
        return normals, (normals * self._hull.corners[:, 0]).sum(axis=1)

    @property
    def size(self) -> float:
        """The largest distance of two vertices."""
        return _largest_distance(np.array(self.vertices))

    @cached_property
    def _moments(self) -> moments.Moments:
        return moments.polyhedron(self._hull.corners)

    @property
    def volume(self) -> float:
        """By the tetrahedra of the faces with the centroid."""
        return self._moments.volume

    @property
    def inertia(self) -> Floats:
        """By the same tetrahedra."""
        return moments.inertia_of(self._moments.second)

    @property
    def cores(self) -> tuple[Core, ...]:
        """The polyhedron itself."""
        return (Core(self._hull.points, self._hull.triangles),)

    def level(self, x: ArrayLike) -> Floats:
        """The largest of the distances from the faces' planes at points (n, 3)."""
        normals, offsets = self._faces
        return np.asarray((rows(x) @ normals.T - offsets).max(axis=1))

    def normal(self, x: ArrayLike) -> Floats:
        """The normal (n, 3) of the face whose plane is farthest below each point; at edges the bisector."""
        normals, offsets = self._faces
        height = rows(x) @ normals.T - offsets
        nearest = height >= height.max(axis=1, keepdims=True) - 1e-12 * self.size
        return np.array([_mean_direction(normals[row]) for row in nearest])

    def surface(self, spacing: float) -> Surface:
        """The faces, cut into smaller triangles."""
        return surfaces.refined(self._hull, spacing)


def _mean_direction(normals: Floats) -> Floats:
    """The mean of unit normals (k, 3), those that agree counted once."""
    return (
        unit(np.unique(np.round(normals, 9), axis=0).sum(axis=0)[None])[0] if len(normals) > 1 else normals[0]
    )


def _hull(points: Floats) -> Surface:
    """The convex hull of points (n, 3) about the origin as triangles seen counter-clockwise from outside."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except QhullError:
        raise SceneError(
            "the polyhedron has no volume; give vertices that are not all in one plane"
        ) from None
    number = np.full(len(points), -1)
    number[hull.vertices] = np.arange(len(hull.vertices))
    triangles = number[hull.simplices]
    corners = points[hull.simplices]
    inward = (surfaces.vector_areas(corners) * hull.equations[:, :3]).sum(axis=1) < 0.0
    triangles[inward] = triangles[inward, ::-1]
    return Surface(points[hull.vertices], triangles)


def _largest_distance(points: Floats) -> float:
    """The largest distance of two points (n, 3); for many points among those of their hull."""
    if len(points) > 50:
        from scipy.spatial import ConvexHull

        points = points[ConvexHull(points).vertices]
    largest = 0.0
    for block in np.array_split(points, 1 + len(points) // 500):
        largest = max(largest, float(np.linalg.norm(block[:, None] - points, axis=2).max()))
    return largest


@dataclass(frozen=True, eq=False)
class Triangulated(Solid):
    """A grain bounded by a closed surface of triangles; it is shifted to its centroid.

    `vertices` (n, 3) and `triangles` (m, 3) in any sense, but all in the same. Raises SceneError if the surface
    is not closed (with the number of open edges), encloses no volume, or is in several parts.
    """

    vertices: Floats
    triangles: np.ndarray
    name: str = "the surface"

    def __post_init__(self) -> None:
        points, triangles = np.array(self.vertices, dtype=float), np.array(self.triangles)
        if points.ndim != 2 or points.shape[1] != 3 or triangles.ndim != 2 or triangles.shape[1] != 3:
            raise SceneError(f"{self.name} needs vertices (n, 3) and triangles (m, 3); give them")
        if not np.isfinite(points).all():
            raise SceneError(f"{self.name} has a vertex that is not finite; give finite numbers")
        if len(triangles) == 0 or triangles.min() < 0 or triangles.max() >= len(points):
            raise SceneError(f"{self.name} has no triangles, or one of vertices that do not exist; check it")
        extent = float(np.ptp(points, axis=0).max())
        surface = surfaces.merged(points, triangles, 1e-9 * max(extent, 1e-300))
        surfaces.require_closed(surface, self.name)
        middle = surface.points - surface.points.mean(axis=0)
        whole = moments.polyhedron(middle[surface.triangles])
        if not abs(whole.volume) > 1e-12 * extent**3:
            raise SceneError(f"{self.name} encloses no volume; give a body")
        turned = surface.triangles if whole.volume > 0.0 else surface.triangles[:, ::-1]
        object.__setattr__(self, "vertices", middle - whole.centroid)
        object.__setattr__(self, "triangles", turned)

    @classmethod
    def from_file(cls, path: str | Path, scale: float = 1.0) -> "Triangulated":
        """A grain from an STL, PLY or OBJ file, its coordinates times `scale`.

        Raises SceneError if the file is missing, cannot be read, or its surface is not closed.
        """
        import trimesh

        path = Path(path)
        if not path.is_file():
            raise SceneError(f"{path} does not exist; give the name of an STL, PLY or OBJ file")
        if path.suffix.lower() not in (".stl", ".ply", ".obj"):
            raise SceneError(f"{path} is not an STL, PLY or OBJ file; convert it")
        require_positive("scale", scale)
        try:
            mesh: Any = trimesh.load(path, force="mesh", process=False)
            points: Floats = np.array(mesh.vertices, dtype=np.float64)
            triangles = np.array(mesh.faces)
        except Exception as error:  # whatever the reader stumbled over
            why = " ".join(str(error).split()) or type(error).__name__
            raise SceneError(f"{path} cannot be read ({why[:80]}); export it again") from None
        return cls(scale * points.reshape(-1, 3), triangles.reshape(-1, 3), str(path))

    @property
    def _surface(self) -> Surface:
        return Surface(self.vertices, self.triangles)

    @cached_property
    def size(self) -> float:
        """The largest distance of two vertices."""
        return _largest_distance(self.vertices)

    @cached_property
    def _moments(self) -> moments.Moments:
        return moments.polyhedron(self._surface.corners)

    @property
    def volume(self) -> float:
        """By the signed tetrahedra of the triangles with the centroid."""
        return self._moments.volume

    @property
    def inertia(self) -> Floats:
        """By the same tetrahedra."""
        return moments.inertia_of(self._moments.second)

    @cached_property
    def cores(self) -> tuple[Core, ...]:
        """The triangles."""
        return (Core(self.vertices, self.triangles),)

    def level(self, x: ArrayLike) -> Floats:
        """The signed distance at points (n, 3)."""
        return self._nearest(rows(x))[0]

    def normal(self, x: ArrayLike) -> Floats:
        """Unit normals (n, 3): off the surface away from its nearest point, on an edge the mean of its sides'."""
        return self._nearest(rows(x))[1]

    def _nearest(self, x: Floats) -> tuple[Floats, Floats]:
        """Signed distances (n,) and normals (n, 3), some points at a time."""
        count = 1 + len(x) * len(self.triangles) // BLOCK
        found = [self._nearest_of_few(block) for block in np.array_split(x, count) if len(block)]
        return np.concatenate([d for d, _ in found]), np.vstack([n for _, n in found])

    def _nearest_of_few(self, x: Floats) -> tuple[Floats, Floats]:
        corners = self._surface.corners
        away = x[:, None] - nearest_on_triangles(x[:, None], corners)
        distance = np.linalg.norm(away, axis=2)
        least = distance.min(axis=1)
        inside = _winding(x, corners) > 0.5
        normals = np.where(inside, -1.0, 1.0)[:, None] * unit(
            away[np.arange(len(x)), distance.argmin(axis=1)]
        )
        of_triangles = unit(surfaces.vector_areas(corners))
        for k in np.flatnonzero(least <= 1e-9 * self.size):
            normals[k] = _mean_direction(of_triangles[distance[k] <= least[k] + 1e-12 * self.size])
        return np.where(inside, -least, least), normals

    def surface(self, spacing: float) -> Surface:
        """The triangles, cut into smaller ones."""
        return surfaces.refined(self._surface, spacing)


def nearest_on_triangles(x: Floats, corners: Floats) -> Floats:
    """The nearest points (..., 3) of triangles (..., 3 corners, 3) to points (..., 3); leading axes broadcast."""
    a, ab, ac = (
        corners[..., 0, :],
        corners[..., 1, :] - corners[..., 0, :],
        corners[..., 2, :] - corners[..., 0, :],
    )
    away = x - a
    aa, bb, cross = (ab * ab).sum(-1), (ac * ac).sum(-1), (ab * ac).sum(-1)
    p, q = (away * ab).sum(-1), (away * ac).sum(-1)
    determinant = np.maximum(aa * bb - cross**2, 1e-300)
    u, v = (p * bb - q * cross) / determinant, (q * aa - p * cross) / determinant
    inside = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
    best = a + u[..., None] * ab + v[..., None] * ac
    squared = np.where(inside, ((best - x) ** 2).sum(-1), np.inf)
    for i in range(3):
        start = corners[..., i, :]
        side = corners[..., (i + 1) % 3, :] - start
        along = ((x - start) * side).sum(-1) / np.maximum((side * side).sum(-1), 1e-300)
        foot = start + np.clip(along, 0.0, 1.0)[..., None] * side
        away_squared = ((foot - x) ** 2).sum(-1)
        closer = away_squared < squared
        best, squared = np.where(closer[..., None], foot, best), np.where(closer, away_squared, squared)
    return np.asarray(best)


def _winding(x: Floats, corners: Floats) -> Floats:
    """How often a closed surface winds around each of the points (n, 3): 1 inside, 0 outside.

    The sum of the triangles' solid angles (van Oosterom and Strackee 1983).
    """
    a, b, c = (corners[:, i] - x[:, None] for i in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=2) for v in (a, b, c))
    volume = (a * np.cross(b, c)).sum(-1)
    other = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
    return np.asarray((2.0 * np.arctan2(volume, other)).sum(axis=1) / (4.0 * np.pi))

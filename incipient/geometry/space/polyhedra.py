"""Grains in space with flat faces: boxes with rounded edges, convex polyhedra, surfaces read from files."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, rows, unit
from incipient.errors import SceneError
from incipient.geometry import moments
from incipient.geometry.shape import largest_distance, require_positive
from incipient.geometry.space import surfaces
from incipient.geometry.space.nearest import Triangles
from incipient.geometry.space.repair import repaired, require_plain
from incipient.geometry.space.solid import Core, Solid
from incipient.geometry.space.surfaces import Surface
from incipient.geometry.space.triangle_files import triangles_in


class FlatSided(Solid):
    """A grain whose moments about its centroid are the sum of those of its parts."""

    @property
    def inertia(self) -> Floats:
        """The inertia (3, 3) about the centroid for unit density, by the grain's parts."""
        return moments.inertia_of(self._moments.second)


@dataclass(frozen=True)
class Box(FlatSided):
    """A box with sides (3,) whose edges and corners are rounded with `edge_radius` (0: sharp)."""

    level_is_distance = True
    sides: tuple[float, float, float]
    edge_radius: float = 0.0

    def __post_init__(self) -> None:
        require_positive("side", *self.sides)
        if not 0.0 <= self.edge_radius <= 0.5 * min(self.sides):
            raise SceneError(
                f"edge_radius {self.edge_radius} is not between 0 and half the shortest side; change it"
            )

    @property
    def sharp(self) -> bool:
        """Whether its edges are not rounded."""
        return self.edge_radius == 0.0

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


def _mean_directions(row: np.ndarray, normals: Floats, count: int) -> Floats:
    """The means (count, 3) of unit normals (k, 3) that belong to rows (k,); those of a row that agree count once."""
    distinct = np.unique(np.column_stack([row, np.round(normals, 9)]), axis=0, return_index=True)[1]
    return unit(
        np.column_stack([np.bincount(row[distinct], part, count) for part in normals[distinct].T])
    )


@dataclass(frozen=True, eq=False)
class Triangulated(FlatSided):
    """A grain bounded by a closed surface of triangles; it is shifted to its centroid, which was at `centre` (3,).

    `vertices` (n, 3) and `triangles` (m, 3) in any sense, but all in the same. Raises SceneError if the surface
    is not closed (with the number of open edges), encloses no volume, or is in several parts.
    """

    sharp = True
    vertices: Floats
    triangles: np.ndarray
    name: str = "the surface"
    centre: Floats = field(init=False)

    def __post_init__(self) -> None:
        points, triangles = np.array(self.vertices, dtype=float), np.array(self.triangles)
        if (
            points.ndim != 2
            or points.shape[1] != 3
            or triangles.ndim != 2
            or triangles.shape[1] != 3
        ):
            raise SceneError(f"{self.name} needs vertices (n, 3) and triangles (m, 3); give them")
        if not np.isfinite(points).all():
            raise SceneError(f"{self.name} has a vertex that is not finite; give finite numbers")
        if len(triangles) == 0 or triangles.min() < 0 or triangles.max() >= len(points):
            raise SceneError(
                f"{self.name} has no triangles, or one of vertices that do not exist; check it"
            )
        extent = float(np.ptp(points, axis=0).max())
        surface = surfaces.merged(points, triangles, 1e-9 * max(extent, 1e-300))
        surfaces.require_closed(surface, self.name)
        mean = surface.points.mean(axis=0)
        middle = surface.points - mean
        whole = moments.within(middle[surface.triangles])
        if not abs(whole.volume) > 1e-12 * extent**3:
            raise SceneError(f"{self.name} encloses no volume; give a body")
        turned = surface.triangles if whole.volume > 0.0 else surface.triangles[:, ::-1]
        object.__setattr__(self, "vertices", middle - whole.centroid)
        object.__setattr__(self, "triangles", turned)
        object.__setattr__(self, "centre", mean + whole.centroid)

    @classmethod
    def from_file(cls, path: str | Path, scale: float = 1.0) -> "Triangulated":
        """A grain from an STL, PLY or OBJ file, its coordinates times `scale`.

        Points and triangles that are there twice are taken as one, and triangles turned to one sense. Raises SceneError
        if the file is missing, cannot be read, or its surface is not closed or runs through itself.
        """
        require_positive("scale", scale)
        points, triangles = triangles_in(path)
        surface = repaired(Surface(scale * points, triangles))
        solid = cls(surface.points, surface.triangles, str(path))
        require_plain(surface, str(path))
        return solid

    @property
    def _surface(self) -> Surface:
        return Surface(self.vertices, self.triangles)

    @cached_property
    def size(self) -> float:
        """The largest distance of two vertices."""
        return largest_distance(self.vertices)

    @cached_property
    def _moments(self) -> moments.Moments:
        return moments.within(self._surface.corners)

    @cached_property
    def cores(self) -> tuple[Core, ...]:
        """The triangles."""
        return (Core(self.vertices, self.triangles),)

    @property
    def _triangles(self) -> Triangles:
        return self.cores[0].search

    def level(self, x: ArrayLike) -> Floats:
        """The signed distance at points (n, 3)."""
        points = rows(x)
        feet = self._triangles.nearest(points, 1e-12 * self.size)[0]
        return self._sides(points) * np.linalg.norm(points - feet, axis=1)

    def normal(self, x: ArrayLike) -> Floats:
        """Unit normals (n, 3): off the surface away from its nearest point, on an edge the mean of its sides'."""
        points = rows(x)
        feet, row, triangle = self._triangles.nearest(points, 1e-12 * self.size)
        away = points - feet
        facing = unit(surfaces.vector_areas(self._surface.corners[triangle]))
        on_surface = np.linalg.norm(away, axis=1, keepdims=True) <= 1e-9 * self.size
        outward = self._sides(points)[:, None] * unit(away)
        return np.where(on_surface, _mean_directions(row, facing, len(points)), outward)

    def _sides(self, points: Floats) -> Floats:
        """-1 (n,) for points (n, 3) inside the surface, 1 for those outside."""
        return np.where(self._triangles.winding(points) > 0.5, -1.0, 1.0)

    def surface(self, spacing: float) -> Surface:
        """The triangles, cut into smaller ones."""
        return surfaces.refined(self._surface, spacing)


class Polyhedron(Triangulated):
    """The convex hull of points (n, 3), shifted to its centroid. Raises SceneError if it has no volume."""

    def __init__(self, vertices: Sequence[Sequence[float]] | Floats) -> None:
        corners = np.array(vertices, dtype=float)
        if (
            corners.ndim != 2
            or corners.shape[1] != 3
            or len(corners) < 4
            or not np.isfinite(corners).all()
        ):
            raise SceneError(
                "a polyhedron needs four or more vertices of three finite coordinates; add them"
            )
        hull = surfaces.hull_of(corners - corners.mean(axis=0))
        super().__init__(hull.points, hull.triangles, "the polyhedron")

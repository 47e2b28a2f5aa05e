"""Rigid grains in 3-D, in their body frame with the centroid at the origin."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product as choices
from math import gamma, pi
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, cross, rows, unit
from incipient.errors import SceneError
from incipient.geometry.plane.grains import farthest, moments_of_discs, power_norm
from incipient.geometry.shape import (
    Balls,
    Moments,
    Shape,
    largest_distance,
)
from incipient.geometry.space.files import triangles_in
from incipient.geometry.triangles import (
    MOST_POINTS,
    Surface,
    Triangles,
    box,
    grid,
    hull_of,
    joined,
    merged,
    ordered,
    refined,
    repaired,
    require_closed,
    require_plain,
    sphere,
    vector_areas,
)

ACROSS = np.array([1.0, 0.0, 1.0])  # the directions normal to the axis of a cylinder
Triple = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class SphereSwept(Surface):
    """A surface swept by a ball of a radius (0: the surface itself).

    A point (a sphere) or a segment is a triangle with repeated indices.
    """

    radius: float = 0.0

    @cached_property
    def search(self) -> Triangles:
        return Triangles(self.corners)

    @cached_property
    def parts(self) -> Floats:
        """Its triangles, corners and edges (k, 3, 3) as triangles."""
        edges = self.topology.edges
        edges = edges[edges[:, 0] != edges[:, 1]]
        corners = np.repeat(np.arange(len(self.points))[:, None], 3, axis=1)
        return self.points[np.concatenate([self.triangles, corners, edges[:, [0, 1, 1]]])]


class Solid(Shape):
    """A rigid grain in 3-D."""

    gdim = 3
    level_is_distance = False  # whether `level` is the signed distance everywhere
    spans_width = False  # whether its ends lie in the sides of the domain

    @property
    def sharp(self) -> bool:
        """Whether the grain has edges that a mesh must resolve."""
        return False

    @abstractmethod
    def surface(self, spacing: float) -> Surface:
        """The surface as triangles with corners on it, at most about `spacing` apart."""

    def axis_of_revolution(self) -> Floats | None:
        """The direction of the body, if one, about which no turn changes the surface.

        Turns by a radian, which is no rational part of a whole turn, come close to all others.
        """
        from scipy.spatial.transform import Rotation  # which takes time to import

        if self.sharp:
            return None
        points = self.surface(0.2 * self.size).points
        for axis in np.eye(3):
            turned = Rotation.from_rotvec(axis).apply(points)
            if np.allclose(self.level(turned), self.level(points), 0.0, 1e-7 * self.size):
                return np.asarray(axis)
        return None

    @property
    def cores(self) -> tuple[SphereSwept, ...]:
        """What a ball rolls around; none if the grain is smooth but not round."""
        return ()

    def project(self, x: ArrayLike) -> Floats:
        """Points (n, 3) of the surface near points (n, 3) close to it."""
        return rows(x) - self.level(x)[:, None] * self.normal(x)

    def extreme(self, direction: Floats) -> Floats:
        ends = [
            core.points[np.argmax(core.points @ direction)] + core.radius * direction
            for core in self.cores
        ]
        return np.asarray(max(ends, key=lambda end: float(end @ direction)))


@dataclass(frozen=True)
class Superquadric(Solid):
    """(|x/a|^n + |y/b|^n)^(m/n) + |z/c|^m = 1 with semi-axes (a, b, c), exponents (m, n) from 2 to 20."""

    semi_axes: Triple
    exponents: tuple[float, float]

    @property
    def size(self) -> float:
        """Twice the largest |x|, by Hoelder's inequality for the section, then the whole."""
        (a, b, c), (m, n) = self.semi_axes, self.exponents
        return 2.0 * farthest((farthest((a, b), n), c), m)

    @cached_property
    def moments(self) -> Moments:
        whole = 8.0 * float(np.prod(self.semi_axes))
        second = [self._octant(p, q, r) for p, q, r in ((3, 1, 1), (1, 3, 1), (1, 1, 3))]
        diagonal = whole * np.square(self.semi_axes) * second
        return Moments(whole * self._octant(1, 1, 1), np.zeros(3), np.diag(diagonal))

    def _octant(self, p: float, q: float, r: float) -> float:
        """The integral of x^(p-1) y^(q-1) z^(r-1) over an octant with unit semi-axes (Dirichlet 1839)."""
        m, n = self.exponents
        section = gamma(p / n) * gamma(q / n) / (n * n * gamma(1.0 + (p + q) / n))
        along = gamma(r / m) * gamma((p + q) / m + 1.0) / gamma((p + q + r) / m + 1.0)
        return section * along / m

    def _norm(self, x: Floats) -> Floats:
        m, n = self.exponents
        scaled = np.abs(x) / np.asarray(self.semi_axes)
        return power_norm(np.column_stack([power_norm(scaled[:, :2], n), scaled[:, 2]]), m)

    def level(self, x: ArrayLike) -> Floats:
        """min(a, b, c) (scale of the similar superquadric through the point - 1), (n,)."""
        return np.asarray(min(self.semi_axes) * (self._norm(rows(x)) - 1.0))

    def normal(self, x: ArrayLike) -> Floats:
        (m, n), scaled = self.exponents, rows(x) / self.semi_axes
        sizes = np.abs(scaled)
        sizes /= np.maximum(sizes.max(axis=1, keepdims=True), 1e-300)
        section = power_norm(sizes[:, :2], n)[:, None]
        ratio = sizes[:, :2] / np.maximum(section, 1e-300)
        across = section ** (m - 1.0) * ratio ** (n - 1.0)
        slope = np.column_stack([across, sizes[:, 2] ** (m - 1.0)])
        return unit(np.sign(scaled) * slope / self.semi_axes)

    def project(self, x: ArrayLike) -> Floats:
        x = rows(x)
        return np.asarray(x / self._norm(x)[:, None])

    def extreme(self, direction: Floats) -> Floats:
        """The point (3,) on the ray along the normal of the polar superquadric (Hoelder's equality)."""
        a, b, c = 1.0 / np.asarray(self.semi_axes)
        m, n = (p / (p - 1.0) for p in self.exponents)
        return self.project(Superquadric((a, b, c), (m, n)).normal(direction))[0]

    def surface(self, spacing: float) -> Surface:
        """The image of a triangulated unit sphere."""
        frequency, most = (
            max(4, int(np.ceil(0.7 * self.size / spacing))),
            int(np.sqrt(0.1 * MOST_POINTS)),
        )
        while True:
            ball = sphere(min(frequency, most))
            surface = Surface(self.project(ball.points * self.semi_axes), ball.triangles)
            excess = surface.spacing / spacing
            if excess <= 1.0 or frequency >= most:
                return surface
            frequency = int(np.ceil(frequency * min(excess, 3.0)))


@dataclass(frozen=True)
class Ellipsoid(Superquadric):
    """An ellipsoid with semi-axes along the body's directions."""

    exponents: tuple[float, float] = field(default=(2.0, 2.0), init=False)


@dataclass(frozen=True)
class Sphere(Ellipsoid):
    """A sphere of the given diameter."""

    level_is_distance = True
    semi_axes: Triple = field(init=False, repr=False)
    diameter: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "semi_axes", 3 * (0.5 * self.diameter,))

    @property
    def cores(self) -> tuple[SphereSwept, ...]:
        return (SphereSwept(np.zeros((1, 3)), np.zeros((1, 3), dtype=int), 0.5 * self.diameter),)

    def level(self, x: ArrayLike) -> Floats:
        return np.asarray(np.linalg.norm(rows(x), axis=1) - 0.5 * self.diameter)


@dataclass(frozen=True)
class Box(Solid):
    """A box with sides (3,) whose edges and corners are rounded with `edge_radius` (0: sharp)."""

    level_is_distance = True
    sides: tuple[float, float, float]
    edge_radius: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.edge_radius <= 0.5 * min(self.sides):
            raise SceneError(
                f"edge_radius {self.edge_radius} is not between 0 and half the shortest side; "
                "change it"
            )

    @property
    def sharp(self) -> bool:
        return self.edge_radius == 0.0

    @property
    def size(self) -> float:
        return float(2.0 * np.linalg.norm(self.core) + 2.0 * self.edge_radius)

    def level(self, x: ArrayLike) -> Floats:
        beyond = np.abs(rows(x)) - self.core
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        return np.asarray(outside + np.minimum(beyond.max(axis=1), 0.0) - self.edge_radius)

    def normal(self, x: ArrayLike) -> Floats:
        x = rows(x)
        beyond, slack = np.abs(x) - self.core, 1e-12 * self.size
        inside = (beyond <= slack).all(axis=1, keepdims=True)
        nearest = beyond >= beyond.max(axis=1, keepdims=True) - slack
        direction = np.where(inside, nearest, np.maximum(beyond, 0.0))
        return unit(direction * np.where(x < 0.0, -1.0, 1.0))

    @cached_property
    def core(self) -> Floats:
        return 0.5 * np.array(self.sides) - self.edge_radius

    @cached_property
    def moments(self) -> Moments:
        """Sum over cells: along each axis a point is beside the core or beyond it."""
        volume, second, r = 0.0, np.zeros(3), self.edge_radius
        # Content, first and second moments of the parts of a ball beyond the core along none to three axes
        corners = (
            (1.0, 0.0, 0.0),
            (r, r**2 / 2.0, r**3 / 3.0),
            (pi * r**2 / 4.0, r**3 / 3.0, pi * r**4 / 16.0),
            (pi * r**3 / 6.0, pi * r**4 / 16.0, pi * r**5 / 30.0),
        )
        for beyond in choices((False, True), repeat=3):
            out = np.array(beyond)
            cell, first, square = corners[out.sum()]
            copies = 2.0 ** out.sum() * float(np.prod(2.0 * self.core[~out]))
            volume += copies * cell
            outside = self.core**2 * cell + 2.0 * self.core * first + square
            second += copies * np.where(out, outside, self.core**2 / 3.0 * cell)
        return Moments(volume, np.zeros(3), np.diag(second))

    @cached_property
    def cores(self) -> tuple[SphereSwept, ...]:
        corners = box(np.ones(3), 2.0)
        # Corners coincide where the rounding takes up whole sides.
        points, number = np.unique(corners.points * self.core, axis=0, return_inverse=True)
        return (SphereSwept(points, number.ravel()[corners.triangles], self.edge_radius),)

    def surface(self, spacing: float) -> Surface:
        sharp = box(0.5 * np.array(self.sides), spacing)
        if self.edge_radius == 0.0:
            return sharp
        near = np.clip(sharp.points, -self.core, self.core)
        return Surface(near + self.edge_radius * unit(sharp.points - near), sharp.triangles)


@dataclass(frozen=True, eq=False)
class Triangulated(Solid):
    """A grain bounded by a closed surface of triangles, shifted to its centroid, which was at `centre` (3,).

    `vertices` (n, 3), `triangles` (m, 3). Raises SceneError if the surface is not closed or consistently oriented,
    encloses no volume, or is in several parts.
    """

    sharp = True
    vertices: Floats
    triangles: np.ndarray
    name: str = "the surface"
    centre: Floats = field(init=False)

    def __post_init__(self) -> None:
        points, triangles = np.array(self.vertices, dtype=float), np.array(self.triangles)
        if len(triangles) == 0 or triangles.min() < 0 or triangles.max() >= len(points):
            raise SceneError(
                f"{self.name} has no triangles, or one of vertices that do not exist; check it"
            )
        extent = float(np.ptp(points, axis=0).max())
        surface = merged(points, triangles, 1e-9 * max(extent, 1e-300))
        require_closed(surface, self.name)
        mean = surface.points.mean(axis=0)
        middle = surface.points - mean
        whole = Moments.within(middle[ordered(surface.triangles)])
        if not abs(whole.volume) > 1e-12 * extent**3:
            raise SceneError(f"{self.name} encloses no volume; give a body")
        turned = surface.triangles if whole.volume > 0.0 else surface.triangles[:, ::-1]
        object.__setattr__(self, "vertices", middle - whole.centroid)
        object.__setattr__(self, "triangles", turned)
        object.__setattr__(self, "centre", mean + whole.centroid)

    @classmethod
    def from_file(cls, path: str | Path) -> "Triangulated":
        """A grain from an STL, PLY or OBJ file, repaired where possible.

        Raises SceneError if the surface cannot be read, is not closed or intersects itself.
        """
        surface = repaired(Surface(*triangles_in(path)))
        solid = cls(surface.points, surface.triangles, str(path))
        require_plain(surface, str(path))
        return solid

    @cached_property
    def size(self) -> float:
        return largest_distance(self.vertices)

    @cached_property
    def moments(self) -> Moments:
        return Moments.within(self.vertices[self.triangles])

    @cached_property
    def cores(self) -> tuple[SphereSwept, ...]:
        # The order in a file must not decide where the grain comes to rest.
        return (SphereSwept(self.vertices, ordered(self.triangles)),)

    def _outward(self, points: Floats) -> tuple[Floats, Floats]:
        """Vectors (n, 3) from the nearest points of the surface, and the normals (n, 3) there.

        At edges and corners the angle-weighted mean, which decides the side (Baerentzen and Aanaes 2005).
        """
        feet, row, triangle = self.cores[0].search.nearest(points, 1e-12 * self.size)
        corners = self.cores[0].search.corners[triangle]
        to, after = corners - feet[row, None], np.roll(corners, -1, axis=1) - feet[row, None]
        sines = np.linalg.norm(cross(to, after), axis=2)
        angles = np.arctan2(sines, (to * after).sum(axis=2)).sum(axis=1)
        facing = angles[:, None] * unit(vector_areas(corners))
        mean = np.zeros((len(points), 3))
        np.add.at(mean, row, facing)
        return points - feet, unit(mean)

    def level(self, x: ArrayLike) -> Floats:
        away, normals = self._outward(rows(x))
        return np.copysign(np.linalg.norm(away, axis=1), (away * normals).sum(axis=1))

    def normal(self, x: ArrayLike) -> Floats:
        away, normals = self._outward(rows(x))
        on_surface = np.linalg.norm(away, axis=1, keepdims=True) <= 1e-9 * self.size
        side = np.sign((away * normals).sum(axis=1, keepdims=True))
        return np.where(on_surface, normals, side * unit(away))

    def project(self, x: ArrayLike) -> Floats:
        return self.cores[0].search.nearest(rows(x), 0.0)[0]

    def surface(self, spacing: float) -> Surface:
        return refined(self.cores[0], spacing)


class Polyhedron(Triangulated):
    """The convex hull of points (n, 3), shifted to its centroid. Raises SceneError if it has no volume."""

    def __init__(self, vertices: Sequence[Sequence[float]] | Floats) -> None:
        corners = np.array(vertices, dtype=float)
        hull = hull_of(corners - corners.mean(axis=0))
        super().__init__(hull.points, hull.triangles, "the polyhedron")


@dataclass(frozen=True)
class Cylinder(Solid):
    """A cylinder about the second axis, its ends in the sides of a domain."""

    spans_width = True
    diameter: float
    length: float

    @property
    def size(self) -> float:
        return self.diameter

    @cached_property
    def moments(self) -> Moments:
        across, along = self.diameter**2 / 16.0, self.length**2 / 12.0
        volume = 4.0 * pi * across * self.length
        return Moments(volume, np.zeros(3), volume * np.diag([across, along, across]))

    @property
    def cores(self) -> tuple[SphereSwept, ...]:
        ends = np.array([[0.0, -0.5, 0.0], [0.0, 0.5, 0.0]]) * self.length
        return (SphereSwept(ends, np.array([[0, 1, 1]]), 0.5 * self.diameter),)

    def level(self, x: ArrayLike) -> Floats:
        return np.asarray(np.linalg.norm(rows(x) * ACROSS, axis=1) - 0.5 * self.diameter)

    def normal(self, x: ArrayLike) -> Floats:
        return unit(rows(x) * ACROSS)

    def surface(self, spacing: float) -> Surface:
        around = max(8, int(np.ceil(pi * self.diameter / spacing)))
        along = max(2, int(np.ceil(self.length / spacing)))
        ends = np.linspace(-0.5, 0.5, along + 1) * self.length
        places, triangles = grid(np.linspace(2.0 * pi, 0.0, around + 1), ends)
        angle, y, r = places[:, 0], places[:, 1], 0.5 * self.diameter
        points = np.column_stack([r * np.cos(angle), y, r * np.sin(angle)])
        return merged(points, triangles, 1e-9 * r)


@dataclass(frozen=True, init=False)
class Spheres(Balls, Solid):
    """Connected spheres, shifted to the centroid of their union.

    Raises SceneError if a sphere touches no other or lies within another.
    """

    level_is_distance = True
    centres: tuple[Triple, ...]
    radii: tuple[float, ...]

    @staticmethod
    def union(centres: Floats, radii: Floats) -> Moments:
        """Moments of a union of spheres from its sections, unions of discs, along the third axis."""
        from scipy.integrate import quad_vec  # which takes time to import

        def section(height: float) -> Floats:
            squared = radii**2 - (height - centres[:, 2]) ** 2
            cut = squared > 0.0
            middles, sizes = centres[cut, :2], np.sqrt(squared[cut])
            area = moments_of_discs(middles, sizes)
            mean = np.array([*area.first, height * area.volume])
            second = np.vstack([np.column_stack([area.second, height * area.first]), height * mean])
            return np.concatenate([[area.volume], mean, second.ravel()])

        poles = np.unique([centres[:, 2] - radii, centres[:, 2] + radii])
        # Stretched so that the square roots at the poles of the lowest and the highest sphere are smooth.
        middle, half = 0.5 * (poles[-1] + poles[0]), 0.5 * (poles[-1] - poles[0])
        angles = np.arcsin(np.clip((poles - middle) / half, -1.0, 1.0))
        total, _ = quad_vec(
            lambda t: half * np.cos(t) * section(middle + half * np.sin(t)),
            *(-0.5 * pi, 0.5 * pi),
            epsabs=0.0,
            epsrel=1e-8,
            norm="max",
            quadrature="gk15",
            points=angles[1:-1],
        )
        return Moments(float(total[0]), total[1:4], total[4:].reshape(3, 3))

    @property
    def cores(self) -> tuple[SphereSwept, ...]:
        point = np.zeros((1, 3), dtype=int)
        return tuple(
            SphereSwept(np.array([c]), point, r)
            for c, r in zip(self.centres, self.radii, strict=True)
        )

    def surface(self, spacing: float) -> Surface:
        """The exposed triangles; those across a crease are left whole."""
        frequency = max(4, int(np.ceil(1.3 * max(self.radii) / spacing)))
        frequency = min(frequency, int(np.sqrt(0.1 * MOST_POINTS / len(self.radii))))
        ball, pieces = sphere(frequency), []
        for centre, radius in zip(self.centres, self.radii, strict=True):
            points = np.asarray(centre) + radius * ball.points
            shows = (self.level(points) >= -1e-9 * radius)[ball.triangles].any(axis=1)
            used, numbers = np.unique(ball.triangles[shows], return_inverse=True)
            pieces.append(Surface(points[used], numbers.reshape(-1, 3)))
        return joined(pieces)

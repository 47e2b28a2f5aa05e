"""Rigid grains in space: what all can do, and the smooth ones: sphere, ellipsoid, superquadric.

All grains live in their body frame: the origin is the centroid, the centre of mass of a uniform grain.
Lengths are scene units.
"""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import gamma, pi

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, cross, rows, unit
from incipient.errors import SceneError
from incipient.geometry import moments
from incipient.geometry.plane.smooth import MAX_EXPONENT, farthest, power_norm
from incipient.geometry.shape import Shape, require_positive
from incipient.geometry.space import surfaces
from incipient.geometry.space.nearest import Triangles
from incipient.geometry.space.surfaces import Surface


@dataclass(frozen=True, eq=False)
class Core:
    """Triangles (m, 3) of points (n, 3), swept by a ball of a radius (0: the triangles themselves).

    A triangle may be a single point (a sphere) or a segment: then its indices repeat.
    """

    points: Floats
    triangles: np.ndarray
    radius: float = 0.0

    @cached_property
    def search(self) -> Triangles:
        """The triangles, to be found by place."""
        return Triangles(self.points[self.triangles])


class Solid(Shape):
    """A rigid grain in space."""

    gdim = 3
    level_is_distance = False  # whether `level` is the signed distance everywhere
    spans_width = False  # whether its ends lie in the sides of the domain

    @property
    def sharp(self) -> bool:
        """Whether it has edges that a mesh has to follow."""
        return False

    @abstractmethod
    def surface(self, spacing: float) -> Surface:
        """The surface as triangles with corners on it, at most about `spacing` apart."""

    @property
    def cores(self) -> tuple[Core, ...]:
        """What balls are rolled around to make the grain; none if it is smooth without being round."""
        return ()

    def project(self, x: ArrayLike) -> Floats:
        """Points of the surface (n, 3) near points (n, 3) that are close to it; for smooth grains only."""
        raise NotImplementedError


def triangulated(shape: Callable[[Floats], Floats], size: float, spacing: float) -> Surface:
    """The image of the unit sphere under a map of directions (n, 3) to points, as finely as asked."""
    frequency = max(4, int(np.ceil(0.7 * size / spacing)))
    while True:
        frequency = min(frequency, int(np.sqrt(0.1 * surfaces.MOST_POINTS)))
        round_one = surfaces.sphere(frequency)
        surface = Surface(shape(round_one.points), round_one.triangles)
        excess = surface.spacing / spacing
        if excess <= 1.0 or 10 * (frequency + 1) ** 2 >= surfaces.MOST_POINTS:
            return surface
        frequency = int(np.ceil(frequency * min(excess, 3.0)))


@dataclass(frozen=True)
class Superquadric(Solid):
    """(|x/a|^n + |y/b|^n)^(m/n) + |z/c|^m = 1 with semi-axes (a, b, c) and exponents (m, n) from 2 to 100.

    m rules the section along the third axis, n the section across it; (2, 2) is an ellipsoid.
    """

    semi_axes: tuple[float, float, float]
    exponents: tuple[float, float]

    def __post_init__(self) -> None:
        require_positive("semi-axis", *self.semi_axes)
        for value in self.exponents:
            if not 2.0 <= value <= MAX_EXPONENT:
                raise SceneError(
                    f"exponent {value} is not between 2 and {MAX_EXPONENT:g}; change it"
                )

    @property
    def size(self) -> float:
        """Twice the largest |x| on the surface, by Hoelder's inequality for the section, then the whole."""
        (a, b, c), (m, n) = self.semi_axes, self.exponents
        return 2.0 * farthest((farthest((a, b), n), c), m)

    @property
    def volume(self) -> float:
        """The area of the section, integrated along the third axis."""
        (a, b, c), n = self.semi_axes, self.exponents[1]
        return 4.0 * a * b * c * moments.dirichlet((1.0, 1.0), n) * self._along(1.0, 2.0)

    @property
    def inertia(self) -> Floats:
        """The second moments of the section, integrated along the third axis."""
        (a, b, c), n = self.semi_axes, self.exponents[1]
        across = 4.0 * a * b * c * moments.dirichlet((3.0, 1.0), n) * self._along(1.0, 4.0)
        along = 4.0 * a * b * c * moments.dirichlet((1.0, 1.0), n) * self._along(3.0, 2.0)
        return moments.inertia_of(np.diag([a * a * across, b * b * across, c * c * along]))

    def _along(self, power: float, scale: float) -> float:
        """Twice the integral of w^(power-1) (1 - w^m)^(scale/m) over 0 < w < 1, a beta function."""
        m = self.exponents[0]
        p, q = power / m, scale / m + 1.0
        return 2.0 / m * gamma(p) * gamma(q) / gamma(p + q)

    def _norm(self, x: Floats) -> Floats:
        """The factor (n,) by which the similar superquadric through each point is larger."""
        m, n = self.exponents
        scaled = np.abs(x) / np.asarray(self.semi_axes)
        return power_norm(np.column_stack([power_norm(scaled[:, :2], n), scaled[:, 2]]), m)

    def level(self, x: ArrayLike) -> Floats:
        """min(a, b, c) (factor of the similar superquadric through the point - 1) at points (n, 3)."""
        return np.asarray(min(self.semi_axes) * (self._norm(rows(x)) - 1.0))

    def normal(self, x: ArrayLike) -> Floats:
        """Outward unit normals (n, 3) of the similar superquadric through each of the points (n, 3)."""
        m, n = self.exponents
        axes = np.asarray(self.semi_axes)
        scaled = rows(x) / axes
        scaled = scaled / np.maximum(np.abs(scaled).max(axis=1, keepdims=True), 1e-300)
        section = power_norm(np.abs(scaled[:, :2]), n)[:, None]
        slope = np.sign(scaled) * np.abs(scaled)
        ratio = np.abs(scaled[:, :2]) / np.maximum(section, 1e-300)
        slope[:, :2] = np.sign(scaled[:, :2]) * section ** (m - 1.0) * ratio ** (n - 1.0)
        slope[:, 2] = np.sign(scaled[:, 2]) * np.abs(scaled[:, 2]) ** (m - 1.0)
        return unit(slope / axes)

    def project(self, x: ArrayLike) -> Floats:
        """The points (n, 3) of the surface on the rays from the origin through points (n, 3)."""
        x = rows(x)
        return np.asarray(x / self._norm(x)[:, None])

    def surface(self, spacing: float) -> Surface:
        """A sphere's triangles, stretched along the axes and carried along rays onto the surface."""
        return triangulated(
            lambda d: self.project(d * np.asarray(self.semi_axes)), self.size, spacing
        )


@dataclass(frozen=True)
class Ellipsoid(Superquadric):
    """An ellipsoid with semi-axes along the body's directions."""

    exponents: tuple[float, float] = (2.0, 2.0)

    def __post_init__(self) -> None:
        require_positive("semi-axis", *self.semi_axes)
        object.__setattr__(self, "exponents", (2.0, 2.0))

    @property
    def volume(self) -> float:
        """4/3 pi a b c."""
        return float(4.0 / 3.0 * pi * np.prod(self.semi_axes))

    @property
    def inertia(self) -> Floats:
        """Second moments V a^2 / 5 and so on."""
        return moments.inertia_of(0.2 * self.volume * np.diag(np.square(self.semi_axes)))


@dataclass(frozen=True)
class Sphere(Solid):
    """A sphere of the given diameter."""

    level_is_distance = True
    diameter: float

    def __post_init__(self) -> None:
        require_positive("diameter", self.diameter)

    @property
    def size(self) -> float:
        """The diameter."""
        return self.diameter

    @property
    def volume(self) -> float:
        """pi d^3 / 6."""
        return pi * self.diameter**3 / 6.0

    @property
    def inertia(self) -> Floats:
        """V d^2 / 10 about every axis."""
        return np.asarray(self.volume * self.diameter**2 / 10.0 * np.eye(3))

    @property
    def cores(self) -> tuple[Core, ...]:
        """The centre."""
        return (Core(np.zeros((1, 3)), np.zeros((1, 3), dtype=int), 0.5 * self.diameter),)

    def level(self, x: ArrayLike) -> Floats:
        """The signed distance at points (n, 3)."""
        return np.asarray(np.linalg.norm(rows(x), axis=1) - 0.5 * self.diameter)

    def normal(self, x: ArrayLike) -> Floats:
        """Away from the centre, (n, 3)."""
        return unit(rows(x))

    def surface(self, spacing: float) -> Surface:
        """A divided icosahedron."""
        return triangulated(lambda d: 0.5 * self.diameter * d, self.diameter, spacing)


def frame_of(normals: Floats) -> tuple[Floats, Floats]:
    """Two unit tangents (n, 3) each, perpendicular to unit normals (n, 3) and to each other."""
    least = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = unit(cross(normals, least))
    return first, cross(normals, first)

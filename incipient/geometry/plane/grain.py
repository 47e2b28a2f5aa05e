"""Rigid grains in the plane: a level function f(x), negative inside, and an exact outline.

All grains live in their body frame: the origin is the centroid, the centre of mass of a uniform grain.
A `Placement` turns and carries the frame into the scene. Lengths are scene units, angles radians.
"""

from abc import abstractmethod
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, Point, rows, unit
from incipient.errors import SceneError
from incipient.geometry import moments
from incipient.geometry.placement import Placement as Placement  # known by this name here, too
from incipient.geometry.plane.curves import Arc, Curve, Line, plain
from incipient.geometry.plane.outline import Chain
from incipient.geometry.shape import Shape, require_positive


class Grain(Shape):
    """A rigid grain in the plane."""

    gdim = 2

    @property
    def polar_moment(self) -> float:
        """The integral of |x|^2 over the grain, its moment of inertia about the centroid for density one."""
        return float(np.trace(self._moments.about_centroid()))

    @property
    def inertia(self) -> Floats:
        """The inertia (3, 3) about the centroid for unit density: in the plane only the 33 component."""
        return np.diag([0.0, 0.0, self.polar_moment])

    @abstractmethod
    def outline(self) -> tuple[Curve, ...]:
        """The surface as a closed counter-clockwise chain of curves in the body frame."""

    @cached_property
    def chain(self) -> Chain:
        """The outline with what is known of all its curves at once."""
        return Chain(self.outline())

    def drawn(self) -> tuple[Curve, ...]:
        """The outline as a mesh is made of it."""
        return self.chain.curves


@dataclass(frozen=True)
class Ellipse(Grain):
    """An ellipse with semi-axes along the body's first and second direction."""

    semi_axes: tuple[float, float]

    def __post_init__(self) -> None:
        require_positive("semi-axis", *self.semi_axes)

    @property
    def size(self) -> float:
        """Twice the larger semi-axis."""
        return 2.0 * max(self.semi_axes)

    @property
    def volume(self) -> float:
        """pi a b."""
        return float(np.pi * self.semi_axes[0] * self.semi_axes[1])

    @property
    def polar_moment(self) -> float:
        """pi a b (a^2 + b^2) / 4."""
        return 0.25 * self.volume * (self.semi_axes[0] ** 2 + self.semi_axes[1] ** 2)

    def level(self, x: ArrayLike) -> Floats:
        """min(a, b) (|(x1/a, x2/b)| - 1) at points (n, 2); for a circle the distance."""
        scaled = np.linalg.norm(rows(x) / np.asarray(self.semi_axes), axis=1)
        return np.asarray(min(self.semi_axes) * (scaled - 1.0))

    def normal(self, x: ArrayLike) -> Floats:
        """Outward unit normals (n, 2) of the similar ellipse through each of the points (n, 2)."""
        return unit(rows(x) / np.square(self.semi_axes))

    def outline(self) -> tuple[Curve, ...]:
        """Four quarter arcs."""
        a, b = self.semi_axes
        corners: list[Point] = [(a, 0.0), (0.0, b), (-a, 0.0), (0.0, -b)]
        major = None if a == b else corners[int(b > a)]
        return tuple(Arc(corners[k], (0.0, 0.0), corners[(k + 1) % 4], major) for k in range(4))


@dataclass(frozen=True)
class Disc(Ellipse):
    """A disc of the given diameter."""

    semi_axes: tuple[float, float] = field(init=False, repr=False)
    diameter: float

    def __post_init__(self) -> None:
        require_positive("diameter", self.diameter)
        object.__setattr__(self, "semi_axes", (0.5 * self.diameter, 0.5 * self.diameter))


@dataclass(frozen=True)
class Rectangle(Grain):
    """A rectangle whose corners are rounded by quarter circles of `corner_radius` (0: sharp)."""

    width: float
    height: float
    corner_radius: float = 0.0

    def __post_init__(self) -> None:
        require_positive("width", self.width)
        require_positive("height", self.height)
        if not 0.0 <= self.corner_radius <= 0.5 * min(self.width, self.height):
            raise SceneError(
                f"corner_radius {self.corner_radius} is not between 0 and half the shorter side; change it"
            )

    @property
    def _radius(self) -> float:
        """The corner radius, zero where it is lost in round-off beside the sides."""
        return (
            self.corner_radius if self.corner_radius > 1e-9 * min(self.width, self.height) else 0.0
        )

    @property
    def _core(self) -> Floats:
        """Half the sides of the rectangle that the corner circle is rolled around."""
        return 0.5 * np.array([self.width, self.height]) - self._radius

    @property
    def size(self) -> float:
        """The diagonal, less what the rounding takes off."""
        return float(2.0 * np.hypot(*self._core) + 2.0 * self._radius)

    @property
    def volume(self) -> float:
        """Width times height, less (4 - pi) corner_radius^2."""
        return float(self.width * self.height - (4.0 - np.pi) * self.corner_radius**2)

    @property
    def polar_moment(self) -> float:
        """The moment about the centroid: the sum over the core, its sides and the four quarter discs."""
        return float(np.trace(moments.rounded_box(self._core, self._radius).second))

    def level(self, x: ArrayLike) -> Floats:
        """The signed distance at points (n, 2)."""
        beyond = np.abs(rows(x)) - self._core
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        return np.asarray(outside + np.minimum(beyond.max(axis=1), 0.0) - self._radius)

    def normal(self, x: ArrayLike) -> Floats:
        """Outward unit normals (n, 2) at points (n, 2), at a sharp corner the bisector."""
        x = rows(x)
        beyond = np.abs(x) - self._core
        inside = (beyond <= 0.0).all(axis=1, keepdims=True)
        nearest_side = beyond == beyond.max(axis=1, keepdims=True)
        direction = np.where(inside, nearest_side, np.maximum(beyond, 0.0))
        return unit(direction * np.where(x < 0.0, -1.0, 1.0))

    def outline(self) -> tuple[Curve, ...]:
        """Bottom, right, top and left side with the corner arcs between; sides of no length are left out."""
        r = self._radius
        signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        outward = np.array([(0.0, -r), (r, 0.0), (0.0, r), (-r, 0.0)])
        centres = signs * self._core
        curves: list[Curve] = []
        for k in range(4):
            here, there = centres[k], centres[(k + 1) % 4]
            start, end = plain(here + outward[k]), plain(there + outward[k])
            if start != end:
                curves.append(Line(start, end))
            if r > 0.0:
                curves.append(Arc(end, plain(there), plain(there + outward[(k + 1) % 4])))
        return tuple(curves)

"""Smooth grains in the plane: superellipses and shapes with a radius r(angle).

Their outlines are known exactly; mesh generators are given splines through points of them that keep within
SPLINE_ERROR of the grain's size.
"""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, quarter_turned, rows, unit
from incipient.errors import SceneError
from incipient.geometry import moments
from incipient.geometry.plane.curves import Curve, Spline, Traced
from incipient.geometry.plane.grain import Grain
from incipient.geometry.shape import require_positive

SPLINE_ERROR = 1e-7  # of the splines that are meshed, in grain sizes
MAX_EXPONENT = 100.0
RADII = 2048  # angles of the trapezoidal rule for the integrals of stars: spectral accuracy


class Smooth(Grain):
    """A grain whose outline is a smooth closed curve over an angle."""

    @abstractmethod
    def trace(self, angle: Floats) -> tuple[Floats, Floats]:
        """Points (n, 2) of the outline at parameter angles (n,), and the derivatives by the angle (n, 2)."""

    def outline(self) -> tuple[Curve, ...]:
        """Four quarters, exact, with enough points for a spline."""
        return tuple(self._quarter(k) for k in range(4))

    def _quarter(self, k: int) -> Traced:
        path = _Quarter(self, 0.5 * pi * k)
        count = 96
        while count < 768 and self._spline_error(path, count) > SPLINE_ERROR * self.size:
            count *= 2
        return Traced(path(_crowded(count))[0], path)

    def _spline_error(self, path: Callable[[Floats], tuple[Floats, Floats]], count: int) -> float:
        """How far the spline through so many points leaves the curve."""
        spline = Spline(path(_crowded(count))[0])
        between = (np.arange(4 * count) + 0.5) / (4 * count)
        return float(np.abs(self.level(spline.point(between))).max())


@dataclass(frozen=True)
class _Quarter:
    """A quarter of an outline from an angle on; a class, because ranks exchange curves and closures do not pickle."""

    grain: Smooth
    start: float

    def __call__(self, s: Floats) -> tuple[Floats, Floats]:
        """Points (n, 2) and derivatives (n, 2) at parameters (n,) from 0 to 1."""
        sweep = 0.5 * pi
        point, derivative = self.grain.trace(self.start + sweep * s)
        return point, sweep * derivative


def _crowded(count: int) -> Floats:
    """Parameters from 0 to 1, ten times as dense at the ends, where splines have to guess their slope."""
    t = np.linspace(0.0, 1.0, count + 1)
    return np.asarray(t - 0.9 * np.sin(2.0 * pi * t) / (2.0 * pi))


@dataclass(frozen=True)
class Superellipse(Smooth):
    """|x/a|^n + |y/b|^n = 1 with the exponent n from 2 (an ellipse) to 100 (almost a box)."""

    semi_axes: tuple[float, float]
    exponent: float

    def __post_init__(self) -> None:
        require_positive("semi-axis", *self.semi_axes)
        if not 2.0 <= self.exponent <= MAX_EXPONENT:
            raise SceneError(
                f"exponent {self.exponent} is not between 2 and {MAX_EXPONENT:g}; change it"
            )

    @property
    def size(self) -> float:
        """Twice the largest |x| on the outline, by Hoelder's inequality."""
        return 2.0 * farthest(self.semi_axes, self.exponent)

    @property
    def volume(self) -> float:
        """4 a b times Dirichlet's integral of 1."""
        a, b = self.semi_axes
        return 4.0 * a * b * moments.dirichlet((1.0, 1.0), self.exponent)

    @property
    def polar_moment(self) -> float:
        """4 a b (a^2 + b^2) times Dirichlet's integral of u^2."""
        a, b = self.semi_axes
        return 4.0 * a * b * (a * a + b * b) * moments.dirichlet((3.0, 1.0), self.exponent)

    def level(self, x: ArrayLike) -> Floats:
        """min(a, b) ((|x/a|^n + |y/b|^n)^(1/n) - 1) at points (n, 2)."""
        scaled = np.abs(rows(x)) / np.asarray(self.semi_axes)
        return np.asarray(min(self.semi_axes) * (power_norm(scaled, self.exponent) - 1.0))

    def normal(self, x: ArrayLike) -> Floats:
        """Outward unit normals (n, 2) of the similar superellipse through each of the points (n, 2)."""
        scaled = rows(x) / np.asarray(self.semi_axes)
        scaled = scaled / np.maximum(np.abs(scaled).max(axis=1, keepdims=True), 1e-300)
        slope = (
            np.sign(scaled) * np.abs(scaled) ** (self.exponent - 1.0) / np.asarray(self.semi_axes)
        )
        return unit(slope)

    def trace(self, angle: Floats) -> tuple[Floats, Floats]:
        """Points and derivatives; the direction (a cos, b sin) is stretched to the outline."""
        n = self.exponent
        circle = np.column_stack([np.cos(angle), np.sin(angle)])
        along = quarter_turned(circle)
        length = power_norm(np.abs(circle), n)[:, None]
        rate = (np.sign(circle) * np.abs(circle) ** (n - 1.0) * along).sum(axis=1, keepdims=True)
        rate = rate * length ** (1.0 - n)
        axes = np.asarray(self.semi_axes)
        return axes * circle / length, axes * (along / length - circle * rate / length**2)


def power_norm(x: Floats, exponent: float) -> Floats:
    """(sum of x_i^n)^(1/n) along the last axis of numbers that are not negative, without overflow."""
    largest = np.maximum(x.max(axis=-1, keepdims=True), 1e-300)
    return np.asarray(
        largest[..., 0] * ((x / largest) ** exponent).sum(axis=-1) ** (1.0 / exponent)
    )


def farthest(semi_axes: Sequence[float], exponent: float) -> float:
    """The largest |x| with sum |x_i/a_i|^n = 1: the norm of a with the exponent 2n/(n-2) (Hoelder)."""
    a = np.asarray(semi_axes, dtype=float)
    if exponent <= 2.0:
        return float(a.max())
    return float(power_norm(a, 2.0 * exponent / (exponent - 2.0)))


@dataclass(frozen=True)
class Harmonics:
    """r(angle) = mean (1 + sum of cosines[k-1] cos(k angle) + sines[k-1] sin(k angle)), k = 1, 2, ..."""

    mean: float
    cosines: tuple[float, ...] = ()
    sines: tuple[float, ...] = ()

    def __call__(self, angle: Floats) -> Floats:
        """The radii (n,) at the angles (n,)."""
        a, b, k = self._table()
        phase = np.multiply.outer(np.asarray(angle, dtype=float), k)
        return np.asarray(self.mean * (1.0 + np.cos(phase) @ a + np.sin(phase) @ b))

    def slope(self, angle: Floats) -> Floats:
        """The derivatives of the radius by the angle, (n,)."""
        a, b, k = self._table()
        phase = np.multiply.outer(np.asarray(angle, dtype=float), k)
        return np.asarray(self.mean * (np.cos(phase) @ (k * b) - np.sin(phase) @ (k * a)))

    def _table(self) -> tuple[Floats, Floats, Floats]:
        count = max(len(self.cosines), len(self.sines))
        a, b = np.zeros(count), np.zeros(count)
        a[: len(self.cosines)], b[: len(self.sines)] = self.cosines, self.sines
        return a, b, np.arange(1.0, count + 1.0)


@dataclass(frozen=True)
class Star(Smooth):
    """A star-shaped grain: distance `radius(angle)` from a pole, smooth and positive, of period 2 pi.

    `radius` takes angles (n,) and returns lengths (n,); its derivative is its attribute `slope` if it has
    one (see `Harmonics`), else differences. The body frame is shifted to the centroid.
    """

    radius: Callable[[Floats], Floats]

    def __post_init__(self) -> None:
        angle = np.linspace(0.0, 2.0 * pi, 721)
        r = np.asarray(self.radius(angle), dtype=float)
        if r.shape != angle.shape or not np.isfinite(r).all():
            raise SceneError(
                "the radius of the star is not one finite number for each angle; change it"
            )
        if r.min() <= 0.0:
            worst = np.degrees(angle[np.argmin(r)])
            raise SceneError(
                f"the radius of the star is {r.min():.3g} at {worst:.0f} degrees; keep it positive"
            )
        if abs(r[0] - r[-1]) > 1e-9 * r.max():
            raise SceneError(
                "the radius of the star differs at 0 and 360 degrees; make it periodic"
            )

    @cached_property
    def _moments(self) -> moments.Moments:
        """Area, centroid and moment, by integrals of powers of r over the angle."""
        radii = np.asarray(self.radius(2.0 * pi * np.arange(RADII) / RADII), dtype=float)
        return moments.star_shape(*moments.circle_rule(RADII), radii)

    @property
    def pole(self) -> Floats:
        """Where the radius is measured from, in the body frame (2,)."""
        return -self._moments.centroid

    @cached_property
    def size(self) -> float:
        """The largest distance of two points of the outline, by sampling and refinement."""
        angle = 2.0 * pi * np.arange(512) / 512
        apart = np.linalg.norm(self.trace(angle)[0][:, None] - self.trace(angle)[0], axis=2)
        pair = angle[list(np.unravel_index(np.argmax(apart), apart.shape))]
        step = 2.0 * pi / 512
        while step > 1e-9:
            pairs = pair + step * np.array([[i, j] for i in (-1, 0, 1) for j in (-1, 0, 1)])
            ends = self.trace(pairs.ravel())[0].reshape(-1, 2, 2)
            best = int(np.argmax(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)))
            pair, step = pairs[best], step if best != 4 else 0.5 * step
        first, second = self.trace(pair)[0]
        return float(np.linalg.norm(first - second))

    def slope(self, angle: Floats) -> Floats:
        """dr/d(angle) at angles (n,)."""
        if hasattr(self.radius, "slope"):
            return np.asarray(self.radius.slope(angle), dtype=float)
        h = 1e-3
        near, far = (self.radius(angle + k * h) - self.radius(angle - k * h) for k in (1.0, 2.0))
        return np.asarray((8.0 * near - far) / (12.0 * h))

    def level(self, x: ArrayLike) -> Floats:
        """The distance from the pole less the radius in that direction, at points (n, 2)."""
        away = rows(x) - self.pole
        return np.asarray(
            np.linalg.norm(away, axis=1) - self.radius(np.arctan2(away[:, 1], away[:, 0]))
        )

    def normal(self, x: ArrayLike) -> Floats:
        """Outward unit normals (n, 2) of the level function at points (n, 2)."""
        away = rows(x) - self.pole
        length = np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-300)
        outward = away / length
        along = quarter_turned(outward)
        slope = self.slope(np.arctan2(away[:, 1], away[:, 0]))[:, None]
        gradient = outward - along * slope / length
        return unit(gradient)

    def trace(self, angle: Floats) -> tuple[Floats, Floats]:
        """Points and derivatives at polar angles about the pole."""
        r, slope = np.asarray(self.radius(angle))[:, None], self.slope(angle)[:, None]
        outward = np.column_stack([np.cos(angle), np.sin(angle)])
        along = quarter_turned(outward)
        return self.pole + r * outward, slope * outward + r * along

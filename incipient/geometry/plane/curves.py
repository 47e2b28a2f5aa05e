"""Plane curves of outlines and beds: straight lines, arcs of circles and ellipses, splines, exact smooth curves.

A curve runs from its start (s = 0) to its end (s = 1). Lengths are scene units.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, Point, unit
from incipient.geometry.placement import Placement

ORIGIN = Placement((0.0, 0.0))


class Curve(ABC):
    """A curve with a start and an end point."""

    start: Point
    end: Point

    @property
    @abstractmethod
    def length(self) -> float:
        """An estimate for choosing numbers of samples, exact for lines and circles."""

    @abstractmethod
    def point(self, s: ArrayLike) -> Floats:
        """Points at the parameters s (n,), (n, 2)."""

    @abstractmethod
    def derivative(self, s: ArrayLike) -> Floats:
        """Derivatives of the points by the parameter, (n, 2)."""

    @abstractmethod
    def moved(self, placement: Placement) -> "Curve":
        """The curve turned and carried from the body frame to its place in the scene."""

    def tangent(self, s: ArrayLike) -> Floats:
        """Unit tangents (n, 2)."""
        return unit(self.derivative(s))


@dataclass(frozen=True)
class Line(Curve):
    """The straight line from `start` to `end`."""

    start: Point
    end: Point

    @property
    def length(self) -> float:
        """The length of the line."""
        return float(np.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1]))

    def point(self, s: ArrayLike) -> Floats:
        """Points at the parameters s (n,), (n, 2); the end points come out exactly."""
        s = _column(s)
        return np.asarray((1.0 - s) * np.asarray(self.start) + s * np.asarray(self.end))

    def derivative(self, s: ArrayLike) -> Floats:
        """The vector from start to end, (n, 2)."""
        return np.tile(np.asarray(self.end) - np.asarray(self.start), (len(_column(s)), 1))

    def moved(self, placement: Placement) -> "Line":
        """The line at its place in the scene."""
        return Line(*_carried(placement, self.start, self.end))


@dataclass(frozen=True)
class Arc(Curve):
    """An arc of a circle or an ellipse of less than half a turn, the short way round from `start` to `end`.

    `major` is None for a circle; for an ellipse it is one end of the major axis (a vertex of the ellipse).
    """

    start: Point
    centre: Point
    end: Point
    major: Point | None = None

    @property
    def length(self) -> float:
        """The arc length for a circle; an upper estimate for an ellipse."""
        (a, _), _, (_, sweep) = self._shape
        return abs(sweep) * a

    @cached_property
    def _shape(self) -> tuple[tuple[float, float], Floats, tuple[float, float]]:
        """Semi-axes, rows of the principal frame, and (first eccentric angle, swept angle)."""
        ends = np.array([self.start, self.end]) - np.asarray(self.centre)
        axis = ends[0] if self.major is None else np.asarray(self.major) - np.asarray(self.centre)
        a = float(np.hypot(*axis))
        frame = np.array([axis, [-axis[1], axis[0]]]) / a
        local = ends @ frame.T
        b = a
        if self.major is not None:  # through the end farther from the major axis
            x, y = local[np.argmax(np.abs(local[:, 1]))]
            b = float(abs(y) / np.sqrt(1.0 - (x / a) ** 2))
        angles = np.arctan2(local[:, 1] / b, local[:, 0] / a)
        sweep = (angles[1] - angles[0] + np.pi) % (2.0 * np.pi) - np.pi
        return (a, b), frame, (float(angles[0]), float(sweep))

    def point(self, s: ArrayLike) -> Floats:
        """Points at the parameters s (n,), (n, 2); equal steps of s are equal steps of eccentric angle."""
        (a, b), frame, (first, sweep) = self._shape
        angle = first + sweep * _column(s)
        return np.asarray(self.centre) + np.hstack([a * np.cos(angle), b * np.sin(angle)]) @ frame

    def derivative(self, s: ArrayLike) -> Floats:
        """Derivatives (n, 2)."""
        (a, b), frame, (first, sweep) = self._shape
        angle = first + sweep * _column(s)
        return np.asarray(sweep * np.hstack([-a * np.sin(angle), b * np.cos(angle)]) @ frame)

    def moved(self, placement: Placement) -> "Arc":
        """The arc at its place in the scene."""
        start, centre, end = _carried(placement, self.start, self.centre, self.end)
        major = None if self.major is None else _carried(placement, self.major)[0]
        return Arc(start, centre, end, major)


@dataclass(frozen=True, eq=False)
class Spline(Curve):
    """A smooth curve through `points` (n, 2), n >= 4, at equal steps of the parameter.

    Between points it is a cubic whose end slopes are differences over the neighbours: the error falls with
    the fourth power of the spacing of evenly spaced points.
    """

    points: Floats
    start: Point = field(init=False)
    end: Point = field(init=False)

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=float)
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 4:
            raise ValueError("a spline needs at least four finite points of two coordinates")
        if not np.isfinite(points).all():
            raise ValueError("a spline needs at least four finite points of two coordinates")
        points.flags.writeable = False
        for name, value in (
            ("points", points),
            ("start", plain(points[0])),
            ("end", plain(points[-1])),
        ):
            object.__setattr__(self, name, value)

    @property
    def length(self) -> float:
        """The length of the polygon through the points, a little below that of the curve."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    @cached_property
    def _slopes(self) -> Floats:
        """Derivatives at the points per step of the index: central inside, cubic one-sided at the ends."""
        p = self.points
        slopes = np.gradient(p, axis=0)
        slopes[0] = (-11.0 * p[0] + 18.0 * p[1] - 9.0 * p[2] + 2.0 * p[3]) / 6.0
        slopes[-1] = (11.0 * p[-1] - 18.0 * p[-2] + 9.0 * p[-3] - 2.0 * p[-4]) / 6.0
        return slopes

    def _pieces(self, s: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Local parameter (n, 1), the two end points (n, 2, 2) and the two end slopes (n, 2, 2)."""
        index = _column(s) * (len(self.points) - 1)
        piece = np.clip(index[:, 0].astype(int), 0, len(self.points) - 2)
        ends = np.stack([piece, piece + 1], axis=1)
        return index - piece[:, None], self.points[ends], self._slopes[ends]

    def point(self, s: ArrayLike) -> Floats:
        """Points at the parameters s (n,), (n, 2)."""
        t, p, m = self._pieces(s)
        rise = t * t * (3.0 - 2.0 * t)
        bulge = t * (1.0 - t) ** 2 * m[:, 0] - t * t * (1.0 - t) * m[:, 1]
        return np.asarray((1.0 - rise) * p[:, 0] + rise * p[:, 1] + bulge)

    def derivative(self, s: ArrayLike) -> Floats:
        """Derivatives (n, 2)."""
        t, p, m = self._pieces(s)
        rise = 6.0 * t * (1.0 - t) * (p[:, 1] - p[:, 0])
        bend = (1.0 - t) * (1.0 - 3.0 * t) * m[:, 0] + t * (3.0 * t - 2.0) * m[:, 1]
        return np.asarray((len(self.points) - 1) * (rise + bend))

    def moved(self, placement: Placement) -> "Spline":
        """The spline at its place in the scene."""
        return Spline(placement.to_scene(self.points))


@dataclass(frozen=True, eq=False)
class Traced(Spline):
    """A quarter of a smooth outline, known exactly: `shape.trace` gives points and derivatives by an angle.

    Only mesh generators use the spline through `points`, which lie on the curve, the ends among them.
    """

    shape: Any  # with a method `trace`
    first: float  # angle at s = 0
    sweep: float  # angle from start to end
    placement: Placement = field(default=ORIGIN)

    def point(self, s: ArrayLike) -> Floats:
        """Points of the exact curve at the parameters s (n,), (n, 2)."""
        angle = self.first + self.sweep * _column(s)[:, 0]
        return self.placement.to_scene(self.shape.trace(angle)[0])

    def derivative(self, s: ArrayLike) -> Floats:
        """Derivatives (n, 2) of the exact curve."""
        angle = self.first + self.sweep * _column(s)[:, 0]
        return np.asarray(self.sweep * self.shape.trace(angle)[1] @ self.placement.rotation.T)

    def moved(self, placement: Placement) -> "Traced":
        """The curve at its place in the scene."""
        centre = placement.to_scene([self.placement.centre])[0]
        there = Placement(plain(centre), self.placement.angle + placement.angle)
        return replace(self, points=placement.to_scene(self.points), placement=there)


def part(curve: Curve, first: float, last: float) -> Curve:
    """The part of a curve between two parameters; of a spline one through as many points as the whole has."""
    if isinstance(curve, Line | Arc):
        start, end = (plain(row) for row in curve.point([first, last]))
        return replace(curve, start=start, end=end)
    assert isinstance(curve, Spline)
    return Spline(curve.point(np.linspace(first, last, len(curve.points))))


def plain(x: Floats) -> Point:
    """A point (2,) as a pair of plain numbers."""
    return float(x[0]), float(x[1])


def increasing_roots(
    values: Callable[[Floats], Floats], low: Floats, high: Floats, rounds: int = 60
) -> Floats:
    """Where functions (n,) of parameters (n,) change from negative to positive between `low` and `high`.

    An end where they do not. Chandrupatla's method (1997): inverse quadratic interpolation, bisection where that is
    not safe.
    """
    a, b = np.array(high, dtype=float), np.array(low, dtype=float)
    fa, fb = values(a), values(b)
    ends = np.where(fb >= 0.0, b, np.where(fa <= 0.0, a, np.nan))
    open_ = np.isnan(ends)
    fa, fb = np.where(open_, fa, 1.0), np.where(open_, fb, -1.0)
    t = np.full(len(a), 0.5)
    for _ in range(rounds if open_.any() else 0):
        x = a + t * (b - a)
        fx = np.where(open_, values(x), 0.0)
        same = np.sign(fx) == np.sign(fa)
        c, fc = np.where(same, a, b), np.where(same, fa, fb)
        b, fb = np.where(same, b, a), np.where(same, fb, fa)
        a, fa = x, fx
        slack = np.spacing(np.abs(a)) + 1e-12 * np.abs(high - low)
        narrow = 2.0 * slack / np.maximum(np.abs(b - a), 1e-300)
        if ((narrow > 1.0) | (fa == 0.0) | ~open_).all():
            break
        with np.errstate(divide="ignore", invalid="ignore"):
            xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
            inner = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (
                fc - fb
            )
        safe = (phi**2 < xi) & ((1.0 - phi) ** 2 < 1.0 - xi) & np.isfinite(inner)
        t = np.clip(
            np.where(safe, inner, 0.5), np.minimum(narrow, 0.5), 1.0 - np.minimum(narrow, 0.5)
        )
    best = np.where(np.abs(fa) < np.abs(fb), a, b)
    return np.where(open_, best, ends)


def _column(s: ArrayLike) -> Floats:
    return np.atleast_1d(np.asarray(s, dtype=float))[:, None]


def _carried(placement: Placement, *points: Point) -> list[Point]:
    return [plain(row) for row in placement.to_scene(np.array(points))]

"""Plane curves that outlines and beds are made of: straight lines, arcs of circles and ellipses, splines.

A curve runs from its start (s = 0) to its end (s = 1); `length` is an estimate for choosing numbers of samples, exact
for lines and circles; `moved` is the curve turned and carried from the body frame to its place. Lengths are scene
units.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, Point, unit
from incipient.geometry.placement import Placement


@dataclass(frozen=True)
class Line:
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

    def tangent(self, s: ArrayLike) -> Floats:
        """Unit tangents (n, 2), all equal."""
        direction = (np.asarray(self.end) - np.asarray(self.start)) / self.length
        return np.tile(direction, (len(_column(s)), 1))

    def moved(self, placement: Placement) -> "Line":
        """The line at its place in the scene."""
        start, end = _carried(placement, self.start, self.end)
        return Line(start, end)


@dataclass(frozen=True)
class Arc:
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
        (a, _), _, (_, sweep) = self._shape()
        return abs(sweep) * a

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
        (a, b), frame, (first, sweep) = self._shape()
        angle = first + sweep * _column(s)
        return np.asarray(self.centre) + np.hstack([a * np.cos(angle), b * np.sin(angle)]) @ frame

    def tangent(self, s: ArrayLike) -> Floats:
        """Unit tangents (n, 2)."""
        (a, b), frame, (first, sweep) = self._shape()
        angle = first + sweep * _column(s)
        direction = np.sign(sweep) * np.hstack([-a * np.sin(angle), b * np.cos(angle)]) @ frame
        return unit(direction)

    def moved(self, placement: Placement) -> "Arc":
        """The arc at its place in the scene."""
        start, centre, end = _carried(placement, self.start, self.centre, self.end)
        major = None if self.major is None else _carried(placement, self.major)[0]
        return Arc(start, centre, end, major)


@dataclass(frozen=True, eq=False)
class Spline:
    """A smooth curve through `points` (n, 2), n >= 4, at equal steps of the parameter.

    Between points it is a cubic whose end slopes are differences over the neighbours: the error falls with
    the fourth power of the spacing of evenly spaced points.
    """

    points: Floats

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=float)
        if (
            points.ndim != 2
            or points.shape[1] != 2
            or len(points) < 4
            or not np.isfinite(points).all()
        ):
            raise ValueError("a spline needs at least four finite points of two coordinates")
        points.flags.writeable = False
        object.__setattr__(self, "points", points)

    @property
    def start(self) -> Point:
        """The first point."""
        return plain(self.points[0])

    @property
    def end(self) -> Point:
        """The last point."""
        return plain(self.points[-1])

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

    def tangent(self, s: ArrayLike) -> Floats:
        """Unit tangents (n, 2)."""
        t, p, m = self._pieces(s)
        rise = 6.0 * t * (1.0 - t) * (p[:, 1] - p[:, 0])
        direction = rise + (1.0 - t) * (1.0 - 3.0 * t) * m[:, 0] + t * (3.0 * t - 2.0) * m[:, 1]
        return unit(direction)

    def moved(self, placement: Placement) -> "Spline":
        """The spline at its place in the scene."""
        return Spline(placement.to_scene(self.points))


@dataclass(frozen=True, eq=False)
class Traced(Spline):
    """A smooth curve known exactly: `path` gives points and derivatives (n, 2) at parameters s (n,).

    Only mesh generators go by the spline through `points`, which lie on the curve, the ends among them.
    """

    path: Callable[[Floats], tuple[Floats, Floats]]

    def point(self, s: ArrayLike) -> Floats:
        """Points of the exact curve at the parameters s (n,), (n, 2)."""
        return self.path(_column(s)[:, 0])[0]

    def tangent(self, s: ArrayLike) -> Floats:
        """Unit tangents (n, 2) of the exact curve."""
        direction = self.path(_column(s)[:, 0])[1]
        return unit(direction)

    def moved(self, placement: Placement) -> "Traced":
        """The curve at its place in the scene."""

        def carried(s: Floats) -> tuple[Floats, Floats]:
            """Points and derivatives in the scene."""
            point, derivative = self.path(s)
            return placement.to_scene(point), derivative @ placement.rotation.T

        return Traced(placement.to_scene(self.points), carried)


Curve = Line | Arc | Spline


def part(curve: Curve, first: float, last: float) -> Curve:
    """The part of a curve between two parameters; of a spline one through as many points as the whole has."""
    if isinstance(curve, Line | Arc):
        start, end = (plain(row) for row in curve.point([first, last]))
        return replace(curve, start=start, end=end)
    return Spline(curve.point(np.linspace(first, last, len(curve.points))))


def _column(s: ArrayLike) -> Floats:
    return np.atleast_1d(np.asarray(s, dtype=float))[:, None]


def plain(x: Floats) -> Point:
    """A point (2,) as a pair of plain numbers."""
    return float(x[0]), float(x[1])


def _carried(placement: Placement, *points: Point) -> list[Point]:
    return [plain(row) for row in placement.to_scene(np.array(points))]

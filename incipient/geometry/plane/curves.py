"""Plane curves of outlines and beds, from start (s = 0) to end (s = 1)."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, Point, unit
from incipient.geometry.placement import Placement


class Curve(ABC):
    """A curve with a start and an end point."""

    start: Point
    end: Point

    @property
    def length(self) -> float:
        """Estimate of the arc length, a little too small."""
        points = self.point(np.linspace(0.0, 1.0, 65))
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())

    @abstractmethod
    def point(self, s: ArrayLike) -> Floats:
        """Points (n, 2) at the parameters (n,)."""

    @abstractmethod
    def derivative(self, s: ArrayLike) -> Floats:
        """Derivatives (n, 2) with respect to the parameter."""

    def tangent(self, s: ArrayLike) -> Floats:
        return unit(self.derivative(s))

    def moved(self, placement: Placement) -> "Curve":
        points = {item.name: getattr(self, item.name) for item in fields(self)}  # type: ignore[arg-type]
        moved = {k: plain(placement.to_scene([x])[0]) for k, x in points.items() if x is not None}
        return replace(self, **moved)  # type: ignore[type-var]


@dataclass(frozen=True)
class Line(Curve):
    """The straight line from `start` to `end`."""

    start: Point
    end: Point

    @property
    def length(self) -> float:
        return float(np.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1]))

    def point(self, s: ArrayLike) -> Floats:
        s = _column(s)
        return np.asarray((1.0 - s) * np.asarray(self.start) + s * np.asarray(self.end))

    def derivative(self, s: ArrayLike) -> Floats:
        return np.tile(np.asarray(self.end) - np.asarray(self.start), (len(_column(s)), 1))


@dataclass(frozen=True)
class Arc(Curve):
    """An arc of a circle or an ellipse, less than half a turn the short way round.

    `major`: None for a circle, otherwise an end of the major axis.
    """

    start: Point
    centre: Point
    end: Point
    major: Point | None = None

    @cached_property
    def _axes(self) -> tuple[Floats, float, float]:
        ends = np.array([self.start, self.end]) - np.asarray(self.centre)
        axis = ends[0] if self.major is None else np.asarray(self.major) - np.asarray(self.centre)
        axes = np.array([axis, [-axis[1], axis[0]]])
        x, y = axes @ ends.T / (axis @ axis)
        if self.major is not None:  # through the end farther from the major axis
            k = np.argmax(np.abs(y))
            ratio = abs(y[k]) / np.sqrt(1.0 - x[k] ** 2)
            axes[1], y = ratio * axes[1], y / ratio
        angles = np.arctan2(y, x)
        sweep = (angles[1] - angles[0] + np.pi) % (2.0 * np.pi) - np.pi
        return axes, float(angles[0]), float(sweep)

    def point(self, s: ArrayLike) -> Floats:
        axes, first, sweep = self._axes
        angle = first + sweep * _column(s)
        return np.asarray(self.centre) + np.hstack([np.cos(angle), np.sin(angle)]) @ axes

    def derivative(self, s: ArrayLike) -> Floats:
        axes, first, sweep = self._axes
        angle = first + sweep * _column(s)
        return np.asarray(sweep * np.hstack([-np.sin(angle), np.cos(angle)]) @ axes)


@dataclass(frozen=True, eq=False)
class Spline(Curve):
    """The cubic spline through `points` (n, 2), n >= 3, at equal steps of the parameter."""

    points: Floats

    @property
    def start(self) -> Point:  # type: ignore[override]
        return plain(self.points[0])

    @property
    def end(self) -> Point:  # type: ignore[override]
        return plain(self.points[-1])

    @cached_property
    def _cubics(self) -> Any:
        from scipy.interpolate import CubicSpline  # which takes time to import

        return CubicSpline(np.linspace(0.0, 1.0, len(self.points)), self.points)

    def point(self, s: ArrayLike) -> Floats:
        return np.asarray(self._cubics(_column(s)[:, 0]))

    def derivative(self, s: ArrayLike) -> Floats:
        return np.asarray(self._cubics(_column(s)[:, 0], 1))

    def moved(self, placement: Placement) -> "Spline":
        return Spline(placement.to_scene(self.points))


def part(curve: Curve, first: float, last: float) -> Curve:
    """The part of a curve between two parameters."""
    if isinstance(curve, Spline):
        return Spline(curve.point(np.linspace(first, last, len(curve.points))))
    start, end = (plain(row) for row in curve.point([first, last]))
    return replace(curve, start=start, end=end)  # type: ignore[type-var]


def plain(x: Floats) -> Point:
    """A point (2,) as a pair of plain numbers."""
    return float(x[0]), float(x[1])


def increasing_roots(values: Callable[[Floats], Floats], low: Floats, high: Floats) -> Floats:
    """Parameters (n,) between bounds at which functions become positive, otherwise the nearer end.

    Chandrupatla's method (1997).
    """
    a, b = np.array(high, dtype=float), np.array(low, dtype=float)
    fa, fb = values(a), values(b)
    ends = np.where(fb >= 0.0, b, np.where(fa <= 0.0, a, np.nan))
    open_ = np.isnan(ends)
    fa, fb = np.where(open_, fa, 1.0), np.where(open_, fb, -1.0)
    t = np.full(len(a), 0.5)
    for _ in range(60 if open_.any() else 0):
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


def nearest_on_sides(x: Floats, starts: Floats, sides: Floats) -> tuple[np.ndarray, Floats]:
    """Numbers and parameters (n,) of the sides (m, 2) from starts (m, 2) nearest to points (n, 2)."""
    away = x[:, None] - starts
    s = np.clip((away * sides).sum(axis=2) / (sides * sides).sum(axis=1), 0.0, 1.0)
    k = ((away - s[..., None] * sides) ** 2).sum(axis=2).argmin(axis=1)
    return k, s[np.arange(len(x)), k]


def _column(s: ArrayLike) -> Floats:
    return np.atleast_1d(np.asarray(s, dtype=float))[:, None]

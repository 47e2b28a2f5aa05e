"""Rigid grains in 2-D: a level function f(x), negative inside, and an exact outline.

All grains live in their body frame: the origin is the centroid, the centre of mass of a uniform grain.
A `Placement` turns and carries the frame into the scene. Lengths are scene units, angles radians.
"""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from math import pi

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, Point, planar_cross, quarter_turned, rows, unit
from incipient.errors import SceneError
from incipient.geometry.plane.curves import Arc, Curve, Line, Spline, Traced, plain
from incipient.geometry.shape import (
    Balls,
    Moments,
    RoundedBox,
    Shape,
    checked_balls,
    largest_distance,
    require_exposed,
    require_positive,
)

NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
PANELS = 24  # of Gauss's rule on a curve that is no line or arc
SPLINE_ERROR = 1e-7  # of the splines that are meshed, in grain sizes
# Corners of a smaller radius, in grain sizes, are meshed in pieces that turn by no more than an angle.
BLUNT, TURN = 0.12, np.radians(20.0)
EVEN = 192  # points of such a piece
# Sharper corners than those of this exponent are narrower than cells of default size can follow.
MAX_EXPONENT = 20.0
RADII = 2048  # angles of the trapezoidal rule for the pole of stars: spectral accuracy
# In sizes of the polygon. Shorter sides than cells can follow are points of a curve; where a curve turns by more than
# CORNER within WINDOW to both sides it has a corner.
SHORT, WINDOW, CORNER = 0.01, 0.02, np.radians(30.0)
TABLE = 4_000_000  # numbers in a table of points or pairs that is dealt with at a time


@dataclass(frozen=True, eq=False)
class Chain:
    """Curves that follow each other and close, in the body frame, with what is known of all of them at once."""

    curves: tuple[Curve, ...]

    @cached_property
    def starts(self) -> Floats:
        """Where the curves begin, (n, 2)."""
        return np.array([curve.start for curve in self.curves])

    @cached_property
    def straight(self) -> np.ndarray:
        """Which curves are lines, (n,)."""
        return np.array([isinstance(curve, Line) for curve in self.curves])

    @cached_property
    def lengths(self) -> Floats:
        """Estimates of the arc lengths, exact for lines, (n,)."""
        return np.array([curve.length for curve in self.curves])

    @cached_property
    def sharp(self) -> np.ndarray:
        """Whether a curve begins at a corner, (n,)."""
        each = np.arange(len(self.curves))
        first, last = (self.tangent(each, np.full(len(each), s)) for s in (0.0, 1.0))
        return np.asarray(np.abs(first - np.roll(last, 1, axis=0)).max(axis=1) > 1e-9)

    @cached_property
    def _sides(self) -> Floats:
        """Vectors from start to end, (n, 2)."""
        return np.roll(self.starts, -1, axis=0) - self.starts

    def point(self, curve: np.ndarray, s: Floats) -> Floats:
        """Points (m, 2) on curves of the numbers (m,) at the parameters (m,)."""
        points = self.starts[curve] + s[:, None] * self._sides[curve]
        for k in np.unique(curve[~self.straight[curve]]):
            points[curve == k] = self.curves[k].point(s[curve == k])
        return np.asarray(points)

    def tangent(self, curve: np.ndarray, s: Floats) -> Floats:
        """Unit tangents (m, 2) there."""
        tangents = unit(self._sides[curve])
        for k in np.unique(curve[~self.straight[curve]]):
            tangents[curve == k] = self.curves[k].tangent(s[curve == k])
        return tangents

    def points(self, count: int) -> Floats:
        """Points (m, 2) in order: `count` on each curve that is not straight, of lines the start."""
        s = np.linspace(0.0, 1.0, count)
        if self.straight.all():
            return self.starts
        pairs = zip(self.curves, self.straight, strict=True)
        return np.vstack([curve.point([0.0] if straight else s) for curve, straight in pairs])


class Grain(Shape):
    """A rigid grain in 2-D."""

    gdim = 2

    @property
    def polar_moment(self) -> float:
        """The integral of |x|^2 over the grain, its moment of inertia about the centroid for density one."""
        return float(np.trace(self.moments.about_centroid()))

    @cached_property
    def moments(self) -> Moments:
        """Area, first and second moments, by quadrature along the outline."""
        return moments_within(self.chain.curves)

    @property
    def inertia(self) -> Floats:
        """The inertia (3, 3) about the centroid for unit density: in 2-D only the 33 component."""
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
class Rectangle(RoundedBox, Grain):
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
    def rounding(self) -> float:
        """The corner radius, zero where it is lost in round-off beside the sides."""
        return (
            self.corner_radius if self.corner_radius > 1e-9 * min(self.width, self.height) else 0.0
        )

    @property
    def core(self) -> Floats:
        """Half the sides of the rectangle that the corner circle is rolled around."""
        return 0.5 * np.array([self.width, self.height]) - self.rounding

    def outline(self) -> tuple[Curve, ...]:
        """Bottom, right, top and left side with the corner arcs between; sides of no length are left out."""
        r = self.rounding
        signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        outward = np.array([(0.0, -r), (r, 0.0), (0.0, r), (-r, 0.0)])
        centres = signs * self.core
        curves: list[Curve] = []
        for k in range(4):
            here, there = centres[k], centres[(k + 1) % 4]
            start, end = plain(here + outward[k]), plain(there + outward[k])
            if start != end:
                curves.append(Line(start, end))
            if r > 0.0:
                curves.append(Arc(end, plain(there), plain(there + outward[(k + 1) % 4])))
        return tuple(curves)


def moments_within(curves: Sequence[Curve]) -> Moments:
    """The integrals over what curves enclose counter-clockwise, by Gauss's rule along them."""
    points, normals = [], []
    for curve in curves:
        panels = 1 if isinstance(curve, Line | Arc) else PANELS
        s = ((np.arange(panels)[:, None] + 0.5 + 0.5 * NODES) / panels).ravel()
        points.append(curve.point(s))
        weight = np.tile(0.5 * WEIGHTS / panels, panels)[:, None]
        normals.append(-quarter_turned(curve.derivative(s)) * weight)
    return Moments.swept(np.vstack(points), np.vstack(normals))


class Smooth(Grain):
    """A grain whose outline is a smooth closed curve over an angle."""

    @abstractmethod
    def trace(self, angle: Floats) -> tuple[Floats, Floats]:
        """Points (n, 2) of the outline at parameter angles (n,), and the derivatives by the angle (n, 2)."""

    def outline(self) -> tuple[Curve, ...]:
        """Four quarters, exact, with enough points for a spline."""
        return tuple(self._traced(0.5 * pi * k, 0.5 * pi * (k + 1)) for k in range(4))

    def drawn(self) -> tuple[Curve, ...]:
        """The quarters, cut in blunt corners so that no cell turns by more than TURN."""
        cuts = [0.5 * pi * k + self._cuts(0.5 * pi * k) for k in range(4)]
        if all(len(quarter) == 2 for quarter in cuts):
            return self.chain.curves
        return tuple(self._even(a, b) for quarter in cuts for a, b in pairwise(quarter))

    def _cuts(self, first: float) -> Floats:
        """Angles (n,) from the start of a quarter: its ends, and equal turns where the curvature is large."""
        angle = np.linspace(0.0, 0.5 * pi, 2049)
        rate = self.trace(first + angle)[1]
        turn = np.diff(np.unwrap(np.arctan2(rate[:, 1], rate[:, 0])))
        length = np.linalg.norm(rate[1:], axis=1) * angle[1]
        turned = np.cumsum(np.where(turn * BLUNT * self.size > length, turn, 0.0))
        count = int(np.ceil(turned[-1] / TURN))
        inner = angle[
            1 + np.searchsorted(turned, turned[-1] * (np.arange(count + 1) + 1e-9) / (count + 1e-6))
        ]
        return np.unique([0.0, *(inner if count else ()), 0.5 * pi])

    def _even(self, first: float, last: float) -> Spline:
        """A spline through points of the outline between two angles, evenly spaced: so are the nodes of its cells."""
        angle = np.linspace(first, last, 4097)
        way = np.cumsum(np.linalg.norm(self.trace(0.5 * (angle[1:] + angle[:-1]))[1], axis=1))
        at = np.interp(np.linspace(0.0, way[-1], EVEN + 1), np.append(0.0, way), angle)
        return Spline(self.trace(at)[0])

    def _traced(self, first: float, last: float) -> Traced:
        """The outline between two angles, with enough points for a spline."""
        sweep, count = last - first, 96
        while True:
            points = self.trace(first + sweep * _crowded(count))[0]
            between = Spline(points).point((np.arange(4 * count) + 0.5) / (4 * count))
            if count == 768 or np.abs(self.level(between)).max() <= SPLINE_ERROR * self.size:
                return Traced(points, self, first, sweep)
            count *= 2


def _crowded(count: int) -> Floats:
    """Parameters from 0 to 1, ten times as dense at the ends, where splines have to guess their slope."""
    t = np.linspace(0.0, 1.0, count + 1)
    return np.asarray(t - 0.9 * np.sin(2.0 * pi * t) / (2.0 * pi))


@dataclass(frozen=True)
class Superellipse(Smooth):
    """|x/a|^n + |y/b|^n = 1 with the exponent n from 2 (an ellipse) to 20 (almost a box)."""

    semi_axes: tuple[float, float]
    exponent: float

    def __post_init__(self) -> None:
        require_positive("semi-axis", *self.semi_axes)
        if not 2.0 <= self.exponent <= MAX_EXPONENT:
            raise SceneError(
                f"exponent {self.exponent:g} is not between 2 and {MAX_EXPONENT:g}: corners of larger ones are too "
                "sharp to be meshed; use a rectangle with a corner_radius"
            )

    @property
    def size(self) -> float:
        """Twice the largest |x| on the outline, by Hoelder's inequality."""
        return 2.0 * farthest(self.semi_axes, self.exponent)

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
class Star(Smooth):
    """A star-shaped grain: harmonics give the distance from a pole towards an angle, which is positive.

    r(angle) = mean (1 + sum of cosines[k-1] cos(k angle) + sines[k-1] sin(k angle)), k = 1, 2, ... The body frame is
    shifted to the centroid. Raises SceneError if r is not positive everywhere.
    """

    mean: float
    cosines: tuple[float, ...] = ()
    sines: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        angle = np.linspace(0.0, 2.0 * pi, 721)
        r = self.radius(angle)
        if not r.min() > 0.0:
            worst = np.degrees(angle[np.argmin(r)])
            raise SceneError(
                f"the radius of the star is {r.min():.3g} at {worst:.0f} degrees; keep it positive"
            )

    @cached_property
    def _coefficients(self) -> Floats:
        """c (n,) of r = mean (1 + Re sum c_k exp(i k angle))."""
        c = np.zeros(max(len(self.cosines), len(self.sines)), dtype=complex)
        c[: len(self.cosines)] += self.cosines
        c[: len(self.sines)] -= 1j * np.array(self.sines)
        return c

    def _harmonics(self, angle: Floats) -> np.ndarray:
        """exp(i k angle) for angles (n,), (n, harmonics)."""
        return np.exp(1j * np.multiply.outer(angle, np.arange(1, len(self._coefficients) + 1)))

    def radius(self, angle: Floats) -> Floats:
        """The distances (n,) from the pole towards the angles (n,)."""
        return np.asarray(self.mean * (1.0 + (self._harmonics(angle) @ self._coefficients).real))

    def slope(self, angle: Floats) -> Floats:
        """dr/d(angle) at angles (n,)."""
        c = self._coefficients
        return np.asarray(
            self.mean * (self._harmonics(angle) @ (1j * c * np.arange(1, len(c) + 1))).real
        )

    @cached_property
    def pole(self) -> Floats:
        """Where the radius is measured from, in the body frame (2,)."""
        angle = 2.0 * pi * np.arange(RADII) / RADII
        radius = self.radius(angle)
        outward = np.column_stack([np.cos(angle), np.sin(angle)])
        return np.asarray(-2.0 / 3.0 * (radius**3) @ outward / (radius**2).sum())

    @cached_property
    def size(self) -> float:
        """The largest distance of two points of the outline, by sampling and refinement."""
        angle = 2.0 * pi * np.arange(512) / 512
        apart = np.linalg.norm(self.trace(angle)[0][:, None] - self.trace(angle)[0], axis=2)
        pair = angle[list(np.unravel_index(np.argmax(apart), apart.shape))]
        steps = np.array([[i, j] for i in (-1, 0, 1) for j in (-1, 0, 1)])
        for step in 2.0 * pi / 512 * 0.5 ** np.repeat(np.arange(24), 2):
            pairs = pair + step * steps
            ends = self.trace(pairs.ravel())[0].reshape(-1, 2, 2)
            pair = pairs[int(np.argmax(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)))]
        first, second = self.trace(pair)[0]
        return float(np.linalg.norm(first - second))

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
        r, slope = self.radius(angle)[:, None], self.slope(angle)[:, None]
        outward = np.column_stack([np.cos(angle), np.sin(angle)])
        along = quarter_turned(outward)
        return self.pole + r * outward, slope * outward + r * along


@dataclass(frozen=True)
class Polygon(Grain):
    """A simple polygon, convex or not; vertices in either sense; they are shifted to the centroid."""

    vertices: tuple[Point, ...]

    def __init__(self, vertices: Sequence[Sequence[float]] | Floats) -> None:
        corners = np.array(vertices, dtype=float)
        if (
            corners.ndim != 2
            or corners.shape[1] != 2
            or len(corners) < 3
            or not np.isfinite(corners).all()
        ):
            raise SceneError(
                "a polygon needs at least three vertices of two finite coordinates; add them"
            )
        corners = _centred(corners)
        _require_simple(corners)
        object.__setattr__(self, "vertices", tuple((float(x), float(y)) for x, y in corners))

    @cached_property
    def _corners(self) -> Floats:
        return np.array(self.vertices)

    @cached_property
    def size(self) -> float:
        """The largest distance of two vertices."""
        return largest_distance(self._corners)

    @cached_property
    def moments(self) -> Moments:
        """Area, first and second moments: the sum over the triangles that the sides form with the centroid."""
        return Moments.within(np.stack([self._corners, np.roll(self._corners, -1, axis=0)], axis=1))

    def _nearest(self, x: Floats) -> Floats:
        """Distances of points (n, 2) from each side, (n, sides)."""
        start = self._corners
        side = np.roll(start, -1, axis=0) - start
        from_start = x[:, None] - start
        s = np.clip((from_start * side).sum(-1) / (side * side).sum(-1), 0.0, 1.0)
        return np.asarray(np.linalg.norm(from_start - s[..., None] * side, axis=2))

    def _inside(self, x: Floats) -> Floats:
        """-1 where a ray to the right crosses the outline an odd number of times, else 1; (n,)."""
        start = self._corners
        end = np.roll(start, -1, axis=0)
        y = x[:, 1, None]
        straddles = (start[:, 1] > y) != (end[:, 1] > y)
        rise = np.where(start[:, 1] == end[:, 1], 1.0, end[:, 1] - start[:, 1])
        crossing = start[:, 0] + (y - start[:, 1]) / rise * (end[:, 0] - start[:, 0])
        odd = (straddles & (x[:, 0, None] < crossing)).sum(axis=1) % 2
        return np.where(odd == 1, -1.0, 1.0)

    def _parts(self, x: Floats) -> list[Floats]:
        """Points (n, 2) in parts whose tables of points and sides stay small."""
        return np.array_split(x, 1 + len(x) * len(self.vertices) // TABLE)

    def level(self, x: ArrayLike) -> Floats:
        """The signed distance at points (n, 2)."""
        parts = self._parts(rows(x))
        return np.concatenate(
            [self._inside(part) * self._nearest(part).min(axis=1) for part in parts]
        )

    def normal(self, x: ArrayLike) -> Floats:
        """The normals (n, 2) of the side nearest to each of the points (n, 2), at a corner the bisector."""
        side = np.roll(self._corners, -1, axis=0) - self._corners
        outward = unit(-quarter_turned(side))
        result = []
        for part in self._parts(rows(x)):
            distance = self._nearest(part)
            # Sides that are equally near, to round-off, meet in a corner and share the normal.
            nearest = distance <= distance.min(axis=1, keepdims=True) + 1e-12 * self.size
            result.append(unit(nearest.astype(float) @ outward))
        return np.concatenate(result)

    def outline(self) -> tuple[Curve, ...]:
        """One line a side."""
        corners = self.vertices
        return tuple(Line(corners[k], corners[(k + 1) % len(corners)]) for k in range(len(corners)))

    def drawn(self) -> tuple[Curve, ...]:
        """The outline as a mesh is made of it: short sides in a row are one smooth curve through their vertices."""
        return self._drawn

    @cached_property
    def _drawn(self) -> tuple[Curve, ...]:
        short = self.chain.lengths < SHORT * self.size
        turns = _is_turn(self._corners, self.chain.lengths, self.size)
        knots = np.flatnonzero(~(short & np.roll(short, 1)) | turns)
        if len(knots) == len(short):
            return self.chain.curves
        closed = np.vstack([self._corners, self._corners])
        # A closed curve is drawn in parts that each go less than half the way round.
        knots = np.union1d(knots, np.arange(4) * len(short) // 4 if len(knots) < 2 else knots)
        return tuple(
            _through(closed[first : last + 1])
            for first, last in zip(knots, np.append(knots[1:], knots[0] + len(short)), strict=True)
        )

    @property
    def smoothed(self) -> "Polygon | None":
        """This grain with the smooth outline that its mesh has; None where that is its own outline."""
        return None if self._drawn == self.chain.curves else _Smoothed(self.vertices)


class _Smoothed(Polygon):
    """A polygon with curves in place of its short sides."""

    def outline(self) -> tuple[Curve, ...]:
        """Lines, and smooth curves through the vertices between short sides."""
        return Polygon(self.vertices).drawn()


def _through(points: Floats) -> Curve:
    """The line between two points, or a smooth curve through more."""
    if len(points) == 2:
        return Line(plain(points[0]), plain(points[1]))
    while len(points) < 4:
        middles = 0.5 * (points[1:] + points[:-1])
        points = np.insert(points, np.arange(1, len(points)), middles, axis=0)
    return Spline(points)


def _is_turn(corners: Floats, lengths: Floats, size: float) -> np.ndarray:
    """Vertices (n,) at which the outline, seen from WINDOW to both sides, turns most and by more than CORNER."""
    n, window = len(corners), WINDOW * size
    way = np.concatenate([[0.0], np.cumsum(lengths)])
    whole, at = way[-1], way[:-1]
    closed = np.vstack([corners, corners[:1]])

    def along(s: Floats) -> Floats:
        """Points of the outline after ways (m,) along it."""
        return np.column_stack([np.interp(s % whole, way, closed[:, k]) for k in (0, 1)])

    before, after = corners - along(at - window), along(at + window) - corners
    turn = np.abs(np.arctan2(planar_cross(before, after), (before * after).sum(axis=1)))
    candidates = np.flatnonzero(turn > CORNER)
    result = np.zeros(n, dtype=bool)
    for k in candidates[np.argsort(-turn[candidates], kind="stable")]:
        apart = np.abs(at[result] - at[k])
        if not (np.minimum(apart, whole - apart) < window).any():
            result[k] = True
    return result


def meeting_sides(corners: Floats) -> tuple[int, int] | None:
    """The first two sides, by numbers, of a polygon (n, 2) that cross or touch without being neighbours."""
    start, end = corners, np.roll(corners, -1, axis=0)
    low, high, n = np.minimum(start, end), np.maximum(start, end), len(corners)
    # Sides overlap along the axis along which fewer of them do; one side and the next, the next but one, ...
    orders = [np.argsort(low[:, axis], kind="stable") for axis in (0, 1)]
    ahead = [
        np.searchsorted(low[order, axis], high[order, axis], side="right") - np.arange(n) - 1
        for axis, order in enumerate(orders)
    ]
    axis = int(np.argmin([count.sum() for count in ahead]))
    order, count, pairs = orders[axis], ahead[axis], list[tuple[int, int]]()
    rows = np.argsort(-count, kind="stable")
    for step in range(1, int(count.max(initial=0)) + 1):
        rows = rows[: np.searchsorted(-count[rows], -step, side="right")]
        i, j = np.sort([order[rows], order[rows + step]], axis=0)
        close = ((low[i] <= high[j]) & (low[j] <= high[i])).all(axis=1)
        close &= (j - i > 1) & (j - i < n - 1)
        i, j = i[close], j[close]
        meet = _straddles(start[i], end[i], start[j], end[j])
        meet &= _straddles(start[j], end[j], start[i], end[i])
        pairs += zip(i[meet].tolist(), j[meet].tolist(), strict=True)
    return min(pairs, default=None)


def _straddles(a: Floats, b: Floats, c: Floats, d: Floats) -> np.ndarray:
    """Whether the lines through a-b pass between, or through, c and d; (m,) for points (m, 2) each."""
    return np.asarray(
        np.sign(planar_cross(b - a, c - a)) * np.sign(planar_cross(b - a, d - a)) <= 0.0
    )


def _centred(corners: Floats) -> Floats:
    """The polygon's corners (n, 2) counter-clockwise with the centroid at the origin."""
    corners = corners - corners.mean(axis=0)
    whole = Moments.within(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1))
    if abs(whole.volume) <= 1e-12 * np.ptp(corners, axis=0).max() ** 2:
        raise SceneError("the polygon has no area; give vertices that are not all on one line")
    return (corners - whole.centroid)[:: 1 if whole.volume > 0.0 else -1]


def _require_simple(corners: Floats) -> None:
    """Refuse repeated vertices and sides that cross."""
    repeated = (corners == np.roll(corners, -1, axis=0)).all(axis=1)
    if repeated.any():
        raise SceneError(f"polygon vertex {int(np.argmax(repeated))} is repeated; leave one out")
    if meeting_sides(corners) is not None:
        raise SceneError("the polygon's sides cross; list the vertices in order around it")


@dataclass(frozen=True, eq=False)
class Arcs:
    """The exposed arcs (k,) of discs: which disc they belong to, from and to which angle, counter-clockwise."""

    owner: np.ndarray
    start: Floats
    end: Floats


def exposed_arcs(centres: Floats, radii: Floats) -> Arcs:
    """The parts of the circles (n,) that lie in no other disc; of equal discs the last counts."""
    result: list[tuple[int, float, float]] = []
    number = np.arange(len(radii))
    for i, (centre, radius) in enumerate(zip(centres, radii, strict=True)):
        away = centres - centre
        d = np.linalg.norm(away, axis=1)
        around = (d <= radii - radius) & ((radii > radius) | (number > i))
        if around.any():
            continue
        cuts = (d < radii + radius) & (d > np.abs(radii - radius))
        middle = np.arctan2(away[cuts, 1], away[cuts, 0])
        half = np.arccos((d[cuts] ** 2 + radius**2 - radii[cuts] ** 2) / (2.0 * d[cuts] * radius))
        ends = np.sort(np.concatenate([middle - half, middle + half]) % (2.0 * pi))
        for first, last in zip(ends, np.append(ends[1:], ends[:1] + 2.0 * pi), strict=True):
            turn = np.abs((0.5 * (first + last) - middle + pi) % (2.0 * pi) - pi)
            if last > first and (turn >= half).all():
                result.append((i, first, last))
        if not len(ends):
            result.append((i, 0.0, 2.0 * pi))
    owner, start, end = np.array(result, dtype=float).reshape(-1, 3).T
    return Arcs(owner.astype(int), start, end)


def moments_of_arcs(arcs: Arcs, centres: Floats, radii: Floats) -> Moments:
    """The integrals over the union of discs from its exposed arcs, by Gauss's rule on quarters of each."""
    s = ((np.arange(4)[:, None] + 0.5 + 0.5 * NODES) / 4.0).ravel()
    sweep, r = (arcs.end - arcs.start)[:, None, None], radii[arcs.owner, None, None]
    angle = arcs.start[:, None] + sweep[..., 0] * s
    outward = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    points = centres[arcs.owner, None] + r * outward
    normals = r * sweep * outward * np.tile(0.125 * WEIGHTS, 4)[:, None]
    return Moments.swept(points.reshape(-1, 2), normals.reshape(-1, 2))


@dataclass(frozen=True, init=False)
class Discs(Balls, Grain):
    """Discs that hang together without enclosing a hole; they are shifted to the centroid of their union.

    Raises SceneError if the numbers are no discs, if a disc lies within others or touches none.
    """

    centres: tuple[Point, ...]
    radii: tuple[float, ...]

    def __init__(
        self, centres: Sequence[Sequence[float]] | Floats, radii: Sequence[float] | Floats
    ) -> None:
        points, sizes = checked_balls(centres, radii, 2)
        arcs = exposed_arcs(points, sizes)
        require_exposed(arcs.owner, len(sizes), "disc")
        points = points - moments_of_arcs(arcs, points, sizes).centroid
        object.__setattr__(self, "centres", tuple((float(x), float(y)) for x, y in points))
        object.__setattr__(self, "radii", tuple(float(r) for r in sizes))
        _ = self.chain  # refuses holes, and is kept

    def outline(self) -> tuple[Curve, ...]:
        """Arcs of at most a quarter turn, joined in exact corners."""
        return _outline(exposed_arcs(*self.tables), *self.tables)


def _outline(arcs: Arcs, centres: Floats, radii: Floats) -> tuple[Curve, ...]:
    """The exposed arcs of discs in order around their union."""
    order = _chained(arcs, centres, radii)
    corners = [_on_circle(centres, radii, int(arcs.owner[k]), float(arcs.start[k])) for k in order]
    curves: list[Curve] = []
    for position, k in enumerate(order):
        owner = int(arcs.owner[k])
        pieces = int(np.ceil((arcs.end[k] - arcs.start[k]) / (0.5 * pi) - 1e-9))
        angles = np.linspace(arcs.start[k], arcs.end[k], max(pieces, 1) + 1)[1:-1]
        inner = [_on_circle(centres, radii, owner, float(angle)) for angle in angles]
        stations = [corners[position], *inner, corners[(position + 1) % len(corners)]]
        curves += [Arc(a, plain(centres[owner]), b) for a, b in pairwise(stations)]
    return tuple(curves)


def _on_circle(centres: Floats, radii: Floats, owner: int, angle: float) -> Point:
    return plain(centres[owner] + radii[owner] * np.array([np.cos(angle), np.sin(angle)]))


def _chained(arcs: Arcs, centres: Floats, radii: Floats) -> list[int]:
    """The arcs in order around the outline."""
    towards = [np.column_stack([np.cos(a), np.sin(a)]) for a in (arcs.start, arcs.end)]
    starts, ends = (centres[arcs.owner] + radii[arcs.owner, None] * d for d in towards)
    following = np.argmin(np.linalg.norm(ends[:, None] - starts, axis=2), axis=1)
    order = [_rightmost(arcs, centres, radii)]
    while int(following[order[-1]]) != order[0] and len(order) <= len(following):
        order.append(int(following[order[-1]]))
    if len(order) != len(following):
        raise SceneError("the discs enclose a hole; fill it with a disc")
    return order


def _rightmost(arcs: Arcs, centres: Floats, radii: Floats) -> int:
    """An arc of the outer boundary: the one that reaches farthest to the right."""
    through = (arcs.start <= 0.0) | (arcs.end >= 2.0 * pi)
    ends = np.maximum(np.cos(arcs.start), np.cos(arcs.end))
    reach = centres[arcs.owner, 0] + radii[arcs.owner] * np.where(through, 1.0, ends)
    return int(np.argmax(reach))

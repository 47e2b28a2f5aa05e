"""Rigid grains in 2-D, in their body frame with the centroid at the origin."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from math import pi

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, Point, planar_cross, quarter_turned, rows, spatial, unit
from incipient.errors import SceneError
from incipient.geometry.plane.curves import (
    Arc,
    Curve,
    Line,
    Spline,
    increasing_roots,
    nearest_on_sides,
    plain,
)
from incipient.geometry.shape import (
    Balls,
    Moments,
    Shape,
    largest_distance,
)
from incipient.geometry.triangles import neighbours

NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)
TURN = np.radians(25.0)  # of a spline: corners that are small beside cells keep their shape
# In sizes of the polygon. Shorter sides than cells can follow are points of a curve; where a curve turns by more than
# CORNER within WINDOW to both sides it has a corner.
SHORT, WINDOW, CORNER = 0.01, 0.02, np.radians(30.0)


@dataclass(frozen=True, eq=False)
class Chain:
    """Closed chain of curves in the body frame, evaluated together."""

    curves: tuple[Curve, ...]

    @cached_property
    def starts(self) -> Floats:
        return np.array([curve.start for curve in self.curves])

    @cached_property
    def straight(self) -> np.ndarray:
        return np.array([isinstance(curve, Line) for curve in self.curves])

    @cached_property
    def lengths(self) -> Floats:
        return np.array([curve.length for curve in self.curves])

    @cached_property
    def sharp(self) -> np.ndarray:
        each = np.arange(len(self.curves))
        first, last = (self.tangent(each, np.full(len(each), s)) for s in (0.0, 1.0))
        # Tangents that differ by more meet in a corner.
        return np.asarray(np.abs(first - np.roll(last, 1, axis=0)).max(axis=1) > 1e-5)

    @cached_property
    def _sides(self) -> Floats:
        return np.roll(self.starts, -1, axis=0) - self.starts

    def point(self, curve: np.ndarray, s: Floats) -> Floats:
        return self._curved("point", curve, s, self.starts[curve] + s[:, None] * self._sides[curve])

    def derivative(self, curve: np.ndarray, s: Floats) -> Floats:
        return self._curved("derivative", curve, s, self._sides[curve])

    def tangent(self, curve: np.ndarray, s: Floats) -> Floats:
        return unit(self.derivative(curve, s))

    def _curved(self, name: str, curve: np.ndarray, s: Floats, table: Floats) -> Floats:
        for k in np.unique(curve[~self.straight[curve]]):
            table[curve == k] = getattr(self.curves[k], name)(s[curve == k])
        return table

    def samples(self, steps: np.ndarray) -> tuple[np.ndarray, Floats]:
        """Curves and parameters (m,) in order, with steps (n,) for each curve."""
        s = np.concatenate([np.arange(count) / count for count in steps])
        return np.repeat(np.arange(len(steps)), steps), s

    def points(self, count: int) -> Floats:
        """Points (m, 2) in order: `count` on each curved piece, of lines the start."""
        return self.point(*self.samples(np.where(self.straight, 1, count - 1)))

    def nearest(self, x: Floats) -> tuple[np.ndarray, Floats]:
        """Curves and parameters (m,) of the points of the outline nearest to points (m, 2)."""
        # Samples of curves between which their nearest points are sought
        steps = np.where(self.straight, 1, 64)
        curve, s = self.samples(steps)
        vertices = self.point(curve, s)
        parts = np.array_split(x, 1 + len(x) * len(s) // 4_000_000)  # so that tables stay small
        sides = np.roll(vertices, -1, axis=0) - vertices
        k = np.concatenate([nearest_on_sides(part, vertices, sides)[0] for part in parts])
        curve, s, step = curve[k], s[k], 1.0 / steps[curve[k]]
        low, high = np.maximum(s - 0.5 * step, 0.0), np.minimum(s + 1.5 * step, 1.0)

        def approach(s: Floats) -> Floats:
            return np.asarray(((self.point(curve, s) - x) * self.derivative(curve, s)).sum(axis=1))

        return curve, increasing_roots(approach, low, high)


class Grain(Shape):
    """A rigid grain in 2-D, defined by its outline."""

    gdim = 2

    @abstractmethod
    def outline(self) -> tuple[Curve, ...]:
        """Closed counter-clockwise chain of curves in the body frame."""

    @cached_property
    def chain(self) -> Chain:
        return Chain(self.outline())

    @cached_property
    def moments(self) -> Moments:
        return moments_within(self.chain)

    @property
    def inertia(self) -> Floats:
        return np.diag([0.0, 0.0, np.trace(self.moments.about_centroid())])

    def level(self, x: ArrayLike) -> Floats:
        x = rows(x)
        away = x - self.chain.point(*(place := self.chain.nearest(x)))
        return np.linalg.norm(away, axis=1) * np.sign((away * self._normal(*place)).sum(axis=1))

    def normal(self, x: ArrayLike) -> Floats:
        return self._normal(*self.chain.nearest(rows(x)))

    def extreme(self, direction: Floats) -> Floats:
        """The point (2,) farthest in a direction, to 1e-7 of the grain's size."""
        return np.asarray(self._outline[np.argmax(self._outline @ direction)])

    @cached_property
    def _outline(self) -> Floats:
        return self.chain.points(2049)

    def _normal(self, curve: np.ndarray, s: Floats) -> Floats:
        side = np.where(s < 1e-9, -1, np.where(s > 1.0 - 1e-9, 1, 0))
        beside = (curve + side) % len(self.chain.curves), np.where(side, 0.5 - 0.5 * side, s)
        return -quarter_turned(unit(self.chain.tangent(curve, s) + self.chain.tangent(*beside)))


def moments_within(chain: Chain) -> Moments:
    """Moments within counter-clockwise curves, by Gauss's rule along them."""
    panels = np.where(chain.straight, 1, 96)  # of each curve
    curve, s = (np.repeat(table, len(NODES)) for table in chain.samples(panels))
    nodes, weights = (
        np.tile(0.5 * table, panels.sum()) / panels[curve] for table in (NODES, WEIGHTS)
    )
    s = s + 0.5 / panels[curve] + nodes
    normals = -quarter_turned(chain.derivative(curve, s)) * weights[:, None]
    points = chain.point(curve, s)
    return Moments.integrated((points * normals).sum(axis=1), points)


@dataclass(frozen=True)
class Ellipse(Grain):
    """An ellipse with semi-axes along the body's first and second direction."""

    semi_axes: tuple[float, float]

    @property
    def size(self) -> float:
        return 2.0 * max(self.semi_axes)

    def outline(self) -> tuple[Curve, ...]:
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
        object.__setattr__(self, "semi_axes", (0.5 * self.diameter, 0.5 * self.diameter))


@dataclass(frozen=True)
class Rectangle(Grain):
    """A rectangle whose corners are rounded by quarter circles (0: sharp)."""

    width: float
    height: float
    corner_radius: float = 0.0

    @property
    def rounding(self) -> float:
        """Corner radius; zero where lost in round-off."""
        return self.corner_radius * (self.corner_radius > 1e-9 * min(self.width, self.height))

    @property
    def core(self) -> Floats:
        return 0.5 * np.array([self.width, self.height]) - self.rounding

    @property
    def size(self) -> float:
        return float(2.0 * np.linalg.norm(self.core) + 2.0 * self.rounding)

    def outline(self) -> tuple[Curve, ...]:
        r, curves = self.rounding, list[Curve]()
        centres = self.core * [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
        outward = r * np.array([(0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0)])
        for k in range(4):
            there, onwards = centres[(k + 1) % 4], outward[(k + 1) % 4]
            start, end = plain(centres[k] + outward[k]), plain(there + outward[k])
            curves += [Line(start, end)] if start != end else []
            curves += [Arc(end, plain(there), plain(there + onwards))] if r > 0.0 else []
        return tuple(curves)


class Smooth(Grain):
    """A grain whose outline is a smooth curve over an angle."""

    @abstractmethod
    def trace(self, angle: Floats) -> Floats:
        """Points (n, 2) of the outline at parameter angles (n,)."""

    def outline(self) -> tuple[Curve, ...]:
        """Splines of which none turns by more than TURN, so that cells follow blunt corners."""
        quarters = [self._cuts(0.5 * pi * k) for k in range(4)]
        return tuple(self._even(a, b) for cuts in quarters for a, b in pairwise(cuts))

    def _cuts(self, first: float) -> Floats:
        angle = np.linspace(first, first + 0.5 * pi, 2049)
        sides = np.diff(self.trace(angle), axis=0)
        turns = np.abs(np.diff(np.unwrap(np.arctan2(sides[:, 1], sides[:, 0]))))
        turned = np.cumsum([0.0, *turns, 0.0])
        levels = np.linspace(0.0, turned[-1], 1 + int(np.ceil(turned[-1] / TURN)))
        return np.array([angle[0], *np.interp(levels[1:-1], turned, angle), angle[-1]])

    def _even(self, first: float, last: float) -> Spline:
        from scipy.interpolate import CubicSpline  # which takes time to import

        angle = np.linspace(first, last, 4097)
        way = np.cumsum(np.linalg.norm(np.diff(self.trace(angle), axis=0), axis=1))
        # The spline is within 1e-10 of the grain's size.
        at = CubicSpline(np.append(0.0, way), angle)(np.linspace(0.0, way[-1], 1025))
        return Spline(self.trace(at))


@dataclass(frozen=True)
class Superellipse(Smooth):
    """|x/a|^n + |y/b|^n = 1 with n from 2 (an ellipse) to 20 (almost a box)."""

    semi_axes: tuple[float, float]
    exponent: float

    @property
    def size(self) -> float:
        return 2.0 * farthest(self.semi_axes, self.exponent)

    def trace(self, angle: Floats) -> Floats:
        circle = np.column_stack([np.cos(angle), np.sin(angle)])
        length = power_norm(np.abs(circle), self.exponent)[:, None]
        return np.asarray(self.semi_axes * circle / length)


def power_norm(x: Floats, exponent: float) -> Floats:
    """(sum of x_i^n)^(1/n) of nonnegative numbers along the last axis, without overflow."""
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
    """A star-shaped grain: harmonics give the distance from a pole towards an angle.

    r(angle) = mean (1 + sum of cosines[k-1] cos(k angle) + sines[k-1] sin(k angle)), k = 1, 2, ... Raises SceneError
    unless r > 0.
    """

    mean: float
    cosines: tuple[float, ...] = ()
    sines: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        angle = np.linspace(0.0, 2.0 * pi, 721)
        r = self._radius(angle)
        if not r.min() > 0.0:
            worst = np.degrees(angle[np.argmin(r)])
            raise SceneError(
                f"the radius of the star is {r.min():.3g} at {worst:.0f} degrees; keep it positive"
            )

    def _radius(self, angle: Floats) -> Floats:
        k = np.arange(1, max(len(self.cosines), len(self.sines)) + 1)
        c = np.zeros(len(k), dtype=complex)
        c[: len(self.cosines)] += self.cosines
        c[: len(self.sines)] -= 1j * np.array(self.sines)
        return np.asarray(self.mean * (1.0 + (np.exp(1j * np.multiply.outer(angle, k)) @ c).real))

    @cached_property
    def pole(self) -> Floats:
        """Origin of the radius in the body frame (2,)."""
        angle = np.linspace(0.0, 2.0 * pi, 2048, endpoint=False)  # of the trapezoidal rule
        r = self._radius(angle)
        outward = np.column_stack([np.cos(angle), np.sin(angle)])
        return np.asarray(-2.0 / 3.0 * (r**3) @ outward / (r**2).sum())

    @cached_property
    def size(self) -> float:
        """Largest distance of two points, to 1e-7."""
        return largest_distance(self.trace(np.linspace(0.0, 2.0 * pi, 8001)))

    def trace(self, angle: Floats) -> Floats:
        outward = np.column_stack([np.cos(angle), np.sin(angle)])
        return self.pole + self._radius(angle)[:, None] * outward


@dataclass(frozen=True)
class Polygon(Grain):
    """A simple polygon, shifted to its centroid; vertices in either sense.

    Sides shorter than SHORT of its size are taken for points of a smooth curve between its corners.
    """

    vertices: tuple[Point, ...]

    def __init__(self, vertices: Sequence[Sequence[float]] | Floats) -> None:
        corners = np.array(vertices, dtype=float)
        if len(np.unique(corners, axis=0)) < len(corners):
            raise SceneError("a vertex is given twice; leave the repeated one out")
        if sides := meeting_sides(corners):
            raise SceneError(
                f"the sides after vertices {sides[0]} and {sides[1]} meet (counted from 0); "
                "list the vertices in order around the grain"
            )
        corners = corners - corners.mean(axis=0)
        area = 0.5 * float(planar_cross(corners, np.roll(corners, -1, axis=0)).sum())
        if abs(area) <= 1e-12 * np.ptp(corners, axis=0).max() ** 2:
            raise SceneError("the polygon has no area; give vertices that are not all on one line")
        corners = corners[:: 1 if area > 0.0 else -1]
        centroid = moments_within(Chain(_outline(corners))).centroid
        object.__setattr__(self, "vertices", tuple(map(plain, corners - centroid)))

    @cached_property
    def size(self) -> float:
        return largest_distance(np.array(self.vertices))

    def outline(self) -> tuple[Curve, ...]:
        return _outline(np.array(self.vertices))


def _outline(corners: Floats) -> tuple[Curve, ...]:
    """The sides of a polygon (n, 2), rows of short ones as one smooth curve."""
    lengths, size = (
        np.linalg.norm(corners - np.roll(corners, -1, axis=0), axis=1),
        largest_distance(corners),
    )
    short = lengths < SHORT * size
    turns = _turns(corners, lengths, size)
    knots = np.union1d(np.flatnonzero(~(short & np.roll(short, 1))), turns).astype(int)
    # A closed curve is drawn in parts that each go less than half the way round.
    knots = np.union1d(knots, np.arange(4) * len(short) // 4 if len(knots) < 2 else knots)
    closed, ends = np.vstack([corners, corners]), np.append(knots[1:], knots[0] + len(short))
    return tuple(_through(closed[a : b + 1]) for a, b in zip(knots, ends, strict=True))


def _through(points: Floats) -> Curve:
    chord = points[-1] - points[0]
    # Points as near the chord as 1e-9 of its length line up.
    if np.abs(planar_cross(points - points[0], chord)).max() <= 1e-9 * (chord @ chord):
        return Line(plain(points[0]), plain(points[-1]))
    return Spline(points)


def _turns(corners: Floats, lengths: Floats, size: float) -> list[int]:
    way, window, turns = np.append(0.0, np.cumsum(lengths)), WINDOW * size, list[int]()
    whole, at = way[-1], way[:-1]
    closed = np.vstack([corners, corners[:1]])

    def along(s: Floats) -> Floats:
        return np.column_stack([np.interp(s % whole, way, closed[:, k]) for k in (0, 1)])

    before, after = corners - along(at - window), along(at + window) - corners
    turn = np.abs(np.arctan2(planar_cross(before, after), (before * after).sum(axis=1)))
    for k in np.argsort(-turn, kind="stable")[: np.count_nonzero(turn > CORNER)]:
        apart = np.abs(at[turns] - at[k])
        turns += [int(k)] if (np.minimum(apart, whole - apart) >= window).all() else []
    return turns


def meeting_sides(corners: Floats) -> tuple[int, int] | None:
    """First two sides of a polygon (n, 2) that meet without being neighbours."""
    start, end, n = corners, np.roll(corners, -1, axis=0), len(corners)
    sides = spatial(np.stack([start, end], axis=1))
    i, j = neighbours(sides, sides[:, [0, 1, 1]])
    apart = (j - i > 1) & (j - i < n - 1)
    i, j = i[apart], j[apart]
    meet = _straddles(start[i], end[i], start[j], end[j])
    meet &= _straddles(start[j], end[j], start[i], end[i])
    return min(zip(i[meet].tolist(), j[meet].tolist(), strict=True), default=None)


def _straddles(a: Floats, b: Floats, c: Floats, d: Floats) -> np.ndarray:
    return np.asarray(
        np.sign(planar_cross(b - a, c - a)) * np.sign(planar_cross(b - a, d - a)) <= 0.0
    )


def exposed_arcs(centres: Floats, radii: Floats) -> tuple[np.ndarray, Floats, Floats]:
    """The parts of circles (n,) in no other disc: circle, first and last angle. Of equal discs the last counts."""
    result, number = list[tuple[int, float, float]](), np.arange(len(radii))
    for i, (centre, radius) in enumerate(zip(centres, radii, strict=True)):
        away = centres - centre
        d = np.linalg.norm(away, axis=1)
        if ((d <= radii - radius) & ((radii > radius) | (number > i))).any():
            continue
        cuts = (d < radii + radius) & (d > np.abs(radii - radius))
        middle = np.arctan2(away[cuts, 1], away[cuts, 0])
        half = np.arccos((d[cuts] ** 2 + radius**2 - radii[cuts] ** 2) / (2.0 * d[cuts] * radius))
        ends = np.sort(np.concatenate([middle - half, middle + half]) % (2.0 * pi))
        ends = np.append(ends, ends[0] + 2.0 * pi) if len(ends) else np.array([0.0, 2.0 * pi])
        for first, last in pairwise(ends):
            turn = np.abs((0.5 * (first + last) - middle + pi) % (2.0 * pi) - pi)
            if last > first and (turn >= half).all():
                result.append((i, first, last))
    owner, start, end = np.array(result, dtype=float).reshape(-1, 3).T
    return owner.astype(int), start, end


def moments_of_discs(centres: Floats, radii: Floats) -> Moments:
    """Moments of a union of discs, by Gauss's rule on sixteenths of its exposed arcs."""
    s, weights = ((np.arange(16)[:, None] + 0.5 + 0.5 * NODES) / 16.0).ravel(), np.tile(WEIGHTS, 16)
    owner, start, end = exposed_arcs(centres, radii)
    sweep, r = (end - start)[:, None, None], radii[owner, None, None]
    angle = start[:, None] + sweep[..., 0] * s
    outward = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    points = centres[owner, None] + r * outward
    normals = r * sweep * outward * weights[:, None] / 32.0
    return Moments.integrated((points * normals).sum(axis=2).ravel(), points.reshape(-1, 2))


@dataclass(frozen=True, init=False)
class Discs(Balls, Grain):
    """Connected discs that enclose no hole, shifted to the centroid of their union.

    Raises SceneError if a disc lies within others or touches none.
    """

    centres: tuple[Point, ...]
    radii: tuple[float, ...]
    union = staticmethod(moments_of_discs)

    def __init__(
        self, centres: Sequence[Sequence[float]] | Floats, radii: Sequence[float] | Floats
    ) -> None:
        super().__init__(centres, radii)
        _ = self.chain  # refuses holes, and is kept

    def outline(self) -> tuple[Curve, ...]:
        (centres, radii), curves = self.tables, list[Curve]()
        owner, first, last = exposed_arcs(centres, radii)

        def at(angle: Floats, owner: np.ndarray) -> Floats:
            return centres[owner] + radii[owner, None] * np.column_stack(
                [np.cos(angle), np.sin(angle)]
            )

        starts, ends = at(first, owner), at(last, owner)
        following = np.argmin(np.linalg.norm(ends[:, None] - starts, axis=2), axis=1).tolist()
        # From the arc that reaches farthest to the right
        rightmost, left = owner == np.argmax(centres[:, 0] + radii), {*following}
        k = int(np.argmax(np.where(rightmost, last, -1.0)))
        while k in left:
            left.remove(k)
            pieces = max(int(np.ceil((last[k] - first[k]) / (0.5 * pi) - 1e-9)), 1)
            inner = at(np.linspace(first[k], last[k], pieces + 1)[1:-1], owner[[k]])
            stations = [plain(x) for x in (starts[k], *inner, starts[following[k]])]
            centre, k = plain(centres[owner[k]]), following[k]
            curves += [Arc(a, centre, b) for a, b in pairwise(stations)]
        if left:
            raise SceneError("the discs enclose a hole; fill it with a disc")
        return tuple(curves)

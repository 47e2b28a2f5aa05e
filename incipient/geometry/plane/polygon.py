"""Polygons: their area and outline, in time that grows little faster than the number of vertices."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, Point, planar_cross, quarter_turned, rows, unit
from incipient.errors import SceneError
from incipient.geometry import moments
from incipient.geometry.plane.curves import Curve, Line, Spline, plain
from incipient.geometry.plane.grain import Grain
from incipient.geometry.shape import largest_distance

# In sizes of the polygon. Shorter sides than cells can follow are points of a curve; where a curve turns by more than
# CORNER within WINDOW to both sides it has a corner.
SHORT, WINDOW, CORNER = 0.01, 0.02, np.radians(30.0)
TABLE = 4_000_000  # numbers in a table of points or pairs that is dealt with at a time


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
    def volume(self) -> float:
        """The area, by the shoelace formula."""
        return _shoelace(self._corners)[0]

    @cached_property
    def polar_moment(self) -> float:
        """The moment about the centroid: the sum over the triangles that the sides form with it."""
        return float(np.trace(moments.polygon(self._corners).second))

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
        found = []
        for part in self._parts(rows(x)):
            distance = self._nearest(part)
            # Sides that are equally near, to round-off, meet in a corner and share the normal.
            nearest = distance <= distance.min(axis=1, keepdims=True) + 1e-12 * self.size
            found.append(unit(nearest.astype(float) @ outward))
        return np.concatenate(found)

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
    found = np.zeros(n, dtype=bool)
    for k in candidates[np.argsort(-turn[candidates], kind="stable")]:
        apart = np.abs(at[found] - at[k])
        if not (np.minimum(apart, whole - apart) < window).any():
            found[k] = True
    return found


def meeting_sides(corners: Floats) -> tuple[int, int] | None:
    """The first two sides, by numbers, of a polygon (n, 2) that cross or touch without being neighbours."""
    start, end = corners, np.roll(corners, -1, axis=0)
    n, first = len(corners), None
    for i, j in _overlapping(start, end):
        neighbours = (j - i == 1) | (j - i == n - 1)
        i, j = i[~neighbours], j[~neighbours]
        meet = _straddles(start[i], end[i], start[j], end[j]) & _straddles(
            start[j], end[j], start[i], end[i]
        )
        pairs = [*zip(i[meet].tolist(), j[meet].tolist(), strict=True), *([first] if first else [])]
        first = min(pairs) if pairs else None
    return first


def _overlapping(start: Floats, end: Floats) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Pairs i < j of sides whose boxes have a point in common, in parts of a limited size."""
    low, high = np.minimum(start, end), np.maximum(start, end)
    sweeps = []
    for axis in (0, 1):
        order = np.argsort(low[:, axis], kind="stable")
        last = np.searchsorted(low[order, axis], high[order, axis], side="right")
        sweeps.append((int((last - np.arange(len(order))).sum()), axis, order, last))
    _, axis, order, last = min(sweeps, key=lambda sweep: sweep[0])
    counts = last - np.arange(len(order)) - 1
    for part in np.array_split(np.arange(len(order)), 1 + int(counts.sum()) // TABLE):
        i = np.repeat(part, counts[part])
        j = (
            i
            + 1
            + np.arange(len(i))
            - np.repeat(np.cumsum(counts[part]) - counts[part], counts[part])
        )
        a, b, other = order[i], order[j], 1 - axis
        close = (low[a, other] <= high[b, other]) & (low[b, other] <= high[a, other])
        yield np.minimum(a, b)[close], np.maximum(a, b)[close]


def _straddles(a: Floats, b: Floats, c: Floats, d: Floats) -> np.ndarray:
    """Whether the lines through a-b pass between, or through, c and d; (m,) for points (m, 2) each."""
    return np.asarray(
        np.sign(planar_cross(b - a, c - a)) * np.sign(planar_cross(b - a, d - a)) <= 0.0
    )


def _shoelace(corners: Floats) -> tuple[float, Floats]:
    """Signed area (positive counter-clockwise) and centroid of a polygon."""
    following = np.roll(corners, -1, axis=0)
    cross = planar_cross(corners, following)
    area = 0.5 * float(cross.sum())
    if area == 0.0:
        return area, corners.mean(axis=0)
    return area, ((corners + following) * cross[:, None]).sum(axis=0) / (6.0 * area)


def _centred(corners: Floats) -> Floats:
    """The polygon's corners (n, 2) counter-clockwise with the centroid at the origin."""
    corners = corners - corners.mean(axis=0)
    area, centroid = _shoelace(corners)
    extent = np.ptp(corners, axis=0).max()
    if abs(area) <= 1e-12 * extent**2:
        raise SceneError("the polygon has no area; give vertices that are not all on one line")
    return (corners - centroid)[:: 1 if area > 0.0 else -1]


def _require_simple(corners: Floats) -> None:
    """Refuse repeated vertices and sides that cross."""
    repeated = (corners == np.roll(corners, -1, axis=0)).all(axis=1)
    if repeated.any():
        raise SceneError(f"polygon vertex {int(np.argmax(repeated))} is repeated; leave one out")
    if meeting_sides(corners) is not None:
        raise SceneError("the polygon's sides cross; list the vertices in order around it")

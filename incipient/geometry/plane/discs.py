"""Unions of discs: the arcs that bound them, and the grain they make."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import pi

import numpy as np

from incipient.arrays import Floats, Point
from incipient.errors import SceneError
from incipient.geometry import moments
from incipient.geometry.balls import Balls, checked_balls, require_exposed
from incipient.geometry.plane.curves import Arc, Curve, plain
from incipient.geometry.plane.grain import Grain


@dataclass(frozen=True, eq=False)
class Arcs:
    """The exposed arcs (k,) of discs: which disc they belong to, from and to which angle, counter-clockwise."""

    owner: np.ndarray
    start: Floats
    end: Floats


def exposed_arcs(centres: Floats, radii: Floats) -> Arcs:
    """The parts of the circles (n,) that lie in no other disc; of equal discs the last counts."""
    found: list[tuple[int, float, float]] = []
    for i in range(len(radii)):
        found += [(i, first, last) for first, last in _gaps(_covered(i, centres, radii))]
    owner, start, end = (
        (np.array(column) for column in zip(*found, strict=True)) if found else ([],) * 3
    )
    return Arcs(
        np.asarray(owner, dtype=int), np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    )


def _covered(i: int, centres: Floats, radii: Floats) -> list[tuple[float, float]] | None:
    """The arcs of circle i that lie in other discs; None: all of it."""
    covered: list[tuple[float, float]] = []
    away = centres - centres[i]
    for j, (d, r) in enumerate(zip(np.linalg.norm(away, axis=1), radii, strict=True)):
        if j == i or d >= radii[i] + r:
            continue
        if d <= abs(r - radii[i]):
            if r > radii[i] or (r == radii[i] and j > i):
                return None
            continue
        middle = np.arctan2(away[j, 1], away[j, 0]) % (2.0 * pi)
        half = np.arccos((d * d + radii[i] ** 2 - r * r) / (2.0 * d * radii[i]))
        covered.append((middle - half, middle + half))
    return covered


def _gaps(covered: list[tuple[float, float]] | None) -> list[tuple[float, float]]:
    """What intervals of angles leave of the circle, each gap with ascending angles."""
    if covered is None:
        return []
    if not covered:
        return [(0.0, 2.0 * pi)]
    covered = sorted(covered)
    gaps, reach = [], covered[0][1]
    for first, last in [*covered[1:], (covered[0][0] + 2.0 * pi, covered[0][1] + 2.0 * pi)]:
        if first > reach:
            gaps.append((reach, first))
        reach = max(reach, last)
    # An interval that passes over the seam also covers the beginning of the first gaps.
    seam = max(last for _, last in covered) - 2.0 * pi
    return [(max(first, seam), last) for first, last in gaps if last > seam]


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
        whole = moments.sector_sum(points[arcs.owner], sizes[arcs.owner], arcs.start, arcs.end)
        points = points - whole.centroid
        object.__setattr__(self, "centres", tuple((float(x), float(y)) for x, y in points))
        object.__setattr__(self, "radii", tuple(float(r) for r in sizes))
        _ = self.chain  # refuses holes, and is kept

    @cached_property
    def _arcs(self) -> Arcs:
        return exposed_arcs(np.array(self.centres), np.array(self.radii))

    @cached_property
    def _moments(self) -> moments.Moments:
        """Area, centroid and moment, by Green's theorem along the arcs."""
        arcs, centres, radii = self._arcs, np.array(self.centres), np.array(self.radii)
        return moments.sector_sum(centres[arcs.owner], radii[arcs.owner], arcs.start, arcs.end)

    def outline(self) -> tuple[Curve, ...]:
        """Arcs of at most a quarter turn, joined in exact corners."""
        arcs, centres, radii = self._arcs, np.array(self.centres), np.array(self.radii)
        order = _chained(arcs, centres, radii)
        corners = [
            _on_circle(centres, radii, int(arcs.owner[k]), float(arcs.start[k])) for k in order
        ]
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

"""A smooth bed through points."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from incipient.arrays import Floats, Point
from incipient.errors import SceneError
from incipient.geometry.plane.bed import abscissae
from incipient.geometry.plane.curves import Curve, Line, Spline, plain
from incipient.geometry.plane.polyline import Polyline

LINES_PER_RADIUS, FEWEST_LINES, MOST_LINES = 300, 60, 6000  # of a stretch that bends
LEVEL = 1e6  # radius of curvature over the bed's length, from which on it is level
BISECTIONS = 45  # to the nearest point, between neighbours of that of the lines
STRAIGHT = 1e-9  # difference of slopes, over the steepest one, up to which a stretch is straight


@dataclass(frozen=True, init=False)
class Curved(Polyline):
    """A smooth curve through `knots` (n, 2) with ascending x, y counting from origin_y.

    The height is piecewise cubic and has no crests or troughs but those of the knots (Fritsch & Carlson 1980, SIAM J.
    Numer. Anal. 17, 238). `points` are on the curve, so close together that it is found from the lines between them.
    """

    knots: tuple[Point, ...] = ()

    def __init__(self, knots: ArrayLike, origin_y: float = 0.0) -> None:
        corners = Polyline(knots).points
        if any(left[0] == right[0] for left, right in pairwise(corners)):
            raise SceneError(
                "a smooth bed has a step, two points with the same x; leave one of them out"
            )
        object.__setattr__(self, "knots", corners)
        places = [self._on_curve(a, b, bends) for a, b, bends in self._stretches()]
        super().__init__(np.vstack([places[0], *(place[1:] for place in places[1:])]), origin_y)

    @cached_property
    def _curve(self) -> Any:
        # scipy loads its parts when they are first asked for.
        return scipy.interpolate.PchipInterpolator(*np.array(self.knots).T)

    def _stretches(self) -> list[tuple[float, float, bool]]:
        """Where stretches that bend, and straight ones, begin and end, in order."""
        x, y = np.array(self.knots).T
        slope, chord = self._curve(x, 1), np.diff(y) / np.diff(x)
        away = np.maximum(np.abs(slope[:-1] - chord), np.abs(slope[1:] - chord))
        bends = (away > STRAIGHT * np.abs(chord).max()).tolist()
        ends = [
            0,
            *(k for k in range(1, len(bends)) if bends[k] != bends[k - 1] or not bends[k]),
            len(bends),
        ]
        return [(float(x[a]), float(x[b]), bends[a]) for a, b in pairwise(ends)]

    def _on_curve(self, a: float, b: float, bends: bool) -> Floats:
        """Points (n, 2) above y = 0 of a stretch from a to b, evenly spaced."""
        x = np.linspace(a, b, self._lines(b - a) + 1 if bends else 2)
        return np.column_stack([x, self._curve(x)])

    def _lines(self, length: float) -> int:
        """The number of lines that make up a bent stretch of a length along x."""
        return int(np.clip(LINES_PER_RADIUS * length / self.feature, FEWEST_LINES, MOST_LINES))

    @cached_property
    def _longest(self) -> float:
        """The longest of the lines where the bed bends, along x."""
        return max((b - a) / self._lines(b - a) for a, b, bends in self._stretches() if bends)

    @cached_property
    def _radii(self) -> Floats:
        """The radius of curvature (n - 2,) at each knot but the first and last, by the lines to its neighbours."""
        sides = np.diff(np.array(self.knots), axis=0)
        turns = np.abs(np.diff(np.arctan2(sides[:, 1], sides[:, 0])))
        lengths = np.linalg.norm(sides, axis=1)
        with np.errstate(divide="ignore"):
            return np.asarray(0.5 * (lengths[1:] + lengths[:-1]) / turns)

    @cached_property
    def feature(self) -> float:
        """The smallest radius of curvature; infinite where the knots are on one line."""
        found = float(self._radii.min(initial=np.inf))
        return found if found < LEVEL * np.ptp([x for x, _ in self.knots]) else np.inf

    @property
    def crest(self) -> float:
        """The height of the highest knot."""
        return float(max(y for _, y in self.knots) + self.origin_y)

    def height(self, x: ArrayLike) -> Floats:
        """b at abscissae (n,), (n,)."""
        left, right = self.extent
        return np.asarray(self._curve(np.clip(abscissae(x), left, right)) + self.origin_y)

    def slopes(self, x: ArrayLike) -> tuple[Floats, Floats]:
        """The derivative, the same on both sides; zero beyond the ends."""
        x, (left, right) = abscissae(x), self.extent
        slope = np.where((x < left) | (x > right), 0.0, self._curve(np.clip(x, left, right), 1))
        return slope, slope

    def corners(self, x0: float, x1: float) -> Floats:
        """None."""
        return np.empty(0)

    def _nearest(self, points: Floats) -> Floats:
        """The nearest points (n, 2), those of the lines moved on to the curve; of two alike either."""
        if not len(points) or not np.isfinite(self.feature):
            return super()._nearest(points)
        x, reach = super()._nearest(points)[:, 0], self._longest
        low, high = x - reach, x + reach
        for _ in range(BISECTIONS):
            x = 0.5 * (low + high)
            beyond = x - points[:, 0] + (self.height(x) - points[:, 1]) * self.slopes(x)[0] > 0.0
            low, high = np.where(beyond, low, x), np.where(beyond, x, high)
        return np.column_stack([x, self.height(x)])

    def curves(self, x0: float, x1: float) -> tuple[Curve, ...]:
        """Lines where the bed is straight and smooth curves between, cut at x0 and x1."""
        super().curves(x0, x1)  # refuses what is beyond the ends
        return tuple(self._cut_curves(x0, x1))

    def _cut_curves(self, x0: float, x1: float) -> Iterator[Curve]:
        sliver = 1e-9 * (x1 - x0)
        for a, b, bends in self._stretches():
            start, end = max(a, x0), min(b, x1)
            if end - start > sliver:
                places = self._on_curve(start, end, bends) + np.array([0.0, self.origin_y])
                yield Spline(places) if bends else Line(plain(places[0]), plain(places[-1]))

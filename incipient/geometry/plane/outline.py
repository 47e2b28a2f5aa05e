"""Outlines of grains as closed chains of curves, in which many straight sides are dealt with as arrays.

Lengths are scene units. Points of an outline are told by numbers of curves (n,) and parameters (n,) there.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from incipient.arrays import Floats
from incipient.geometry.placement import Placement
from incipient.geometry.plane.bed import Bed
from incipient.geometry.plane.curves import Curve, Line

FEWEST = 32  # steps along a curve that is not straight
MOST = 8192
# An estimate of a curve's length may be a little too small.
LONGEST = 1.1


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
        sides = np.roll(self.starts, -1, axis=0) - self.starts
        lengths = np.hypot(sides[:, 0], sides[:, 1])
        for k in np.flatnonzero(~self.straight):
            lengths[k] = self.curves[k].length
        return lengths

    @cached_property
    def sharp(self) -> np.ndarray:
        """Whether a curve begins at a corner, (n,)."""
        first, last = self._tangents(0.0), self._tangents(1.0)
        return np.asarray(np.abs(first - np.roll(last, 1, axis=0)).max(axis=1) > 1e-9)

    def _tangents(self, s: float) -> Floats:
        """Unit tangents at a parameter of every curve, (n, 2)."""
        sides = np.roll(self.starts, -1, axis=0) - self.starts
        tangents = sides / np.maximum(np.hypot(sides[:, 0], sides[:, 1]), 1e-300)[:, None]
        for k in np.flatnonzero(~self.straight):
            tangents[k] = self.curves[k].tangent([s])[0]
        return np.asarray(tangents)

    def points(self, count: int) -> Floats:
        """Points (m, 2) in order: `count` on each curve that is not straight, of lines the start."""
        s = np.linspace(0.0, 1.0, count)
        if self.straight.all():
            return self.starts
        pairs = zip(self.curves, self.straight, strict=True)
        return np.vstack([curve.point([0.0] if straight else s) for curve, straight in pairs])


@dataclass(frozen=True, eq=False)
class Outline:
    """A chain in its place in the scene; a curve is moved there when it is asked for."""

    chain: Chain
    placement: Placement
    _moved: dict[int, Curve] = field(default_factory=dict, repr=False)

    def __len__(self) -> int:
        return len(self.chain.curves)

    def __getitem__(self, k: int) -> Curve:
        k = range(len(self))[k]
        if k not in self._moved:
            self._moved[k] = self.chain.curves[k].moved(self.placement)
        return self._moved[k]

    def __iter__(self) -> Iterator[Curve]:
        return (self[k] for k in range(len(self)))

    @cached_property
    def starts(self) -> Floats:
        """Where the curves begin, (n, 2)."""
        return self.placement.to_scene(self.chain.starts)

    def starts_of(self, curves: np.ndarray) -> Floats:
        """Where some of the curves begin, (m, 2); cheaper than all where there are thousands."""
        return self.placement.to_scene(self.chain.starts[curves])

    @cached_property
    def _ends(self) -> Floats:
        return np.roll(self.starts, -1, axis=0)

    def point(self, curve: np.ndarray, s: Floats) -> Floats:
        """Points (m, 2) on curves of the numbers (m,) at the parameters (m,)."""
        t = s[:, None]
        points = (1.0 - t) * self.starts[curve] + t * self._ends[curve]
        bent = ~self.chain.straight[curve]
        for k in np.unique(curve[bent]):
            points[curve == k] = self[int(k)].point(s[curve == k])
        return np.asarray(points)

    def near(self, bed: Bed, within: float | None) -> np.ndarray:
        """Numbers of the curves that may come `within` a distance of the bed, ascending; None: the least there is.

        A distance changes along a curve by no more than the way.
        """
        y, reach = self.starts[:, 1], LONGEST * self.chain.lengths
        above = y - bed.crest  # no distance is smaller
        if within is None:
            within = max(float((y - bed.height(self.starts[:, 0])).min()), 0.0)
        distances = above.copy()
        close = above <= within + reach.max()
        if close.any():
            distances[close] = bed.distance(self.starts[close])
        least = 0.5 * (distances + np.roll(distances, -1) - reach)
        # A quarter of the longest curve more: what lies next to the closest matters as well.
        return np.flatnonzero(least <= within + 0.25 * reach.max())

    def sampled(self, curves: np.ndarray, bed: Bed, size: float) -> tuple[np.ndarray, Floats]:
        """Numbers and parameters (m,) of points on curves, dense enough for their shape and the bed's features.

        `size` is the grain's. Both ends of every curve are among the points.
        """
        steps = self.steps(curves, bed, size)
        first = np.concatenate([[0], np.cumsum(steps + 1)[:-1]])
        place = np.arange(int((steps + 1).sum())) - np.repeat(first, steps + 1)
        return np.repeat(curves, steps + 1), place / np.repeat(steps, steps + 1)

    def steps(self, curves: np.ndarray, bed: Bed, size: float) -> np.ndarray:
        """How many steps (m,) are made along each of the curves (m,)."""
        steps = np.ceil(64.0 * self.chain.lengths[curves] / min(bed.feature, 0.5 * size))
        fewest = np.where(self.chain.straight[curves], 1, FEWEST)
        return np.asarray(np.clip(steps, fewest, MOST).astype(int))

    def crossings(
        self, curve: np.ndarray, s: Floats, abscissae: Floats
    ) -> tuple[np.ndarray, Floats]:
        """Numbers and parameters at which sampled curves pass over abscissae; `curve`, `s` as `sampled` gives them."""
        x = self.point(curve, s)[:, 0]
        step = np.flatnonzero(curve[1:] == curve[:-1])
        left, right = x[step, None] - abscissae, x[step + 1, None] - abscissae
        i, j = np.nonzero(left * right < 0.0)
        i = step[i]
        low, high, rising = s[i], s[i + 1], x[i] < x[i + 1]
        for _ in range(54 if len(i) else 0):  # down to round-off
            middle = 0.5 * (low + high)
            before = (self.point(curve[i], middle)[:, 0] < abscissae[j]) == rising
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        return curve[i], 0.5 * (low + high)

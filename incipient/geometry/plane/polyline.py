"""A bed of straight lines from point to point."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from incipient.arrays import Floats, Point, rows
from incipient.errors import SceneError
from incipient.geometry.plane.bed import Bed, abscissae, require_order
from incipient.geometry.plane.curves import Curve, Line

MOST_IN_CELL = 80  # points that tell what a bed acts as


@dataclass(frozen=True, init=False)
class Polyline(Bed):
    """Straight lines through `points` (n, 2) with ascending x; y counts from origin_y.

    Two points with the same x are a vertical step, whose x belongs to its right side; no grain lies at one. Beyond the
    first and last point the height continues unchanged, but curves are given only between them.
    """

    points: tuple[Point, ...]
    origin_y: float = 0.0

    def __init__(self, points: ArrayLike, origin_y: float = 0.0) -> None:
        array = np.array(points, dtype=float)
        if array.ndim != 2 or array.shape[1] != 2 or len(array) < 2 or not np.isfinite(array).all():
            raise SceneError(
                "a polyline bed needs at least two points of two finite coordinates; add them"
            )
        dx, dy = np.diff(array, axis=0).T
        falling = (dx < 0.0) | ((dx == 0.0) & (dy == 0.0))
        if falling.any():
            k = int(np.argmax(falling)) + 1
            raise SceneError(
                f"polyline point {k} lies to the left of, or at, the one before; sort by x"
            )
        object.__setattr__(self, "points", tuple((float(x), float(y)) for x, y in array))
        object.__setattr__(self, "origin_y", float(origin_y))

    @cached_property
    def _vertices(self) -> Floats:
        return np.array(self.points) + np.array([0.0, self.origin_y])

    @property
    def extent(self) -> tuple[float, float]:
        """The abscissae of the first and the last point."""
        return self.points[0][0], self.points[-1][0]

    @cached_property
    def feature(self) -> float:
        """The shortest horizontal extent of a line, or height of a step."""
        dx, dy = np.abs(np.diff(self._vertices, axis=0)).T
        return float(np.where(dx > 0.0, dx, dy).min())

    @cached_property
    def crest(self) -> float:
        """The height of the highest point."""
        return float(self._vertices[:, 1].max())

    def crest_level(self, x0: float, x1: float) -> float:
        """The height that is reached in every third from x0 to x1 and at x0: a lone obstacle does not count."""
        cuts = np.linspace(x0, x1, 4)
        thirds = [self._between(*cut)[:, 1].max() for cut in pairwise(cuts)]
        return float(max(min(thirds), self.height([x0])[0]))

    def mean(self, x0: float, x1: float) -> float:
        """The mean height from x0 to x1."""
        x, y = self._between(x0, x1).T
        return float(0.5 * (y[1:] + y[:-1]) @ np.diff(x) / (x1 - x0))

    def cell(self, x0: float, x1: float) -> tuple[Curve, ...]:
        """The lines from x0 to x1, and these mirrored at x1; of very many the highest points of equal parts."""
        points = self._between(x0, x1) - [0.0, self.origin_y]
        if len(points) > MOST_IN_CELL:
            parts = np.array_split(points, MOST_IN_CELL)
            highest = [part[np.argmax(part[:, 1])] for part in parts]
            points = np.vstack(
                [points[0], *(one for one in highest if x0 < one[0] < x1), points[-1]]
            )
        back = points[-2::-1] * [-1.0, 1.0] + [2.0 * x1, 0.0]
        ends = [(float(x), float(y)) for x, y in np.vstack([points, back])]
        return tuple(Line(start, end) for start, end in pairwise(ends))

    def _between(self, x0: float, x1: float) -> Floats:
        """The points (n, 2) of the bed at x0, at its corners between, and at x1."""
        return self._cut(x0, x1, 0.0)

    def _cut(self, x0: float, x1: float, sliver: float) -> Floats:
        """Points (n, 2) at x0 and x1, and of the corners between them those that keep `sliver` away from both."""
        x = self._vertices[:, 0]
        inner = self._vertices[(x > x0 + sliver) & (x < x1 - sliver)]
        first, last = np.column_stack([[x0, x1], self.height([x0, x1])])
        return np.vstack([first, inner, last])

    def height(self, x: ArrayLike) -> Floats:
        """b at abscissae (n,), (n,)."""
        vertices = self._vertices
        return np.asarray(np.interp(abscissae(x), vertices[:, 0], vertices[:, 1]))

    def slopes(self, x: ArrayLike) -> tuple[Floats, Floats]:
        """The slopes of the lines left and right; zero beyond the ends."""
        vertices, x = self._vertices, abscissae(x)
        dx, dy = np.diff(vertices, axis=0).T
        upright = dx == 0.0  # no abscissa lies within such a line
        slope = np.concatenate(
            [[0.0], np.where(upright, 0.0, dy / np.where(upright, 1.0, dx)), [0.0]]
        )
        # A vertex found to round-off is that vertex.
        slack = 1e-12 * np.ptp(vertices[:, 0])
        left = slope[np.searchsorted(vertices[:, 0], x - slack, side="left")]
        right = slope[np.searchsorted(vertices[:, 0], x + slack, side="right")]
        return left, right

    def corners(self, x0: float, x1: float) -> Floats:
        """The points between x0 and x1, also those that are not real corners."""
        x = self._vertices[:, 0]
        return np.unique(x[(x >= x0) & (x <= x1)])

    def nearest(self, points: Floats) -> Floats:
        """The nearest point of all lines, and of the level continuations beyond the ends."""
        points = rows(points)
        order = np.argsort(points[:, 0])
        feet = np.empty_like(points)
        # In blocks of neighbours, so that each block meets few lines and the tables stay small.
        for block in np.array_split(order, 1 + len(points) // 64):
            feet[block] = self._nearest(points[block])
        return feet

    def _nearest(self, points: Floats) -> Floats:
        """The nearest points (n, 2) of the bed for a few points (n, 2), by all lines no farther than the bed below."""
        if len(points) == 0:
            return points
        vertices = self._vertices
        reach = float(np.abs(points[:, 1] - self.height(points[:, 0])).max()) + 1e-9 * np.ptp(
            vertices[:, 0]
        )
        x0, x1 = points[:, 0].min() - reach, points[:, 0].max() + reach
        left = np.array([[min(x0, vertices[0, 0]) - reach, vertices[0, 1]]])
        right = np.array([[max(x1, vertices[-1, 0]) + reach, vertices[-1, 1]]])
        vertices = np.vstack([left, vertices, right])
        first = max(int(np.searchsorted(vertices[:, 0], x0)) - 1, 0)
        vertices = vertices[first : int(np.searchsorted(vertices[:, 0], x1)) + 1]
        side = np.diff(vertices, axis=0)
        from_start = points[:, None] - vertices[:-1]
        s = np.clip((from_start * side).sum(-1) / (side * side).sum(-1), 0.0, 1.0)
        # Weighted ends: a foot at an end of a line is that end exactly.
        feet = (1.0 - s[..., None]) * vertices[:-1] + s[..., None] * vertices[1:]
        best = np.argmin(((feet - points[:, None]) ** 2).sum(axis=2), axis=1)
        return np.asarray(feet[np.arange(len(points)), best])

    def curves(self, x0: float, x1: float) -> tuple[Curve, ...]:
        """One line from point to point, cut at x0 and x1."""
        require_order(x0, x1)
        x = self._vertices[:, 0]
        if x0 < x[0] or x1 > x[-1]:
            raise SceneError(
                f"the polyline bed reaches from x = {x[0]:g} to {x[-1]:g}, the domain from {x0:g} to {x1:g}; "
                "add points or shorten the domain"
            )
        ends = [(float(a), float(b)) for a, b in self._cut(x0, x1, 1e-9 * (x1 - x0))]
        return tuple(Line(start, end) for start, end in pairwise(ends))

"""Closest points of a grain and a bed in 2-D.

Along the sampled outline the distance changes by at most the arc length, which bounds most samples; between the
neighbours of a sampled minimum the derivative of the distance has a root.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from incipient.arrays import Floats, planar_cross, quarter_turned, spatial, unit
from incipient.errors import SceneError
from incipient.geometry.contacts import ClosestPoints, Contacts
from incipient.geometry.placement import Placement
from incipient.geometry.plane.beds import Bed
from incipient.geometry.plane.curves import Arc, Curve, Line, increasing_roots
from incipient.geometry.plane.grains import NODES, Grain
from incipient.geometry.proximity import Proximity

PER_FEATURE = (
    64.0  # samples along the smaller of half the grain's size and the bed's smallest feature
)
FEWEST, MOST = 32, 8192  # samples on a curve that is not straight
STRIDE = 16  # samples from one whose distance bounds that of its neighbours to the next
MOST_WALKED = 30  # samples that a minimum is followed from one placement to the next
ON_CORNER = (
    1e-9  # of the grain's size: nearer than this a corner of the grain touches a corner of the bed
)
LEVEL = 1e-13  # of the grain's size: distances that differ by less are those of a flat contact
SAME_DIRECTION = 1e-6  # normals closer than this belong to the same contact
# Where between two corners of the bed a side must lie on it: both ends and Gauss's points, which no wave hits alone
BETWEEN = np.array([0.0, *(0.5 + 0.5 * NODES), 1.0])
Patch = tuple[Floats, Floats]  # both ends (2, 2), normal (2,) out of the grain


@dataclass(frozen=True, eq=False)
class PlanarProximity(Proximity):
    """A grain and a bed in 2-D."""

    grain: Grain
    bed: Bed

    @cached_property
    def _steps(self) -> np.ndarray:
        chain = self.grain.chain
        wanted = np.ceil(PER_FEATURE * chain.lengths / min(self.bed.feature, 0.5 * self.size))
        return np.asarray(np.clip(wanted, np.where(chain.straight, 1, FEWEST), MOST).astype(int))

    @cached_property
    def _samples(self) -> tuple[np.ndarray, Floats, Floats]:
        curve, s = self.grain.chain.samples(self._steps)
        return curve, s, self.grain.chain.point(curve, s)

    @cached_property
    def sampling(self) -> float:
        return 1.1 * float((self.grain.chain.lengths / self._steps).max())

    def _distances(self, points: Floats, within: float) -> Floats:
        known, distances = self.bed.distance(points[::STRIDE]), np.full(len(points), np.inf)
        near = np.repeat(known <= within + (STRIDE + 1) * self.sampling, STRIDE)[: len(points)]
        distances[near] = self.bed.distance(points[near])
        return distances

    def minima(
        self, placement: Placement, within: float, touching: float | None = None
    ) -> ClosestPoints:
        """Local minima along the outline, and its corners, with gaps of at most `within` (a length).

        touching: return minima alone; gaps up to this length count as closed (default: round-off)
        """
        curve, s, points = self._samples
        points = placement.to_scene(points)
        distances = self._distances(points, within)
        low, high = np.roll(distances, 1), np.roll(distances, -1)
        even = LEVEL * self.size
        least = (distances <= low + even) & (distances < high - even)
        least &= distances <= within + self.sampling
        valley = np.flatnonzero(least)
        before = (valley - 1) % len(s)
        # Towards the sample before, on its curve, and towards the one after.
        k, start = np.concatenate([curve[before], curve[valley]]), np.append(s[before], s[valley])
        end = np.round(start * self._steps[k] + 1.0) / self._steps[k]
        k, place = self._lowest(placement, k, start, end, np.tile(np.arange(len(valley)), 2))
        parts = [self._closest(placement, k, place, touching)]
        if touching is None:
            parts.append(self._joints(placement, within))
        result = ClosestPoints.joined(parts)
        return result.only(result.gaps <= within)

    def _lowest(
        self, placement: Placement, k: np.ndarray, low: Floats, high: Floats, group: np.ndarray
    ) -> tuple[np.ndarray, Floats]:
        s = increasing_roots(lambda s: self._slopes(placement, k, s), low, high)
        gaps = self.bed.distance(placement.to_scene(self.grain.chain.point(k, s)))
        gaps -= LEVEL * self.size * ((s == 0.0) | (s == 1.0))  # of a flat contact the end
        order = np.lexsort([gaps, group])
        best = order[np.unique(group[order], return_index=True)[1]]
        ends = s[best] >= 1.0  # counted as the start of the next curve
        return (k[best] + ends) % len(self._steps), np.where(ends, 0.0, s[best])

    def _slopes(self, placement: Placement, k: np.ndarray, s: Floats) -> Floats:
        points = placement.to_scene(self.grain.chain.point(k, s))
        feet = self.bed.nearest(points)
        left, right = self.bed.side_normals(feet[:, 0])
        at_corner = np.abs(left - right).max(axis=1, keepdims=True) > 1e-12
        away = np.where(at_corner, points - feet, left)
        return np.asarray(
            (away * (self.grain.chain.tangent(k, s) @ placement.rotation.T)).sum(axis=1)
        )

    def _closest(
        self, placement: Placement, k: np.ndarray, s: Floats, touching: float | None = None
    ) -> ClosestPoints:
        """Minima on curves (m,) at parameters (m,); two where a corner stands in a valley."""
        chain, slack = self.grain.chain, ON_CORNER * self.size if touching is None else touching
        body = chain.point(k, s)
        points = placement.to_scene(body)
        gaps, feet = self.bed.distance(points), self.bed.nearest(points)
        normals = quarter_turned(chain.tangent(k, s) @ placement.rotation.T)
        corner, near = (s == 0.0) & chain.sharp[k], np.abs(gaps) <= slack
        apart, closed = corner & ~near, np.flatnonzero(corner & near)
        normals[apart] = (points - feet)[apart] / gaps[apart, None]
        # At a corner of the bed, to the slack: in a valley both of its normals
        at = [(*self.bed.corners(x - slack, x + slack), x)[0] for x in feet[closed, 0]]
        left, right = self.bed.side_normals(np.array(at))
        valley = planar_cross(left, right) > SAME_DIRECTION
        normals[closed] = np.where(valley[:, None], left, self.bed.normal(np.array(at)))
        origin = np.column_stack([k, np.zeros(len(k), dtype=int)])
        result = ClosestPoints(gaps, points, normals, anchors=body, origin=origin, parameters=s)
        second = replace(result.only(closed[valley]), normals=right[valley])
        return ClosestPoints.joined([result, second])

    # Corners of the outline and smooth ends of its straight sides, seen from each piece of the bed.

    @cached_property
    def _ends(self) -> np.ndarray:
        chain = self.grain.chain
        return np.flatnonzero(chain.sharp | chain.straight | np.roll(chain.straight, 1))

    def _joints(
        self, placement: Placement, within: float, curves: np.ndarray | None = None
    ) -> ClosestPoints:
        starts = self.grain.chain.starts
        if curves is None:
            points = placement.to_scene(starts[self._ends])
            close = points[:, 1] - self.bed.crest <= within
            close[close] = self.bed.distance(points[close]) <= within
            curves = self._ends[close]
        points = placement.to_scene(starts[curves])
        rows = [
            (i, gap, normal)
            for i, point in enumerate(points)
            for gap, normal in self._seen(point, within)
            if gap <= within
        ]
        which = np.array([row[0] for row in rows], dtype=int)
        gaps, normals = np.array([row[1] for row in rows]), np.array([row[2] for row in rows])
        origin = np.column_stack([curves[which], np.ones(len(rows), dtype=int)])
        return ClosestPoints(
            gaps.reshape(-1),
            points[which],
            normals.reshape(-1, 2),
            anchors=starts[curves[which]],
            origin=origin,
            parameters=np.zeros(len(rows)),
        )

    def _seen(self, point: Floats, within: float) -> Iterator[tuple[float, Floats]]:
        above = abs(point[1] - float(self.bed.height(point[:1])[0]))
        reach = max(above, 1e-3 * self.size) + (within if np.isfinite(within) else 0.0)
        left, right = (
            max(point[0] - reach, self.bed.extent[0]),
            min(point[0] + reach, self.bed.extent[1]),
        )
        if not len(self.bed.corners(left, right)):
            foot = self.bed.nearest(point[None])[0]
            yield float(self.bed.distance(point[None])[0]), self.bed.normal(foot[:1])[0]
        elif left < right:
            for piece in self.bed.curves(left, right):
                yield from _beside(piece, point)

    # Questions.

    def tracked(self, placement: Placement, old: ClosestPoints) -> ClosestPoints:
        k, s, joint = old.origin[:, 0].copy(), old.parameters.copy(), old.origin[:, 1] == 1
        k[~joint], s[~joint] = self._followed(placement, k[~joint], s[~joint])
        kept = []
        for i in range(len(old)):
            result = (
                self._joints(placement, np.inf, k[i : i + 1])
                if joint[i]
                else self._closest(placement, k[i : i + 1], s[i : i + 1])
            )
            if not len(result):
                result = old.only([i])
            apart = np.abs(result.normals - old.normals[i]).max(axis=1)
            kept.append(result.only([int(np.argmin(apart))]))
        return ClosestPoints.joined(kept) if kept else old

    def _followed(
        self, placement: Placement, k: np.ndarray, s: Floats
    ) -> tuple[np.ndarray, Floats]:
        """The minima downhill, perhaps some samples away: rolling moves them."""
        count = len(self._steps)
        for _ in range(MOST_WALKED if len(k) else 0):
            step = 1.0 / self._steps[k]
            before, after = (k - 1) % count, (k + 1) % count
            rows = [  # on the curve itself, and next to it where the place is near an end
                (
                    k,
                    np.maximum(s - step, 0.0),
                    np.minimum(s + step, 1.0),
                    np.ones(len(k), dtype=bool),
                ),
                (before, 1.0 - 1.0 / self._steps[before], np.ones(len(k)), s < step),
                (after, np.zeros(len(k)), 1.0 / self._steps[after], s > 1.0 - step),
            ]
            group = np.tile(np.arange(len(k)), 3)
            on, low, high, there = (np.concatenate(column) for column in zip(*rows, strict=True))
            at, place = self._lowest(placement, on[there], low[there], high[there], group[there])
            # Along a straight side that nearly lies on the bed the minimum would jump to the other end.
            calm = self.grain.chain.straight[at] | ((at == k) & (np.abs(place - s) < 0.999 * step))
            k, s = at, place
            if calm.all():
                break
        return k, s

    def locally_least(
        self, placement: Placement, minima: ClosestPoints, corners: bool = False, slack: float = 0.0
    ) -> ClosestPoints:
        if corners:
            return minima
        joint, k = minima.origin[:, 1] == 1, minima.origin[:, 0]
        chain, count = self.grain.chain, len(self._steps)
        after, before = (k + 1) % count, (k - 1) % count
        sides = (chain.straight[k] & np.isin(after, k[joint])) | (
            chain.straight[before] & np.isin(before, k[joint])
        )
        return minima.only(~joint | chain.sharp[k] | sides)

    def drop(self, placement: Placement) -> float:
        points = placement.to_scene(self._samples[2])
        x, ahead = points[:, 0], np.roll(points, -1, axis=0)
        drops = points[:, 1] - self.bed.height(x)
        corners = self.bed.corners(float(x.min()), float(x.max()))
        first = np.searchsorted(corners, np.minimum(x, ahead[:, 0]), side="right")
        count = np.maximum(np.searchsorted(corners, np.maximum(x, ahead[:, 0])) - first, 0)
        i = np.repeat(np.arange(len(x)), count)
        at = corners[np.arange(len(i)) - np.repeat(np.cumsum(count) - count, count) + first[i]]
        t = (at - x[i]) / (ahead[i, 0] - x[i])
        # At a vertical step the upper side counts.
        tops = np.maximum(self.bed.height(at), self.bed.height(np.nextafter(at, -np.inf)))
        above = (1.0 - t) * points[i, 1] + t * ahead[i, 1] - tops
        return float(min(drops.min(), above.min(initial=np.inf)))

    def contacts(self, placement: Placement, tolerance: float) -> Contacts:
        patches = self._patches(placement, tolerance)
        result: list[
            tuple[Floats, Floats, float]
        ] = [  # of the ends of patches, each with half the length
            (point, normal, 0.5 * float(np.linalg.norm(ends[1] - ends[0])))
            for ends, normal in patches
            for point in ends
        ]
        near = self.minima(placement, tolerance, touching=tolerance)
        for point, normal in zip(near.points, -near.normals, strict=True):
            repeated = any(
                np.abs(point - at).max() <= tolerance and np.abs(normal - n).max() <= SAME_DIRECTION
                for at, n, _ in result
            )
            if not repeated and not any(
                _covers(patch, point, normal, tolerance) for patch in patches
            ):
                result.append((point, normal, 0.0))
        if not result:
            raise SceneError(
                f"the grain does not touch the bed within {tolerance:g}; rest it on the bed with x"
            )
        points, normals, areas = (np.array(column) for column in zip(*result, strict=True))
        return Contacts(spatial(points), spatial(normals), areas if patches else None)

    def _patches(self, placement: Placement, tolerance: float) -> list[Patch]:
        chain, patches = self.grain.chain, list[Patch]()
        starts = placement.to_scene(chain.starts)
        sides = np.roll(starts, -1, axis=0) - starts
        low = starts[:, 1] + np.minimum(sides[:, 1], 0.0) - self.bed.crest
        # Counter-clockwise, the lower sides run from left to right.
        for k in np.flatnonzero(chain.straight & (low <= tolerance) & (sides[:, 0] > 0.0)):
            start, side = starts[k], sides[k]
            corners = self.bed.corners(start[0], start[0] + side[0])
            t = np.unique([0.0, *np.clip((corners - start[0]) / side[0], 0.0, 1.0), 1.0])
            t = t[:-1, None] + np.diff(t)[:, None] * BETWEEN
            points = start + t[..., None] * side
            away = self.bed.distance(points.reshape(-1, 2)).reshape(t.shape)
            lies = np.pad((np.abs(away) <= tolerance).all(axis=1), 1).astype(int)
            for first, last in np.flatnonzero(np.diff(lies)).reshape(-1, 2):
                ends = np.array([points[first, 0], points[last - 1, -1]])
                if np.linalg.norm(ends[1] - ends[0]) > tolerance:
                    patches.append((ends, -quarter_turned(unit(side))))
        return patches


def _beside(piece: Curve, point: Floats) -> Iterator[tuple[float, Floats]]:
    if isinstance(piece, Line):
        along, away = piece.tangent([0.0])[0], point - np.asarray(piece.start)
        place = float(away @ along) / piece.length
        if -1e-9 <= place <= 1.0 + 1e-9:
            normal = quarter_turned(along)
            yield float(away @ normal), normal
    elif isinstance(piece, Arc):
        away, ends = point - piece.centre, np.array([piece.start, piece.end]) - piece.centre
        length, radius = float(np.linalg.norm(away)), float(np.linalg.norm(ends[0]))
        first, last = planar_cross(ends, away) / (length * radius)
        if first <= 1e-9 and last >= -1e-9:
            yield length - radius, away / length


def _covers(patch: Patch, point: Floats, normal: Floats, tolerance: float) -> bool:
    ends, outward = patch
    return bool(
        np.abs(normal - outward).max() <= SAME_DIRECTION
        and (ends[0] - point) @ (ends[1] - point) < 0.0
        and abs((ends[0] - point) @ outward) <= 2.0 * tolerance
    )

"""Closest points of a grain and a bed in 2-D, and the closing of the interstice of a resting grain.

Along the sampled outline the distance changes by at most the arc length, which bounds most samples; between the
neighbours of a sampled minimum the derivative of the distance has a root. Wedges next to contacts are left out where
narrower than some width, up to a straight line across each.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from incipient.arrays import Floats, planar_cross, quarter_turned, spatial, unit
from incipient.errors import SceneError
from incipient.geometry.contacts import ClosestPoints, Contacts
from incipient.geometry.placement import Placement
from incipient.geometry.plane.beds import Bed
from incipient.geometry.plane.curves import Curve, Line, increasing_roots, part, plain
from incipient.geometry.plane.grains import NODES, Grain
from incipient.geometry.proximity import SAME_PLACE, Proximity

STRIDE = 16  # samples from one whose distance bounds that of its neighbours to the next
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
        # 64 along the smaller of half the grain's size and the bed's smallest feature
        wanted = np.ceil(64.0 * chain.lengths / min(self.bed.feature, 0.5 * self.size))
        return np.asarray(np.clip(wanted, np.where(chain.straight, 1, 32), 8192).astype(int))

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
        chain, (curve, s, points) = self.grain.chain, self._samples
        points = placement.to_scene(points)
        distances = self._distances(points, within)
        low, high = np.roll(distances, 1), np.roll(distances, -1)
        even = LEVEL * self.size
        least = (distances <= low + even) & (distances < high - even)
        if touching is not None:  # a side that lies on the bed has a least place at either end
            least |= (s == 0.0) & self.grain.chain.sharp[curve] & (np.abs(distances) <= touching)
        least &= distances <= within + self.sampling
        valley = np.flatnonzero(least)
        before = (valley - 1) % len(s)
        # Towards the sample before, on its curve, and towards the one after.
        k, start = np.concatenate([curve[before], curve[valley]]), np.append(s[before], s[valley])
        end = np.round(start * self._steps[k] + 1.0) / self._steps[k]
        k, place = self._lowest(placement, k, start, end, np.tile(np.arange(len(valley)), 2))
        joint = np.zeros(len(k), dtype=int)
        if touching is None:
            starts = placement.to_scene(chain.starts[self._ends])
            ends = self._ends[self.bed.distance(starts) <= within]
            k, place = np.append(k, ends), np.append(place, np.zeros(len(ends)))
            joint = np.append(joint, np.ones(len(ends), dtype=int))
            sides, places = self._crests(placement, within)
            same = (k == sides[:, None]) & (np.abs(place - places[:, None]) <= SAME_PLACE)
            other = ~same.any(axis=1)
            k, place = np.append(k, sides[other]), np.append(place, places[other])
            joint = np.append(joint, np.zeros(other.sum(), dtype=int))
        # As near a corner of the grain touches a corner of the bed.
        result = self._closest(placement, k, place, joint, touching or 1e-9 * self.size)
        return result.only(result.gaps <= within)

    def _crests(self, placement: Placement, within: float) -> tuple[np.ndarray, Floats]:
        """Straight sides parallel to one of the bed, and places on them, at the crests where that ends."""
        starts = placement.to_scene(self.grain.chain.starts)
        sides = np.roll(starts, -1, axis=0) - starts
        x = self.bed.corners(starts[:, 0].min() - within, starts[:, 0].max() + within)
        if len(x) == 0:  # as of most beds
            return np.empty(0, dtype=int), np.empty(0)
        x = x[planar_cross(*self.bed.side_normals(x)) < -SAME_DIRECTION]
        turned = np.array(self.bed.side_normals(x))[:, :, None] - quarter_turned(unit(sides))
        parallel = (np.abs(turned).max(axis=3) <= SAME_DIRECTION).any(axis=0)
        # At a vertical step the upper side counts.
        tops = np.maximum(self.bed.height(x), self.bed.height(np.nextafter(x, -np.inf)))
        away = np.column_stack([x, tops])[:, None] - starts
        place = (away * sides).sum(axis=2) / (sides**2).sum(axis=1)
        inner = (place > SAME_PLACE) & (place < 1.0 - SAME_PLACE)
        crest, k = np.nonzero(parallel & inner & self.grain.chain.straight)
        return k, place[crest, k]

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
        self, placement: Placement, k: np.ndarray, s: Floats, joint: np.ndarray, slack: float
    ) -> ClosestPoints:
        """Minima on curves (m,) at parameters (m,); of a corner in a valley one for each side."""

        def corners(which: np.ndarray, reach: float) -> Floats:  # of the bed, else the feet
            x = feet[which, 0]
            return np.array([(*self.bed.corners(a - reach, a + reach), a)[0] for a in x])

        chain, body = self.grain.chain, self.grain.chain.point(k, s)
        points = placement.to_scene(body)
        gaps, feet = self.bed.distance(points), self.bed.nearest(points)
        normals = quarter_turned(chain.tangent(k, s) @ placement.rotation.T)
        corner, closed = (s == 0.0) & (chain.sharp[k] | (joint == 1)), np.abs(gaps) <= slack
        apart, touches = corner & ~closed, corner & closed
        normals[apart] = (points - feet)[apart] / gaps[apart, None]
        if touches.any():
            normals[touches] = self.bed.normal(corners(touches, slack))
        for row in np.flatnonzero((gaps < 0.0) & ~corner):
            gaps[row] = self._depth(points[row], feet[row], gaps[row], normals[row])
        result = ClosestPoints(gaps, points, normals, None, body, np.column_stack([k, joint]))
        # As near a corner of the grain faces both sides of a valley.
        nearby = max(slack, 1e-5 * self.size)
        near = np.flatnonzero(corner & (np.abs(gaps) <= nearby))
        if not len(near):
            return result
        at = corners(near, nearby)
        sides = self.bed.side_normals(at)
        valley = planar_cross(*sides) > SAME_DIRECTION
        away = points[near] - np.column_stack([at, self.bed.height(at)])
        facing = [
            replace(
                result.only(near[valley]),
                gaps=(away * side).sum(axis=1)[valley],
                normals=side[valley],
            )
            for side in sides
        ]
        return ClosestPoints.joined(
            [result.only(np.setdiff1d(np.arange(len(k)), near[valley])), *facing]
        )

    def _depth(self, point: Floats, foot: Floats, gap: float, normal: Floats) -> float:
        """Gap of a smooth place within the bed; the depth of a crest between sides that both face it less."""
        # A side is nearer than the crest where they meet: without this the gap has a kink where it closes.
        x = self.bed.corners(foot[0] + 10.0 * gap, foot[0] - 10.0 * gap)
        left, right = self.bed.side_normals(x)
        x = x[(planar_cross(left, normal) < 0.0) & (planar_cross(normal, right) < 0.0)]
        crests = np.column_stack([x, self.bed.height(x)])
        return float(min((point - crests) @ normal, key=abs, default=gap))

    @cached_property
    def _ends(self) -> np.ndarray:
        """Curves that begin in a corner of the outline, or at an end of a straight side."""
        chain = self.grain.chain
        return np.flatnonzero(chain.sharp | chain.straight | np.roll(chain.straight, 1))

    def tracked(self, placement: Placement, old: ClosestPoints) -> ClosestPoints:
        if not len(old):
            return old
        distances = np.append(old.gaps, self.bed.distance(placement.to_scene(old.anchors)))
        # They are sought again somewhat beyond the gaps that they have now.
        near = self.minima(placement, float(distances.max()) + 0.01 * self.size)
        moved = np.linalg.norm(near.anchors - old.anchors[:, None], axis=2) / self.size
        turned = np.linalg.norm(near.normals - old.normals[:, None], axis=2)
        return near.only(np.argmin(moved + turned, axis=1))

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


def _covers(patch: Patch, point: Floats, normal: Floats, tolerance: float) -> bool:
    ends, outward = patch
    return bool(
        np.abs(normal - outward).max() <= SAME_DIRECTION
        and (ends[0] - point) @ (ends[1] - point) < 0.0
        and abs((ends[0] - point) @ outward) <= 2.0 * tolerance
    )


@dataclass(frozen=True, eq=False)
class Closing:
    """A resting grain whose surroundings are closed next to its contacts."""

    width: float  # of the space where it is closed: the length of both lines
    left: Line  # the line from the bed up to the grain, left of all contacts
    right: Line  # the one right of them
    # The rest of the grain's outline, counter-clockwise from the right line to the left one
    outline: tuple[Curve, ...]
    # (k, 2) where the grain touches, in the order in which its outline passes from the left line to the right
    contacts: Floats


def closing(outline: Sequence[Curve], bed: Bed, contacts: Floats, width: float) -> Closing:
    """Close the space between an outline, counter-clockwise in scene coordinates, and a bed that it touches.

    contacts: (k, 2) points at or next to the outline, in any order

    Raises SceneError if the space is nowhere wider than `width`.
    """
    from scipy.optimize import brentq  # which takes time to import

    samples = [
        np.linspace(0.0, 1.0, int(np.clip(8.0 * curve.length / width, 64, 4096)))
        for curve in outline
    ]
    # Places are the number of a curve and the parameter on it in one, counted from the highest, beyond all contacts.
    place = np.concatenate([k + s for k, s in enumerate(samples)])
    points = np.vstack([curve.point(s) for curve, s in zip(outline, samples, strict=True)])
    top = int(np.argmax(points[:, 1]))
    place, points = (
        np.append(place[top:], place[:top] + len(outline)),
        np.roll(points, -top, axis=0),
    )
    at = np.array([np.argmin(np.linalg.norm(points - x[:2], axis=1)) for x in contacts])
    wide = bed.distance(points) > width
    before, after = np.flatnonzero(wide[: at.min()]), at.max() + np.flatnonzero(wide[at.max() :])
    if not len(before) or not len(after):
        raise SceneError(
            "contact.gap: the space between grain and bed is nowhere wider; give a smaller one"
        )

    def excess(place: float) -> float:
        return float(bed.distance(_at(outline, place)[None])[0]) - width

    k = before[-1], after[0] - 1
    low, high = (brentq(excess, place[i], place[i + 1], xtol=1e-12) for i in k)
    low, high = _without_crumbs(outline, low, -1, width), _without_crumbs(outline, high, 1, width)
    ends = [_at(outline, end) for end in (low, high)]
    left, right = (Line(plain(bed.nearest(end[None])[0]), plain(end)) for end in ends)
    rest = _pieces(outline, high, low + len(outline))
    return Closing(width, left, right, rest, np.asarray(contacts)[np.argsort(at, kind="stable")])


def _without_crumbs(outline: Sequence[Curve], place: float, sense: int, width: float) -> float:
    joint = float(sense * np.ceil(sense * place))
    left = abs(joint - place) * outline[int(place) % len(outline)].length
    return joint if left < 0.02 * width else place  # shorter ends of curves are left out


def _at(outline: Sequence[Curve], place: float) -> Floats:
    k = int(place)
    return np.asarray(outline[k % len(outline)].point([place - k])[0])


def _pieces(outline: Sequence[Curve], first: float, last: float) -> tuple[Curve, ...]:
    result = []
    for k in range(int(first), int(np.ceil(last))):
        low, high = max(first - k, 0.0), min(last - k, 1.0)
        if high > low:
            whole = outline[k % len(outline)]
            result.append(whole if (low, high) == (0.0, 1.0) else part(whole, low, high))
    return tuple(result)

"""Where a grain in the plane comes close to its bed, in the form that settling needs."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from incipient.arrays import Floats, planar_cross, quarter_turned
from incipient.geometry.placement import Placement
from incipient.geometry.plane.bed import Bed
from incipient.geometry.plane.curves import Arc, Curve, Line
from incipient.geometry.plane.distance import Approach, approaches, placed_outline, refined
from incipient.geometry.plane.grain import Grain
from incipient.geometry.plane.outline import Outline
from incipient.geometry.rest import rest

MOST_SAMPLES = 30  # that a minimum is followed from one placement to the next
ON_CORNER = (
    1e-9  # of the grain's size: nearer than this a corner of the grain touches a corner of the bed
)


@dataclass(frozen=True, eq=False)
class _Row:
    """One place: gap, point, the bed's normal, the curve of the outline and its parameter (None: its start)."""

    gap: float
    point: Floats
    normal: Floats
    curve: int
    parameter: float | None


@dataclass(frozen=True, eq=False)
class PlanarMinima:
    """Places where the distance of a placed grain from the bed is least, or a corner of its outline is close."""

    rows: tuple[_Row, ...]

    def __len__(self) -> int:
        return len(self.rows)

    @cached_property
    def gaps(self) -> Floats:
        """Distances (k,), negative where the grain is in the bed."""
        return np.array([row.gap for row in self.rows])

    @cached_property
    def points(self) -> Floats:
        """Points on the grain (k, 2)."""
        return np.array([row.point for row in self.rows]).reshape(-1, 2)

    @cached_property
    def normals(self) -> Floats:
        """The bed's unit normals into the fluid (k, 2)."""
        return np.array([row.normal for row in self.rows]).reshape(-1, 2)

    def only(self, which: np.ndarray) -> "PlanarMinima":
        """Some of the minima, by a mask or by indices."""
        return PlanarMinima(tuple(self.rows[i] for i in np.arange(len(self.rows))[which]))


@dataclass(frozen=True, eq=False)
class PlanarProximity:
    """A grain and a bed in the plane, prepared for questions about many placements."""

    grain: Grain
    bed: Bed

    @cached_property
    def size(self) -> float:
        """The grain's size."""
        return self.grain.size

    def minima(self, placement: Placement, within: float) -> PlanarMinima:
        """Local minima along the outline and corners of the outline, with gaps of at most `within` (a length)."""
        found = approaches(self.grain, placement, self.bed, within)
        rows = [row for approach in found for row in self._rows(approach)]
        outline = placed_outline(self.grain, placement)
        corners = self._corners[outline.starts[self._corners, 1] - self.bed.crest <= within]
        if len(corners):
            corners = corners[self.bed.distance(outline.starts[corners]) <= within]
        if len(corners):
            rows += self._joints_at(outline, corners, within)
        return PlanarMinima(tuple(row for row in rows if row.gap <= within))

    def tracked(self, placement: Placement, old: PlanarMinima) -> PlanarMinima:
        """The minima and corners `old` followed to another placement close by, in their order."""
        outline = placed_outline(self.grain, placement)
        return PlanarMinima(tuple(self._tracked(outline, row) for row in old.rows))

    def locally_least(
        self, placement: Placement, minima: PlanarMinima, corners: bool = False, slack: float = 0.0
    ) -> PlanarMinima:
        """Local minima among `minima`, and ends of straight sides of which both are given; on request all corners."""
        if corners:
            return minima
        given = {row.curve for row in minima.rows if row.parameter is None}
        rows = (
            row
            for row in minima.rows
            if row.parameter is not None or self._counts(row.curve, given)
        )
        return PlanarMinima(tuple(rows))

    def _counts(self, k: int, given: set[int]) -> bool:
        """Whether the start of curve k is sharp, or the start or end of a side that touches with both ends."""
        chain, count = self.grain.chain, len(self.grain.chain.curves)
        after, before = (k + 1) % count, (k - 1) % count
        return bool(
            chain.sharp[k]
            or (chain.straight[k] and after in given)
            or (chain.straight[before] and before in given)
        )

    @cached_property
    def _corners(self) -> np.ndarray:
        """Numbers of the curves that begin at a corner or at a smooth end of a straight side."""
        chain = self.grain.chain
        return np.flatnonzero(chain.sharp | chain.straight | np.roll(chain.straight, 1))

    def lowered(self, placement: Placement) -> Placement:
        """The placement, lowered (or raised) vertically until the grain touches the bed."""
        return rest(self.grain, self.bed, placement.centre[0], placement.angle)

    def _tracked(self, outline: Outline, old: _Row) -> _Row:
        """The minimum or corner at the old place on the outline whose normal is closest to the old one."""
        if old.parameter is None:
            rows = self._joints_at(outline, np.array([old.curve]), np.inf)
        else:
            rows = self._rows(self._followed(outline, old.curve, old.parameter))
        return min(rows, key=lambda row: float(np.abs(row.normal - old.normal).max()), default=old)

    def _followed(self, outline: Outline, k: int, s: float) -> Approach:
        """The minimum downhill from a parameter, which may be some samples away: a grain that rolls moves it."""
        for _ in range(MOST_SAMPLES):
            approach = refined(outline, self._brackets(outline, k, s), self.bed)
            on, at = approach.place
            step = self._step(outline, k)
            # Along a straight side that nearly lies on the bed the minimum would jump to the other end.
            if isinstance(outline[on], Line) or (on == k and abs(at - s) < 0.999 * step):
                break
            k, s = on, at
        return approach

    def _brackets(self, outline: Outline, k: int, s: float) -> list[tuple[int, float, float]]:
        """The surroundings of a parameter, also on the next curve where it is near an end."""
        step = self._step(outline, k)
        brackets = [(k, max(s - step, 0.0), min(s + step, 1.0))]
        if s < step:
            brackets.append(((k - 1) % len(outline), 1.0 - step, 1.0))
        if s > 1.0 - step:
            brackets.append(((k + 1) % len(outline), 0.0, step))
        return brackets

    def _step(self, outline: Outline, k: int) -> float:
        """The step of the parameter with which curve k is sampled."""
        return 1.0 / float(outline.steps(np.array([k]), self.bed, self.size)[0])

    def _rows(self, approach: Approach) -> list[_Row]:
        """The bed's normals at a minimum: where a corner of the grain stands in a valley there are two."""
        gap, point, foot = approach.distance, approach.on_grain, approach.on_bed
        if approach.normal is not None:
            normals = [-approach.normal]
        elif abs(gap) > ON_CORNER * self.size:
            normals = [(point - foot) / gap]
        else:
            left, right = (side[0] for side in self.bed.side_normals(foot[:1]))
            steepens = planar_cross(left, right) > 1e-9  # in a valley
            normals = [left, right] if steepens else [self.bed.normal(foot[:1])[0]]
        return [_Row(gap, point, normal, *approach.place) for normal in normals]

    def _joints_at(self, outline: Outline, curves: np.ndarray, within: float) -> list[_Row]:
        """The starts of curves (m,), in their order, each seen from all pieces of bed within a distance."""
        points = outline.starts_of(curves)
        above = np.abs(points[:, 1] - self.bed.height(points[:, 0]))
        reach = np.maximum(above, 1e-3 * self.size) + (within if np.isfinite(within) else 0.0)
        left = np.maximum(points[:, 0] - reach, self.bed.extent[0])
        right = np.minimum(points[:, 0] + reach, self.bed.extent[1])
        corners = self.bed.corners(float(left.min()), float(right.max()))
        smooth = np.searchsorted(corners, left) == np.searchsorted(corners, right, side="right")
        which, gaps, normals = [np.flatnonzero(smooth)], [np.empty(0)], [np.empty((0, 2))]
        if smooth.any():
            gaps = [self.bed.distance(points[smooth])]
            normals = [self.bed.normal(self.bed.nearest(points[smooth])[:, 0])]
        cornered = np.flatnonzero(~smooth & (left < right))
        if len(cornered):
            ends = float(left[cornered].min()), float(right[cornered].max())
            for piece in self.bed.curves(*ends):
                feet, gap, normal, beside = _seen_from(piece, points[cornered])
                slack = 1e-9 * self.size
                beside &= (feet >= left[cornered] - slack) & (feet <= right[cornered] + slack)
                which, gaps = [*which, cornered[beside]], [*gaps, gap[beside]]
                normals.append(normal[beside])
        rows = zip(
            np.concatenate(which), np.concatenate(gaps), np.concatenate(normals), strict=True
        )
        found = sorted(
            ((int(i), float(g), n) for i, g, n in rows if g <= within), key=lambda one: one[0]
        )
        return [_Row(g, points[i], n, int(curves[i]), None) for i, g, n in found]


def _seen_from(piece: Curve, points: Floats) -> tuple[Floats, Floats, Floats, np.ndarray]:
    """Points (n, 2) seen from a line or an arc of a bed that goes from left to right.

    Abscissae of the feet (n,), distances (n,), normals (n, 2), and whether the feet are between the ends (n,).
    """
    if isinstance(piece, Line):
        along = piece.tangent([0.0])[0]
        away = points - np.asarray(piece.start)
        normal, place = quarter_turned(along), away @ along
        beside = (place >= -1e-9 * piece.length) & (place <= (1.0 + 1e-9) * piece.length)
        return (
            piece.start[0] + place * along[0],
            away @ normal,
            np.tile(normal, (len(points), 1)),
            beside,
        )
    if isinstance(piece, Arc):
        centre = np.asarray(piece.centre)
        away, ends = points - centre, np.array([piece.start, piece.end]) - centre
        length, radius = np.linalg.norm(away, axis=1), float(np.linalg.norm(ends[0]))
        turns = planar_cross(ends[:, None], away) / (length * radius)
        outward = away / length[:, None]
        beside = (turns[0] <= 1e-9) & (turns[1] >= -1e-9)
        return centre[0] + radius * outward[:, 0], length - radius, outward, beside
    nothing = np.zeros(len(points))
    return nothing, nothing, np.zeros_like(points), np.zeros(len(points), dtype=bool)

"""Where a grain is near its bed: gaps, points and normals of all places where it may touch it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, planar_cross
from .placement import Placement
from .plane.bed import Bed
from .plane.disc_near_bed import disc_near_bed
from .plane.distance import Approach, approaches, placed_outline
from .plane.grain import Disc, Grain
from .proximity import proximity
from .space.closest import SpatialProximity
from .space.solid import Solid
from .space.terrain import Terrain
from .touching import contact_normals

SAME_PLACE = 1e-6  # of the grain's size: two points as near are one
SAME_NORMAL = 1e-6
SEATINGS, SEATED = (
    12,
    1e-11,
)  # steps of Newton's method, and the last one's length in the grain's size
WANDERS = 4.0  # gaps by which a contact may be elsewhere when the grain is a gap away


@dataclass(frozen=True, eq=False)
class Gaps:
    """Gaps (k,), negative where the grain is in the bed, points on the grain and normals from the bed (k, gdim)."""

    gaps: Floats
    points: Floats
    normals: Floats

    def __len__(self) -> int:
        return len(self.gaps)

    def only(self, which: ArrayLike) -> Gaps:
        """Some of them, by a mask or by indices."""
        index = np.asarray(which, dtype=None if len(np.shape(which)) and np.size(which) else int)
        return Gaps(self.gaps[index], self.points[index], self.normals[index])


@dataclass(frozen=True, eq=False)
class NearBed:
    """A grain and its bed, prepared for questions about many placements."""

    grain: Grain | Solid
    bed: Bed | Terrain

    def gaps(self, placement: Placement, within: float) -> Gaps:
        """All local minima of the gap not above `within` (a length), and corners of the grain so near to the bed.

        Corners count because an edge or a face that turns onto the bed meets it there.
        """
        found = (
            self._planar(placement, within)
            if isinstance(self.grain, Grain)
            else self._spatial(placement, within)
        )
        return found.only(_distinct(found, SAME_PLACE * self.grain.size))

    def seated(
        self, placement: Placement, gap: float, places: Floats, before: float = 0.0
    ) -> Placement:
        """The placement next to one at which the contacts at places (k, gdim) have a gap, where they had `before`."""
        size, d, within = self.grain.size, placement.gdim, WANDERS * max(gap, before)
        for _ in range(SEATINGS):
            found = self.gaps(placement, within)
            apart = np.linalg.norm(found.points[:, None] - places[None, :, :d], axis=2)
            near = found.only(apart.min(axis=1, initial=np.inf) <= within)
            arms = near.points - np.asarray(placement.centre)
            turns = (
                planar_cross(arms, near.normals)[:, None]
                if d == 2
                else np.cross(arms, near.normals)
            )
            rows = np.hstack([size * near.normals, turns])
            way = np.linalg.lstsq(rows, gap - near.gaps, rcond=1e-10)[0]
            placement = placement.moved(size * way[:d], way[d:])
            if np.abs(way).max(initial=0.0) <= SEATED:
                break
        return placement

    def _planar(self, placement: Placement, within: float) -> Gaps:
        assert isinstance(self.grain, Grain) and isinstance(self.bed, Bed)
        if (found := self._of_disc(placement, within)) is not None:
            return found
        near = [
            one
            for one in approaches(self.grain, placement, self.bed, within)
            if one.distance <= within
        ]
        # Along a side that lies on the bed every sample is a minimum: its corners stand for all.
        flat = len(self._corners) > 0 and len(near) > len(self._corners)
        near = [one for one in near if one.normal is None or not flat] + self._corners_near(
            placement, within
        )
        rows = [
            (one.distance, one.on_grain, -normal)
            for one in near
            for normal in contact_normals(one, self.bed, SAME_PLACE * self.grain.size)
        ]
        gaps, points, normals = (
            zip(*rows, strict=True) if rows else ((), np.empty((0, 2)), np.empty((0, 2)))
        )
        return Gaps(np.array(gaps), np.array(points), np.array(normals))

    def _of_disc(self, placement: Placement, within: float) -> Gaps | None:
        """Gaps of a disc by formulas; None: it is none, or there are none."""
        if not isinstance(self.grain, Disc):
            return None
        assert isinstance(self.bed, Bed)
        radius, (x, y) = 0.5 * self.grain.size, placement.centre
        found = disc_near_bed((x, y), radius, self.bed, within)
        if found is None:
            return None
        gaps, feet = found
        normals = (placement.centre - feet) / (gaps + radius)[:, None]
        return Gaps(gaps, placement.centre - radius * normals, normals)

    def _corners_near(self, placement: Placement, within: float) -> list[Approach]:
        assert isinstance(self.bed, Bed)
        if len(self._corners) == 0:
            return []
        points = placement.to_scene(self._corners)
        distances, feet = self.bed.distance(points), self.bed.nearest(points)
        return [
            Approach(float(distances[k]), points[k], feet[k], None)
            for k in np.flatnonzero(distances <= within)
        ]

    @cached_property
    def _corners(self) -> Floats:
        """The corners (n, 2) of a grain in the plane, in the body frame."""
        assert isinstance(self.grain, Grain)
        outline = placed_outline(self.grain, Placement((0.0, 0.0)))
        ends = [
            (outline[k - 1].tangent(1.0)[0], curve.tangent(0.0)[0])
            for k, curve in enumerate(outline)
        ]
        sharp = [k for k, (one, other) in enumerate(ends) if np.abs(one - other).max() > 1e-9]
        return np.array([outline[k].point(0.0)[0] for k in sharp]).reshape(-1, 2)

    def _spatial(self, placement: Placement, within: float) -> Gaps:
        near = self._proximity.minima(placement, within)
        near = self._proximity.locally_least(placement, near, corners=True)
        return Gaps(near.gaps, near.points, near.normals)

    @cached_property
    def _proximity(self) -> SpatialProximity:
        found = proximity(self.grain, self.bed)
        assert isinstance(found, SpatialProximity)
        return found


def _distinct(found: Gaps, tolerance: float) -> np.ndarray:
    """The indices of places that differ in point or normal."""
    kept: list[int] = []
    for k in range(len(found)):
        if not any(
            np.abs(found.points[k] - found.points[other]).max() <= tolerance
            and np.abs(found.normals[k] - found.normals[other]).max() <= SAME_NORMAL
            for other in kept
        ):
            kept.append(k)
    return np.array(kept, dtype=int)

"""Questions about a grain and its bed, in 2-D and 3-D: resting, lifting, distances, contacts.

Lengths are scene units, angles radians, positions those of the grain's centroid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from incipient.arrays import Floats
from incipient.errors import SceneError
from incipient.geometry.contacts import ClosestPoints, Contacts
from incipient.geometry.placement import Placement
from incipient.geometry.plane.beds import Bed
from incipient.geometry.plane.closest import PlanarProximity
from incipient.geometry.plane.grains import Grain
from incipient.geometry.space.beds import Terrain
from incipient.geometry.space.closest import SpatialProximity
from incipient.geometry.space.grains import Solid
from incipient.geometry.statics import wrenches

SAME_PLACE = 1e-6  # of the grain's size: two points as near are one
SEATINGS, SEATED = (
    12,
    1e-11,
)  # steps of Newton's method, and the last one's length in the grain's size
WANDERS = 4.0  # gaps by which a contact may be elsewhere when the grain is a gap away
CONVERGED = 1e-13  # of the grain's size: last change of a lift


def proximity(grain: Grain | Solid, bed: Bed | Terrain) -> PlanarProximity | SpatialProximity:
    """A grain and a bed, prepared for questions about many placements. Raises SceneError if only one is planar."""
    if isinstance(grain, Solid) and isinstance(bed, Terrain):
        return SpatialProximity(grain, bed)
    if isinstance(grain, Grain) and isinstance(bed, Bed):
        return PlanarProximity(grain, bed)
    raise SceneError(
        f"a {type(grain).__name__} cannot rest on a bed {type(bed).__name__}: one is planar, the other is not; "
        "take both in 2-D or both in 3-D"
    )


def rest(
    grain: Grain | Solid,
    bed: Bed | Terrain,
    x: float | Sequence[float],
    angle: float | Sequence[float] = 0.0,
) -> Placement:
    """The grain turned by `angle`, its centroid above `x`, lowered vertically until it touches the bed.

    In 3-D `x` is a pair and `angle` a unit quaternion (or 0).
    """
    near = proximity(grain, bed)
    if grain.gdim == 2:
        return near.lowered(Placement((float(x), 0.0), float(angle)))  # type: ignore[arg-type]
    w, a, b, c = (1.0, 0.0, 0.0, 0.0) if np.ndim(angle) == 0 else angle  # type: ignore[misc]
    first, second = np.asarray(x, dtype=float)
    return near.lowered(Placement((first, second, 0.0), quaternion=(w, a, b, c)))


def clearance(
    grain: Grain | Solid, placement: Placement, bed: Bed | Terrain
) -> tuple[float, Floats, Floats]:
    """The smallest distance from the bed, and the points (gdim,) on grain and bed where it occurs.

    In 3-D exact on smooth beds as long as it is less than their feature; negative where the grain is below the bed.
    Where several minima are equal (a flat contact) it is the first.
    """
    return proximity(grain, bed).clearance(placement)


def lifted(grain: Grain | Solid, placement: Placement, bed: Bed | Terrain, gap: float) -> Placement:
    """The grain straight above (or below) `placement` whose smallest distance to the bed is `gap` >= 0.

    `gap` is a length in scene units. The distance grows steadily with height because the bed is a graph.
    """
    if not (np.isfinite(gap) and gap >= 0.0):
        raise SceneError(f"the gap {gap} is not a distance; give a number that is not negative")
    near = proximity(grain, bed)  # prepared once: that takes longer than a question
    touching_at = near.lowered(placement)
    if gap == 0.0:
        return touching_at

    from scipy.optimize import brentq  # which takes time to import, and most grains rest

    def excess(lift: float) -> float:
        """The distance after a lift, less the gap."""
        return near.clearance(touching_at.raised(lift))[0] - gap

    low, lift = gap, gap
    while excess(lift) < -CONVERGED * grain.size:
        low, lift = lift, 2.0 * lift
    if lift > gap:
        lift = brentq(excess, low, lift, xtol=CONVERGED * grain.size)
    return touching_at.raised(lift)


def touching(
    grain: Grain | Solid, placement: Placement, bed: Bed | Terrain, tolerance: float
) -> Contacts:
    """All contacts of a grain whose distance from the bed is at most `tolerance` (a length, scene units).

    Point contacts are the local minima of the distance along the outline (in 3-D: over the surface). A straight side
    that lies on a straight piece of bed is a patch: its two ends, each with half of its length as area; in 3-D a flat
    face is one on a flat piece of bed, given by the corners of its convex hull with areas that add up to that of the
    patch and have its centroid. `areas` is None if there is no patch. The normal, out of the grain, is the grain's own
    where its surface is smooth, minus the bed's at a corner of the grain; where a corner of the grain stands in a
    valley's corner there are two contacts, one for each side of the valley; where it stands on a corner of the bed,
    minus the bisector of the bed's sides.

    Raises SceneError if nothing touches, or if only one of grain and bed is planar.
    """
    if not tolerance > 0.0:
        raise SceneError(
            f"contact tolerance {tolerance} is not a positive length; give a positive number"
        )
    return proximity(grain, bed).contacts(placement, tolerance)


@dataclass(frozen=True, eq=False)
class NearBed:
    """A grain and its bed, prepared for questions about many placements of a grain in motion."""

    grain: Grain | Solid
    bed: Bed | Terrain

    @cached_property
    def _proximity(self) -> PlanarProximity | SpatialProximity:
        return proximity(self.grain, self.bed)

    def gaps(self, placement: Placement, within: float) -> ClosestPoints:
        """All local minima of the gap not above `within` (a length), and corners of the grain so near to the bed.

        Corners count because an edge or a face that turns onto the bed meets it there.
        """
        near, corners = self._proximity.minima(placement, within), self.grain.gdim == 3
        near = self._proximity.locally_least(placement, near, corners=corners)
        return near.distinct(SAME_PLACE * self.grain.size)

    def with_gap(
        self, placement: Placement, gap: float, places: Floats, before: float = 0.0
    ) -> Placement:
        """The placement next to one at which the contacts at places (k, gdim) have a gap, where they had `before`."""
        size, d, within = self.grain.size, placement.gdim, WANDERS * max(gap, before)
        for _ in range(SEATINGS):
            result = self.gaps(placement, within)
            apart = np.linalg.norm(result.points[:, None] - places[None, :, :d], axis=2)
            near = result.only(apart.min(axis=1, initial=np.inf) <= within)
            arms = near.points - np.asarray(placement.centre)
            rows = size * wrenches(near.normals, arms, size)
            motion = np.linalg.lstsq(rows, gap - near.gaps, rcond=1e-10)[0]
            placement = placement.moved(size * motion[:d], motion[d:])
            if np.abs(motion).max(initial=0.0) <= SEATED:
                break
        return placement

"""Rest, clearance and contacts of a grain on its bed, in 2-D and 3-D.

Lengths are scene units, angles radians, positions those of the grain's centroid.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from incipient.arrays import Floats
from incipient.errors import SceneError
from incipient.geometry.contacts import Contacts
from incipient.geometry.placement import Placement
from incipient.geometry.plane.beds import Bed
from incipient.geometry.plane.closest import PlanarProximity
from incipient.geometry.plane.grains import Grain
from incipient.geometry.proximity import Proximity
from incipient.geometry.space.beds import Terrain
from incipient.geometry.space.closest import SpatialProximity
from incipient.geometry.space.grains import Solid


def proximity(grain: Grain | Solid, bed: Bed | Terrain) -> Proximity:
    """A grain and a bed for queries at many placements. Raises SceneError if only one is planar."""
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
    """The grain turned by `angle` (in 3-D a unit quaternion, or 0) and lowered above `x` onto the bed."""
    near = proximity(grain, bed)
    if grain.gdim == 2:
        return near.lowered(Placement((float(x), 0.0), float(angle)))  # type: ignore[arg-type]
    w, a, b, c = (1.0, 0.0, 0.0, 0.0) if np.ndim(angle) == 0 else angle  # type: ignore[misc]
    first, second = np.asarray(x, dtype=float)
    return near.lowered(Placement((first, second, 0.0), quaternion=(w, a, b, c)))


def clearance(
    grain: Grain | Solid, placement: Placement, bed: Bed | Terrain
) -> tuple[float, Floats, Floats]:
    """The smallest distance from the bed, negative below it, and the points (gdim,) on grain and bed.

    In 3-D exact on smooth beds as long as it is less than their feature.
    """
    return proximity(grain, bed).clearance(placement)


def lifted(grain: Grain | Solid, placement: Placement, bed: Bed | Terrain, gap: float) -> Placement:
    """The grain straight above (or below) `placement` whose smallest distance to the bed is `gap` >= 0."""
    if not (np.isfinite(gap) and gap >= 0.0):
        raise SceneError(f"the gap {gap} is not a distance; give a number that is not negative")
    return proximity(grain, bed).lowered(placement, gap)


def touching(
    grain: Grain | Solid, placement: Placement, bed: Bed | Terrain, tolerance: float
) -> Contacts:
    """All contacts of a grain whose distance from the bed is at most `tolerance` (a length).

    Point contacts are local minima of the distance. A straight side on a straight piece of bed is a patch: its two
    ends, each with half of its length as area; in 3-D the corners of the patch's convex hull, with areas of the same
    sum and centroid. `areas` is None without a patch. The normal is the grain's where its surface is smooth, minus the
    bed's at a corner of the grain, and at a corner of the bed the bisector; a valley's corner has a contact for each
    side.

    Raises SceneError if nothing touches, or if only one of grain and bed is planar.
    """
    if not tolerance > 0.0:
        raise SceneError(
            f"contact tolerance {tolerance} is not a positive length; give a positive number"
        )
    return proximity(grain, bed).contacts(placement, tolerance)

"""A grain and its bed, in 2-D and 3-D."""

from __future__ import annotations

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

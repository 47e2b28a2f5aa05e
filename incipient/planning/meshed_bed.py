"""Extent of the resolved part of a 3-D bed, and of the planar far bed around it."""

import numpy as np

from ..geometry.placement import Placement
from ..meshes import Resolved
from .scene_geometry import Geometry

SAMPLES = 2000  # of heights across the inflow
# Where a bed is meshed as it is: within so many grain sizes of the grain, then over so many features to its level.
MESHED_BED, PASSAGE = 3.0, 2.0
# A grain on much smaller forms sees many of them alike: from so many features on fewer grain sizes do; never fewer
# features than the forms next to the grain.
MANY_FEATURES, FEWEST_SIZES, FEWEST_FEATURES = 30.0, 1.5, 3.0


def resolved_bed(geometry: Geometry, placement: Placement | None, datum: float) -> Resolved | None:
    """The region about the grain in which bedforms are meshed. Beyond it the bed is planar, at the flow's datum."""
    bed, grain, domain = geometry.bed, geometry.grain, geometry.domain
    if bed is None or grain is None or placement is None or not np.isfinite(bed.feature):
        return None
    radius = np.clip(
        MANY_FEATURES * bed.feature, FEWEST_SIZES * grain.size, MESHED_BED * grain.size
    )
    radius = geometry.meshed_bed * float(max(radius, FEWEST_FEATURES * bed.feature))
    passage = PASSAGE * bed.feature
    reach = radius + passage
    x, y = placement.centre[:2]
    sides = (x - domain.left, domain.right - x, *np.abs(np.subtract(domain.across, y)))
    return None if reach >= max(sides) else Resolved((x, y), radius, passage, datum)


def height_at_inflow(geometry: Geometry, datum: float) -> float:
    """Height of the bed where the flow enters. Not collective.

    In 3-D it is the mean, or that of the planar bed that takes its place there.
    """
    bed, domain = geometry.bed, geometry.domain
    if bed is None:
        return domain.bottom
    if geometry.gdim == 2:
        return float(bed.height([domain.left])[0])
    resolved = resolved_bed(geometry, geometry.placement, datum)
    if resolved is not None and resolved.level is not None:
        return resolved.level
    y = np.linspace(*domain.across, SAMPLES)
    return float(np.mean(bed.height(np.column_stack([np.full_like(y, domain.left), y]))))

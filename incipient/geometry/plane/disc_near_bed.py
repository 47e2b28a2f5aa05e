"""Where a disc comes close to a bed of straight lines and arcs: all local minima of the gap, by formulas.

What `distance.approaches` finds for any grain and bed by sampling takes milliseconds; a disc in motion asks often.
"""

import math
from functools import lru_cache

import numpy as np

from incipient.arrays import Floats
from incipient.geometry.plane.bed import Bed
from incipient.geometry.plane.curves import Arc, Curve, Line, Point

HIDDEN = 1e-9  # of the radius: how much nearer another part of the bed is to what does not count
AT_START, WITHIN, AT_END = 0, 1, 2

Foot = tuple[int, Point]  # where on a curve, and the place


def disc_near_bed(
    centre: Point, radius: float, bed: Bed, within: float
) -> tuple[Floats, Floats] | None:
    """Gaps (k,) not above `within`, and the bed's points (k, 2) there; None: not known by formulas.

    That is so for beds of other curves, and where the centre of the disc is within the bed.
    """
    x, y = centre
    reach = radius + within
    if y <= float(bed.height([x])[0]):
        return None
    # As long as the disc stays near, so do these.
    ends = (radius * math.floor((x - reach) / radius), radius * math.ceil((x + reach) / radius))
    lowest, highest = bed.extent
    curves = _curves(
        bed, *(ends if lowest <= ends[0] and ends[1] <= highest else (x - reach, x + reach))
    )
    if not all(
        isinstance(one, Line) or (isinstance(one, Arc) and one.major is None) for one in curves
    ):
        return None
    feet = [_foot(one, centre) for one in curves]
    places = [place for end, place in feet if end == WITHIN]
    places += [
        feet[k][1]
        for k in range(len(feet) - 1)
        if feet[k][0] == AT_END and feet[k + 1][0] == AT_START
    ]
    points = np.array([one for one in places if math.dist(one, centre) <= reach]).reshape(-1, 2)
    gaps = np.hypot(*(points - centre).T) - radius
    seen = bed.distance(centre + (points - centre) * (radius / (gaps + radius))[:, None])
    shown = seen >= gaps - HIDDEN * radius
    return gaps[shown], points[shown]


@lru_cache(maxsize=8)
def _curves(bed: Bed, start: float, end: float) -> tuple[Curve, ...]:
    return bed.curves(start, end)


def _foot(curve: Curve, point: Point) -> Foot:
    """The nearest place of a line or an arc to a point."""
    found = _within(curve, point)
    if found is not None:
        return WITHIN, found
    ends = curve.start, curve.end
    nearer = math.dist(point, ends[0]) > math.dist(point, ends[1])
    return (AT_END, ends[1]) if nearer else (AT_START, ends[0])


def _within(curve: Curve, point: Point) -> Point | None:
    """The nearest place of a line or an arc to a point if it is none of its ends."""
    (ax, ay), (bx, by), (x, y) = curve.start, curve.end, point
    if isinstance(curve, Arc):
        cx, cy = curve.centre
        ux, uy = x - cx, y - cy
        turn = (ax - cx) * (by - cy) - (ay - cy) * (bx - cx)
        after, before = (ax - cx) * uy - (ay - cy) * ux, ux * (by - cy) - uy * (bx - cx)
        if after * turn <= 0.0 or before * turn <= 0.0:
            return None
        scale = math.dist(curve.start, curve.centre) / math.hypot(ux, uy)
        return cx + scale * ux, cy + scale * uy
    along = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / ((bx - ax) ** 2 + (by - ay) ** 2)
    return (ax + along * (bx - ax), ay + along * (by - ay)) if 0.0 < along < 1.0 else None

"""Resting a grain on a bed, lifting it off, and measuring the gap, in the plane and in space.

Lengths are scene units, angles radians, positions those of the grain's centroid.
"""

from collections.abc import Callable, Sequence

import numpy as np

from incipient.arrays import Floats
from incipient.errors import SceneError
from incipient.geometry.placement import Placement
from incipient.geometry.plane.bed import Bed
from incipient.geometry.plane.distance import approaches, placed_outline
from incipient.geometry.plane.grain import Grain
from incipient.geometry.plane.outline import Outline
from incipient.geometry.space.closest import SpatialProximity
from incipient.geometry.space.solid import Solid
from incipient.geometry.space.terrain import Terrain

SECTIONS, ROUNDS = 16, 14  # of brackets: 2 out of 16 remain after a round


def rest(
    grain: Grain | Solid,
    bed: Bed | Terrain,
    x: float | Sequence[float],
    angle: float | Sequence[float] = 0.0,
) -> Placement:
    """The grain turned by `angle`, its centroid above `x`, lowered vertically until it touches the bed.

    In space `x` is a pair and `angle` a unit quaternion (or 0). Exact to 1e-12 of the grain's size: in the plane
    the smallest vertical distance is found along each piece of the outline between corners of outline and bed,
    by sampling and sections of sections; in space see `SpatialProximity.lowered`.
    """
    if isinstance(grain, Solid):
        w, a, b, c = (1.0, 0.0, 0.0, 0.0) if np.ndim(angle) == 0 else angle  # type: ignore[misc]
        first, second = np.asarray(x, dtype=float)
        return spatial(grain, bed).lowered(Placement((first, second, 0.0), quaternion=(w, a, b, c)))
    grain, bed = planar(grain, bed)
    above = Placement((float(x), 0.0), float(angle))  # type: ignore[arg-type]
    outline = placed_outline(grain, above)
    down = float((outline.starts[:, 1] - bed.height(outline.starts[:, 0])).min())
    # Lowered so far, the grain touches or enters the bed: only where it is at the bed can it come down first.
    near = placed_outline(grain, above.raised(-down)).near(bed, 0.0)
    return above.raised(-_smallest_drop(outline, near, bed, grain.size))


def spatial(grain: Grain | Solid, bed: Bed | Terrain) -> SpatialProximity:
    """Grain and bed in space, prepared. Raises SceneError if one of them is planar."""
    if isinstance(grain, Solid) and isinstance(bed, Terrain):
        return SpatialProximity(grain, bed)
    raise _mismatch(grain, bed)


def planar(grain: Grain | Solid, bed: Bed | Terrain) -> tuple[Grain, Bed]:
    """Grain and bed in the plane. Raises SceneError if one of them is not planar."""
    if isinstance(grain, Grain) and isinstance(bed, Bed):
        return grain, bed
    raise _mismatch(grain, bed)


def _mismatch(grain: Grain | Solid, bed: Bed | Terrain) -> SceneError:
    return SceneError(
        f"a {type(grain).__name__} cannot rest on a bed {type(bed).__name__}: one is planar, the other is not; "
        "take both in the plane or both in space"
    )


def _smallest_drop(outline: Outline, curves: np.ndarray, bed: Bed, size: float) -> float:
    """The smallest vertical distance y - b(x) along some of an outline's curves."""
    curve, s = outline.sampled(curves, bed, size)
    x = outline.point(curve, s)[:, 0]
    corners = bed.corners(float(x.min()), float(x.max()))
    at, place = outline.crossings(curve, s, corners)
    curve, s = np.concatenate([curve, at]), np.concatenate([s, place])
    order = np.lexsort((s, curve))
    curve, s = curve[order], s[order]
    drop = _drop(outline, curve, bed, s)
    # Refine wherever a step between samples could hide the minimum.
    joined = curve[1:] == curve[:-1]
    steepest = np.abs(np.diff(drop)[joined]).max(initial=0.0)
    valley = drop <= drop.min() + steepest
    valley[1:] &= (drop[1:] <= drop[:-1]) | ~joined
    valley[:-1] &= (drop[:-1] <= drop[1:]) | ~joined
    lowest = np.flatnonzero(valley)
    left = lowest - (lowest > 0) * np.append(False, joined)[lowest]
    right = lowest + (lowest < len(s) - 1) * np.append(joined, False)[lowest]
    low = np.concatenate([s[left], s[lowest]])
    high = np.concatenate([s[lowest], s[right]])
    return float(
        min(drop.min(), _sectioned(outline, np.tile(curve[lowest], 2), bed, low, high).min())
    )


def _drop(outline: Outline, curve: np.ndarray, bed: Bed, s: Floats) -> Floats:
    points = outline.point(curve, s)
    return np.asarray(points[:, 1] - bed.height(points[:, 0]))


def _sectioned(outline: Outline, curve: np.ndarray, bed: Bed, low: Floats, high: Floats) -> Floats:
    """The smallest vertical distances in the brackets [low, high] (n,) of curves (n,), down to 2e-13 of a bracket.

    Every round keeps two of the sections, those about the lowest place between them: it costs little more to ask for
    many places than for one.
    """
    inner = np.arange(1, SECTIONS)[:, None] / SECTIONS
    asked = np.tile(curve, SECTIONS - 1)
    for _ in range(ROUNDS):
        s = low + inner * (high - low)
        lowest = _drop(outline, asked, bed, s.ravel()).reshape(s.shape).argmin(axis=0)
        section = (high - low) / SECTIONS
        low = low + lowest * section
        high = low + 2.0 * section
    return _drop(outline, curve, bed, 0.5 * (low + high))


def clearance(
    grain: Grain | Solid, placement: Placement, bed: Bed | Terrain
) -> tuple[float, Floats, Floats]:
    """The smallest distance from the bed, and the points (gdim,) on grain and bed where it occurs.

    Exact to 1e-10 of the grain's size (in space on smooth beds as long as it is less than their feature);
    negative where the grain is below the bed. Where several minima are equal (a flat contact) it is the first.
    """
    if isinstance(grain, Solid):
        return spatial(grain, bed).clearance(placement)
    grain, bed = planar(grain, bed)
    best = min(approaches(grain, placement, bed), key=lambda approach: approach.distance)
    return best.distance, best.on_grain, best.on_bed


def _lowered(
    grain: Grain | Solid, placement: Placement, bed: Bed | Terrain
) -> tuple[Placement, Callable[[Placement], float]]:
    """The grain lowered or raised from `placement` onto the bed, and its distance from the bed elsewhere."""
    if isinstance(grain, Solid):
        near = spatial(grain, bed)  # prepared once: that takes longer than a question
        return near.lowered(placement), lambda place: near.clearance(place)[0]
    touching = rest(grain, bed, placement.centre[0], placement.angle)
    return touching, lambda place: clearance(grain, place, bed)[0]


def lifted(grain: Grain | Solid, placement: Placement, bed: Bed | Terrain, gap: float) -> Placement:
    """The grain straight above (or below) `placement` whose smallest distance to the bed is `gap` >= 0.

    `gap` is a length in scene units. The distance grows steadily with height because the bed is a graph.
    """
    if not (np.isfinite(gap) and gap >= 0.0):
        raise SceneError(f"the gap {gap} is not a distance; give a number that is not negative")
    touching, distance = _lowered(grain, placement, bed)
    if gap == 0.0:
        return touching

    from scipy.optimize import brentq  # which takes time to import, and most grains rest

    def excess(lift: float) -> float:
        """The distance after a lift, less the gap."""
        return distance(touching.raised(lift)) - gap

    low, high = gap, 2.0 * gap
    while excess(high) < 0.0:
        low, high = high, 2.0 * high
    if excess(low) >= 0.0:
        return touching.raised(low)
    return touching.raised(brentq(excess, low, high, xtol=1e-13 * grain.size))

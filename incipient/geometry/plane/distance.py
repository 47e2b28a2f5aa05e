"""Where a grain's outline comes close to the bed: all local minima of the distance along the outline."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from incipient.arrays import Floats, quarter_turned
from incipient.geometry.placement import Placement
from incipient.geometry.plane.bed import Bed
from incipient.geometry.plane.curves import Curve
from incipient.geometry.plane.grain import Grain
from incipient.geometry.plane.outline import Outline

SECTIONS, SECTIONINGS = (
    128,
    8,
)  # a bracket of parameters is cut into parts so often: down to round-off


@dataclass(frozen=True)
class Approach:
    """One local minimum of the distance from the bed along the outline of a placed grain.

    `normal` is the grain's outward normal there and None at a corner of the grain; `distance` is negative
    where the outline is below the bed. `place` is the number of the curve of the outline and its parameter.
    """

    distance: float
    on_grain: Floats
    on_bed: Floats
    normal: Floats | None
    place: tuple[int, float] = (0, 0.0)


def placed_outline(grain: Grain, placement: Placement) -> Outline:
    """The grain's outline in the scene."""
    return Outline(grain.chain, placement)


def approaches(
    grain: Grain, placement: Placement, bed: Bed, within: float | None = None
) -> list[Approach]:
    """All local minima of the distance not above `within`; None: those that may be the smallest.

    The minima are exact to round-off as long as they lie farther apart than the samples (1/64 of the smaller
    of half the grain's size and the bed's feature). Along a flat contact every sample is a minimum.
    """
    outline = placed_outline(grain, placement)
    kept = outline.near(bed, within)
    if len(kept) == 0:
        return []
    curve, s = outline.sampled(kept, bed, grain.size)
    points = outline.point(curve, s)
    spacing = float(
        (outline.chain.lengths[kept] / outline.steps(kept, bed, grain.size)).max(initial=0.0)
    )
    if within is None:
        straight_down = float((points[:, 1] - bed.height(points[:, 0])).min())
        distances = _distances_below(points, bed, max(straight_down, 0.0) + spacing)
        within = float(distances.min())
    else:
        distances = _distances_below(points, bed, within + spacing)
    brackets = _brackets(curve, s, distances, within + spacing, len(outline))
    return [refined(outline, one, bed) for one in brackets]


def _distances_below(points: Floats, bed: Bed, bound: float) -> Floats:
    """Distances (n,) of points (n, 2) from the bed; infinite where the crests show them to be above the bound."""
    close = points[:, 1] - bed.crest <= bound
    distances = np.full(len(points), np.inf)
    if close.any():
        distances[close] = bed.distance(points[close])
    return distances


def _brackets(
    curve: np.ndarray, s: Floats, distances: Floats, below: float, count: int
) -> list[list[tuple[int, float, float]]]:
    """The (curve, first, last parameter) that enclose each sampled local minimum `below` the bound.

    `curve` and `s` (m,) as `Outline.sampled` gives them, `count` is the number of curves of the outline. A minimum at
    a joint of two curves has a bracket on each.
    """
    if len(s) == 0:
        return []
    index = np.arange(len(s))
    starts = s == 0.0
    # The sample before the first of a curve is the last but one of the curve before, if that was sampled.
    before = np.where(starts, index - 2, index - 1)
    known = ~starts | (curve[index - 1] == (curve - 1) % count)
    low = np.where(known, distances[before], np.inf)
    inner = s < 1.0
    after = np.where(inner, np.roll(distances, -1), np.inf)
    valleys = np.flatnonzero(
        inner & (distances <= low) & (distances <= after) & (distances <= below)
    )
    found: list[list[tuple[int, float, float]]] = []
    for i in valleys:
        k, ahead = int(curve[i]), float(s[i + 1])
        if not starts[i]:
            found.append([(k, float(s[i - 1]), ahead)])
        elif known[i]:
            found.append([(int(curve[i - 1]), float(s[before[i]]), 1.0), (k, 0.0, ahead)])
        else:
            found.append([(k, 0.0, ahead)])
    return found


def refined(outline: Outline, brackets: list[tuple[int, float, float]], bed: Bed) -> Approach:
    """The lowest of the minima inside brackets (curve, first, last parameter)."""
    best: tuple[float, int, float] | None = None
    for k, low, high in brackets:
        s = _sectioned(lambda s, curve=outline[k]: _slopes(curve, s, bed) < 0.0, low, high)  # type: ignore[misc]
        value = float(bed.distance(outline[k].point(s))[0])
        if best is None or value < best[0]:
            best = value, k, s
    assert best is not None
    distance, k, s = best
    point = outline[k].point(s)
    return Approach(distance, point[0], bed.nearest(point)[0], _normal(outline, k, s), (k, s))


def _sectioned(is_left: Callable[[Floats], np.ndarray], low: float, high: float) -> float:
    """The parameter in [low, high] where `is_left` turns from true to false; an end if it does not."""
    start, end = low, high
    # A minimum at an end is that end exactly, so that corners are recognised.
    after_start, before_end = is_left(np.array([np.nextafter(low, high), np.nextafter(high, low)]))
    if not after_start:
        return start
    if before_end and is_left(np.linspace(low, high, SECTIONS + 1)[1:-1]).all():
        return end
    for _ in range(SECTIONINGS):
        s = np.linspace(low, high, SECTIONS + 1)
        right = np.flatnonzero(~is_left(s[1:-1]))
        k = int(right[0]) if len(right) else SECTIONS - 1
        low, high = float(s[k]), float(s[k + 1])
    if low == start:
        return start
    return end if high == end else 0.5 * (low + high)


def _slopes(curve: Curve, s: Floats, bed: Bed) -> Floats:
    """The derivatives (n,) of the distance along the curve, up to positive factors; also at distance zero."""
    points, tangents = curve.point(s), curve.tangent(s)
    feet = bed.nearest(points)
    left, right = bed.side_normals(feet[:, 0])
    at_corner = np.abs(left - right).max(axis=1, keepdims=True) > 1e-12
    away = np.where(at_corner, points - feet, left)
    return np.asarray((away * tangents).sum(axis=1))


def _normal(outline: Outline, k: int, s: float) -> Floats | None:
    """The outward normal at parameter s of curve k of a counter-clockwise outline, None at a corner."""
    tangent = outline[k].tangent(s)[0]
    other = tangent
    if s <= 0.0:
        other = outline[k - 1].tangent(1.0)[0]
    elif s >= 1.0:
        other = outline[(k + 1) % len(outline)].tangent(0.0)[0]
    if np.abs(other - tangent).max() > 1e-9:
        return None
    return -quarter_turned(tangent)

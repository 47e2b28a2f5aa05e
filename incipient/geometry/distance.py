"""Where a grain's outline comes close to the bed: all local minima of the distance along the outline."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from incipient.geometry.bed import Bed
from incipient.geometry.curves import Curve, Floats
from incipient.geometry.grain import Grain, Placement

BISECTIONS = 54  # halvings of a bracket of parameters: down to round-off
SECTIONS, SECTIONINGS = 32, 11  # the same with 32 parts at a time


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


def placed_outline(grain: Grain, placement: Placement) -> tuple[Curve, ...]:
    """The grain's outline in the scene."""
    return tuple(curve.moved(placement) for curve in grain.outline())


def samples(curve: Curve, bed: Bed, size: float) -> Floats:
    """Parameters along a curve, dense enough for its own shape and for the features of the bed."""
    count = int(np.ceil(64.0 * curve.length / min(bed.feature, 0.5 * size)))
    return np.linspace(0.0, 1.0, min(max(count, 32), 8192) + 1)


def approaches(grain: Grain, placement: Placement, bed: Bed, within: float | None = None) -> list[Approach]:
    """All local minima of the distance not above `within`; None: those that may be the smallest.

    The minima are exact to round-off as long as they lie farther apart than the samples (1/64 of the smaller
    of half the grain's size and the bed's feature). Along a flat contact every sample is a minimum.
    """
    outline = placed_outline(grain, placement)
    parameters = [samples(curve, bed, grain.size) for curve in outline]
    points = [curve.point(s) for curve, s in zip(outline, parameters, strict=True)]
    spacing = max(curve.length / (len(s) - 1) for curve, s in zip(outline, parameters, strict=True))
    straight_down = min(float((x[:, 1] - bed.height(x[:, 0])).min()) for x in points)
    bound = max(straight_down, 0.0) if within is None else within
    distances = [_distances_below(x, bed, bound + spacing) for x in points]
    if within is None:
        within = min(float(d.min()) for d in distances)
    return [
        refined(outline, brackets, bed)
        for brackets in _brackets(parameters, distances, within + spacing)
        if brackets
    ]


def _distances_below(points: Floats, bed: Bed, bound: float) -> Floats:
    """Distances (n,) of points (n, 2) from the bed; infinite where the crests show them to be above the bound."""
    close = points[:, 1] - bed.crest <= bound
    distances = np.full(len(points), np.inf)
    if close.any():
        distances[close] = bed.distance(points[close])
    return distances


def _brackets(
    parameters: list[Floats], distances: list[Floats], below: float
) -> list[list[tuple[int, float, float]]]:
    """For each sampled local minimum `below` the bound: the (curve, first, last parameter) that enclose it.

    A minimum at a joint of two curves has a bracket on each.
    """
    found: list[list[tuple[int, float, float]]] = []
    for k, (s, d) in enumerate(zip(parameters, distances, strict=True)):
        before = distances[k - 1][-2]
        low = np.concatenate([[before], d[:-2]])
        valley = (d[:-1] <= low) & (d[:-1] <= d[1:]) & (d[:-1] <= below)
        last = len(parameters[k - 1]) - 2
        for i in np.flatnonzero(valley):
            if i > 0:
                found.append([(k, float(s[i - 1]), float(s[i + 1]))])
            else:
                previous = (k - 1) % len(parameters)
                found.append([(previous, float(parameters[k - 1][last]), 1.0), (k, 0.0, float(s[1]))])
    return found


def refined(outline: tuple[Curve, ...], brackets: list[tuple[int, float, float]], bed: Bed) -> Approach:
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


def bisected(is_left: Callable[[float], bool], low: float, high: float) -> float:
    """The parameter in [low, high] where `is_left` turns from true to false; an end if it does not."""
    start, end = low, high
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if is_left(middle):
            low = middle
        else:
            high = middle
    # A minimum at an end is that end exactly, so that corners are recognised.
    if low == start:
        return start
    return end if high == end else 0.5 * (low + high)


def _sectioned(is_left: Callable[[Floats], np.ndarray], low: float, high: float) -> float:
    """The parameter as `bisected` finds it, by many at a time: fewer and longer calls."""
    start, end = low, high
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


def _normal(outline: tuple[Curve, ...], k: int, s: float) -> Floats | None:
    """The outward normal at parameter s of curve k of a counter-clockwise outline, None at a corner."""
    tangent = outline[k].tangent(s)[0]
    other = tangent
    if s <= 0.0:
        other = outline[k - 1].tangent(1.0)[0]
    elif s >= 1.0:
        other = outline[(k + 1) % len(outline)].tangent(0.0)[0]
    if np.abs(other - tangent).max() > 1e-9:
        return None
    return np.array([tangent[1], -tangent[0]])


def corners_below(outline: tuple[Curve, ...], bed: Bed) -> Floats:
    """Abscissae of the bed's corners under an outline."""
    ends = np.vstack([curve.point(np.linspace(0.0, 1.0, 33)) for curve in outline])
    return bed.corners(float(ends[:, 0].min()), float(ends[:, 0].max()))


def crossings(curve: Curve, s: Floats, abscissae: Floats) -> Floats:
    """Parameters at which a sampled curve passes over the given abscissae."""
    x = curve.point(s)[:, 0]
    found = []
    for abscissa in abscissae:
        for i, (left, right) in enumerate(pairwise(x - abscissa)):
            if left * right < 0.0:
                rising = left < 0.0
                found.append(
                    bisected(
                        lambda t, rising=rising, at=abscissa: (curve.point(t)[0, 0] < at) == rising,  # type: ignore[misc]
                        float(s[i]),
                        float(s[i + 1]),
                    )
                )
    return np.array(found)

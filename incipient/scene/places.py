"""Rules of a scene `s` on sizes and positions of domain, bed, grain and surface; each needs the earlier ones."""

import math
from typing import Any

import numpy as np

from ..arrays import spatial
from ..geometry.closest import clearance
from .section import Rule, when
from .symmetry import differences

# Distances in grain sizes: from the bed, where cells get as small as the gap; from a side, where they do not.
TOUCHING, NEARLY_TOUCHING = 1e-6, 1e-3
FARTHEST = 1e6  # extents of the domain, in sizes of grain or bedforms
FINEST_PLACE = 1e-6  # of the smallest size in the scene: least resolution of positions
_SAME = 1e-9  # of an extent of the domain
_PLACES, _ALONG = (
    201,
    2001,
)  # points across and, in 2-D, along which bed and free surface are checked
CELLS_OF_A_FORM = 20  # at the least


def _coarse(s: Any) -> list[Any]:
    finest = s.contact.tolerance if s.grain and s.contact else FINEST_PLACE
    size = s.grain.size if s.grain else math.inf
    sides = [
        (
            name if abs(start) <= extent else "origin",
            math.ulp(abs(start) + extent),
            finest * min(extent, size),
        )
        for (name, extent), start in zip(s.domain.sizes.items(), s.domain.origin, strict=True)
    ]
    return [side for side in sides if 4.0 * side[1] > side[2]]


def _vast(s: Any) -> list[Any]:
    what, size = "the grain", s.grain.size if s.grain else math.inf
    if s.gdim == 3 and s.bed and s.bed_shape.feature < size:
        what, size = "a bedform", s.bed_shape.feature
    sides = s.domain.sizes.items()
    return [(key, side, side / size, what) for key, side in sides if side > FARTHEST * size]


def _forms(s: Any) -> Any:
    """Number of bedforms to be meshed, in 3-D of those below the grain, if too many."""
    forms, where = s.bed.forms(s.domain.length), "on the domain's length"
    if s.gdim == 3:
        area, where = s.domain.length * s.domain.width, "in the domain"
        if s.grain:
            area, where = min(s.grain.size**2, area), "under the grain"
        forms = area / (2.0 * s.bed_shape.feature) ** 2
    return forms * CELLS_OF_A_FORM > s.numerics.max_cells and (forms, where)


def _short(s: Any) -> list[Any]:
    reaches: Any = s.bed_shape.extent if s.gdim == 3 else ()
    slack, remedy = _SAME, "enlarge its cell, change its offset or shrink the domain"
    if s.bed.kind == "polyline":
        reaches, slack = ((s.bed.points[0][0], s.bed.points[-1][0]),), 0.0
        remedy = "add points or shorten the domain"
    return [
        (axis, first, last, low, high, remedy)
        for axis, (first, last), (low, high) in zip("xy", reaches, s.domain.spans, strict=False)
        if low < first - slack * (high - low) or high > last + slack * (high - low)
    ]


def _steps_at_ends(s: Any) -> list[float]:
    (ends,) = s.domain.spans
    return [x for x in s.bed.steps if min(abs(x - end) for end in ends) <= _SAME * s.domain.length]


def _heights(s: Any) -> tuple[float, float]:
    """The bed's lowest and highest height."""
    if s.gdim == 3:
        heights, spans = s.bed_shape.height(s.domain.grid(_PLACES, _PLACES)), s.domain.spans
    else:
        (spans,) = s.domain.spans
        x = np.concatenate([s.domain.grid(_ALONG)[:, 0], s.bed_shape.corners(*spans)])
        heights = s.bed_shape.height(x)
    return float(heights.min()), max(float(heights.max()), s.bed_shape.crest_level(*spans))


def _datum(s: Any) -> Any:
    """Range of the bed's heights above its base, if it excludes the datum: a layer of fluid would be at rest."""
    lowest, highest = (height - s.domain.bottom for height in _heights(s))
    slack = _SAME * s.domain.height
    return not lowest - slack <= s.flow.datum <= highest + slack and (lowest, highest)


def _outside(s: Any) -> list[Any]:
    return [
        (number, axis, value, low, high)
        for number, place in enumerate(s.surface.places())
        for axis, value, (low, high) in zip("xy", place, s.domain.spans, strict=False)
        if not low <= value <= high
    ]


def _low_surface(s: Any) -> Any:
    across = s.domain.grid(*[_PLACES] * len(s.domain.spans))
    depths = s.domain.ceiling + s.surface.height(spatial(across).T) - s.domain.bottom
    if s.bed:
        places = across[:, 0] if s.gdim == 2 else across
        depths += s.domain.bottom - s.bed_shape.height(places)
    place = zip("xy", across[int(np.argmin(depths))], strict=False)
    return depths.min() <= 0.0 and ", ".join(f"{axis} = {value:g}" for axis, value in place)


def _away(s: Any) -> list[Any]:
    centre = (s.body.x, getattr(s.body, "y", None)) if s.body.centre is None else s.body.centre
    axes = zip("xy", centre, s.domain.spans, strict=False)
    return [
        (axis, value, low, high)
        for axis, value, (low, high) in axes
        if value is not None and not low < value < high
    ]


def _sides(s: Any) -> list[Any]:
    """Axis, extreme coordinate of the grain, side, its place, and the distance between them."""
    if (placement := s.placement) is None:
        return []
    if s.gdim == 2:
        points = placement.to_scene(s.grain.chain.points(65))
    else:
        axes = np.vstack([np.eye(3), -np.eye(3)]) @ placement.rotation
        points = placement.to_scene([s.grain.extreme(axis) for axis in axes])
    extent = zip(points.min(axis=0), points.max(axis=0), strict=True)
    across = [("side at least y", "side at largest y")] * (s.gdim - 2)
    names = [("left side", "right side"), *across, ("lower side", "top")]
    box = (*s.domain.spans, (s.domain.bottom, s.domain.ceiling))
    sides = []
    for axis, (low, high), (start, end), (first, last) in zip(
        "xyz", extent, box, names, strict=False
    ):
        sides += [(axis, low, first, start, low - start), (axis, high, last, end, end - high)]
    passed = ["lower side"] * bool(s.bed) + [*sum(across, ())] * (s.body.shape == "cylinder")
    return [side for side in sides if side[2] not in passed]


def _into_bed(s: Any) -> Any:
    """Why the grain and the bed overlap or touch, and the remedy."""
    depth, tolerance = -clearance(s.grain, s.placement, s.bed_shape)[0], s.contact_tolerance
    remedy = "raise the grain, or give x to let it rest on the bed"
    if s.body.x is not None:  # lowered onto a bed finer than the resolution of its support
        remedy = (
            "make the bedforms larger or flatter: next to the grain they are too steep to lower it"
        )
    if depth > tolerance:
        return f"the grain reaches {depth:.3g} into the bed", remedy
    held = not s.rests and -depth <= max(tolerance, TOUCHING * s.grain.size)
    return held and ("the grain touches the bed above which centre holds it", remedy)


def _not_across(s: Any) -> Any:
    low, high = (s.body.centre[1] + end * s.body.length for end in (-0.5, 0.5))
    near, far = s.domain.across
    return max(abs(low - near), abs(high - far)) > _SAME * (far - near) and (low, high, near, far)


_MOVE = "move the grain, make it smaller or enlarge the domain"
_PLACE = "body.{s.body.place}"

PLACES = (
    Rule("domain.{v[0]}", _coarse,
         "is so large that numbers there are {v[1]:.2g} apart, but positions are needed to {v[2]:.2g}",
         "move the scene towards zero, or make it smaller"),
    Rule("domain.{v[0]}", _vast, "is {v[1]:g}, {v[2]:.2g} times the size of {v[3]}",
         f"give at most {FARTHEST:g} times that size"),
    *when(lambda s: s.bed,
        Rule("bed", _forms,
             f"has about {{v[0]:.2g}} forms {{v[1]}}, with at least {CELLS_OF_A_FORM} cells each more than "
             "numerics.max_cells = {s.numerics.max_cells}",
             "enlarge them, use a flat bed instead, or allow more with --set numerics.max_cells=NUMBER"),
        Rule("bed", lambda s: s.bed.kind == "polyline" and _steps_at_ends(s),
             "has a step at x = {v:g}, an end of the domain", "leave out one of its two points, or move it inward"),
        Rule("bed", _short,
             "reaches from {v[0]} = {v[1]:g} to {v[2]:g}, the domain from {v[3]:g} to {v[4]:g}", "{v[5]}"),
        Rule("bed", lambda s: (top := _heights(s)[1]) >= s.domain.ceiling and ("xyz"[s.up], top),
             "rises to {v[0]} = {v[1]:g}, the top is at {s.domain.ceiling:g}",
             "enlarge domain.height or lower the bed"),
        Rule("flow.datum", lambda s: s.gdim == 3 and getattr(s.flow, "datum", "") == "effective",
             'is "effective" in 3-D, where it is not computed', 'use "auto" or a height'),
        Rule("flow.datum", lambda s: isinstance(getattr(s.flow, "datum", ""), float) and _datum(s),
             "is {s.flow.datum:g}, the bed's heights above its base line go from {v[0]:g} to {v[1]:g}",
             'give one of them, or "auto", "crest" or "mean"'),
    ),
    *when(lambda s: s.surface,
        Rule("surface.stations.{v}",
             lambda s: s.gdim == 2 and [n for n, place in enumerate(s.surface.places()) if place[1:]],
             "has 2 coordinates", "give its x"),
        Rule("surface.stations.{v}",
             lambda s: s.gdim == 3 and [n for n, place in enumerate(s.surface.places()) if not place[1:]],
             "has 1 coordinate", "give [x, y]"),
        Rule("surface.stations.{v[0]}", _outside,
             "{v[1]} = {v[2]:g} is outside the domain", "give {v[3]:g} to {v[4]:g}"),
        Rule("surface.{s.surface.given}", _low_surface,
             "brings the surface down to the bed at {v}", "give a smaller elevation"),
    ),
    *when(lambda s: s.body,
        Rule(_PLACE, lambda s: s.grain.size >= math.hypot(*s.domain.sizes.values()),
             "the grain measures {s.grain.size:g}, more than the domain", _MOVE),
        Rule(_PLACE, _away, "{v[0]} = {v[1]:g} is outside the domain, {v[2]:g} to {v[3]:g}", _MOVE),
        Rule(_PLACE, lambda s: [side for side in _sides(s) if side[-1] <= 0.0],
             "the grain reaches {v[0]} = {v[1]:g}, the domain's {v[2]} is at {v[3]:g}", _MOVE),
        Rule(_PLACE, lambda s: [side for side in _sides(s) if side[-1] < NEARLY_TOUCHING * s.grain.size],
             "the grain nearly touches the domain's {v[2]}, from which it is {v[4]:.3g}", _MOVE),
        Rule(_PLACE, lambda s: s.bed and s.placement and _into_bed(s), "{v[0]}", "{v[1]}"),
        Rule("body.length", lambda s: s.body.shape == "cylinder" and _not_across(s),
             "the cylinder reaches from y = {v[0]:g} to {v[1]:g}, the domain from {v[2]:g} to {v[3]:g}",
             "give domain.width, and the middle in centre"),
    ),
    Rule("domain.symmetric", lambda s: s.gdim == 3 and s.domain.symmetric is True and [*differences(s)],
         "is true, but {v}", "make the scene symmetric, or give false"),
)  # fmt: skip

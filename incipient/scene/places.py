"""Checks of sizes and positions of domain, bed, grain and surface."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Floats, Point, spatial
from ..errors import SceneError
from ..geometry.closest import clearance
from ..geometry.placement import Placement
from . import symmetry
from .domain import Domain
from .messages import Problem, counted, problem, split
from .surface import Surface

if TYPE_CHECKING:
    from .model import Scene

# Distances in grain sizes: from the bed, where cells get as small as the gap; from a side, where they do not.
TOUCHING, NEARLY_TOUCHING = 1e-6, 1e-3
FARTHEST = 1e6  # extents of the domain, in sizes of grain or bedforms
FINEST_PLACE = 1e-6  # of the smallest size in the scene: least resolution of positions
_SAME = 1e-9  # of the width: a cylinder reaches from side to side
_PLACES = 201  # points in each direction at which bed and free surface are checked
CELLS_OF_A_FORM = 20  # at the least


def misplaced(scene: Scene) -> list[Problem]:
    """Problems of positions and extents, from the first check that fails."""
    domain, bed, grain, shape, contact = (
        scene.domain,
        scene.bed,
        scene.grain,
        scene.bed_shape,
        scene.contact,
    )
    finest = FINEST_PLACE if grain is None or contact is None else contact.tolerance
    problems = [*_resolution(domain, grain, finest)] or [*_extents(domain, grain, shape)]
    if bed is not None and not problems:
        problems = (
            [*_forms(bed, shape, domain, grain, scene.numerics.max_cells)]
            or [*_bed_extent(bed, shape, domain)]
            or [*_datum_of_the_bed(getattr(scene.flow, "datum", "auto"), shape, domain)]
        )
    problems = (
        problems
        or (scene.has_surface and [*_surface_place(scene.surface or Surface(), domain, shape)])
        or [*_body_place(scene)]
    )
    is_mirrored = domain.gdim == 3 and domain.symmetric is True
    return (
        [*symmetry.contradictory(symmetry.differences(scene))]
        if is_mirrored and not problems
        else problems
    )


def _resolution(domain: Domain, grain: Any, finest: float) -> Iterator[Problem]:
    for name, start, extent in zip(_names(domain), domain.origin, domain.extents, strict=True):
        apart = math.ulp(abs(start) + extent)
        needed = finest * min(extent, extent if grain is None else grain.size)
        if 4.0 * apart > needed:
            key = "origin" if abs(start) > extent else name
            why = f"is so large that numbers there are {apart:.2g} apart, but positions are needed to {needed:.2g}"
            yield problem(f"domain.{key}", why, "move the scene towards zero, or make it smaller")


def _names(domain: Domain) -> tuple[str, ...]:
    return ("length", "height") if domain.gdim == 2 else ("length", "width", "height")


def _extents(domain: Domain, grain: Any, bed: Any) -> Iterator[Problem]:
    sizes = {"the grain": math.inf if grain is None else grain.size}
    if domain.gdim == 3 and bed is not None:
        sizes["a bedform"] = bed.feature
    what, size = min(sizes.items(), key=lambda item: item[1])
    for name, extent in zip(_names(domain), domain.extents, strict=True):
        if extent > FARTHEST * size:
            why = f"is {extent:g}, {extent / size:.2g} times the size of {what}"
            remedy = f"give at most {FARTHEST:g} times that size"
            yield problem(f"domain.{name}", why, remedy)


def _forms(bed: Any, shape: Any, domain: Domain, grain: Any, max_cells: int) -> Iterator[Problem]:
    """More bedforms than can be meshed; in 3-D those below the grain count."""
    forms, where = bed.forms(domain.length), "on the domain's length"
    if domain.gdim == 3:
        area, where = domain.extents[0] * domain.extents[1], "in the domain"
        if grain is not None:
            area, where = min(grain.size**2, area), "under the grain"
        forms = area / (2.0 * shape.feature) ** 2
    if forms * CELLS_OF_A_FORM > max_cells:
        why = f"has about {forms:.2g} forms {where}, with at least {CELLS_OF_A_FORM} cells each more than "
        remedy = "enlarge them, use a flat bed instead, or allow more with --set numerics.max_cells=NUMBER"
        yield problem("bed", f"{why}numerics.max_cells = {max_cells}", remedy)


def _bed_extent(bed: Any, shape: Any, domain: Domain) -> Iterator[Problem]:
    reaches: tuple[tuple[float, float], ...] = ()
    remedy, slack = "add points or shorten the domain", 0.0
    if bed.kind == "polyline":
        reaches = ((bed.points[0][0], bed.points[-1][0]),)
        yield from _steps_at_the_ends(bed.points, domain)
    elif domain.gdim == 3:  # a height map may not reach as far as the domain
        reaches, slack = shape.extent, 1e-9
        remedy = "enlarge its cell, change its offset or shrink the domain"
    for axis, (first, last), (low, high) in zip("xy", reaches, domain.spans, strict=False):
        if low < first - slack * (high - low) or high > last + slack * (high - low):
            why = (
                f"reaches from {axis} = {first:g} to {last:g}, the domain from {low:g} to {high:g}"
            )
            yield problem("bed", why, remedy)
    _, highest = _bed_heights(shape, domain)
    if highest >= domain.ceiling:
        why = f"rises to {'xyz'[domain.gdim - 1]} = {highest:g}, the top is at {domain.ceiling:g}"
        yield problem("bed", why, "enlarge domain.height or lower the bed")


def _steps_at_the_ends(points: Sequence[Point], domain: Domain) -> Iterator[Problem]:
    for (before, _), (after, _) in pairwise(points):
        at_an_end = any(abs(after - end) <= 1e-9 * domain.length for end in domain.spans[0])
        if before == after and at_an_end:
            why = f"has a step at x = {after:g}, an end of the domain"
            yield problem("bed", why, "leave out one of its two points, or move it inward")


def _datum_of_the_bed(level: float | str, bed: Any, domain: Domain) -> Iterator[Problem]:
    """A numeric datum must be a height of the bed: otherwise a layer of fluid would be at rest."""
    if level == "effective" and domain.gdim == 3:
        why = 'is "effective" in 3-D, where it is not computed'
        yield problem("flow.datum", why, 'use "auto" or a height')
    if isinstance(level, str):
        return
    lowest, highest = (height - domain.bottom for height in _bed_heights(bed, domain))
    slack = 1e-9 * domain.height
    if not lowest - slack <= level <= highest + slack:
        why = (
            f"is {level:g}, the bed's heights above its base line go from {lowest:g} to {highest:g}"
        )
        yield problem("flow.datum", why, 'give one of them, or "auto", "crest" or "mean"')


def _bed_heights(bed: Any, domain: Domain) -> tuple[float, float]:
    if domain.gdim == 3:
        heights = bed.height(domain.grid(_PLACES, _PLACES))
        crest = bed.crest_level(*domain.spans)
    else:
        x = np.linspace(domain.left, domain.right, 2001)
        heights = bed.height(np.concatenate([x, bed.corners(domain.left, domain.right)]))
        crest = bed.crest_level(domain.left, domain.right)
    return float(heights.min()), max(float(heights.max()), crest)


def _surface_place(surface: Surface, domain: Domain, bed: Any) -> Iterator[Problem]:
    for number, place in enumerate(surface.places()):
        key = ("surface", "stations", number)
        if len(place) != len(domain.spans):
            remedy = "give its x" if domain.gdim == 2 else "give [x, y]"
            yield Problem(key, f"has {counted(len(place), 'coordinate')}", remedy)
            return
        for axis, (low, high), value in zip("xy", domain.spans, place, strict=False):
            if not low <= value <= high:
                yield Problem(
                    key, f"{axis} = {value:g} is outside the domain", f"give {low:g} to {high:g}"
                )
                return
    yield from _too_low(surface, domain, bed)


def _too_low(surface: Surface, domain: Domain, bed: Any) -> Iterator[Problem]:
    across = domain.grid(*[_PLACES] * len(domain.spans))
    places = spatial(across).T
    try:
        heights = domain.ceiling + surface.height(places)
    except SceneError as error:
        yield problem("surface.elevation", *split(str(error)))
        return
    floor = np.full(len(across), domain.bottom)
    if bed is not None:
        floor = bed.height(across[:, 0] if domain.gdim == 2 else across)
    lowest = int(np.argmin(heights - floor))
    if heights[lowest] <= floor[lowest]:
        where = ", ".join(
            f"{axis} = {value:g}" for axis, value in zip("xy", across[lowest], strict=False)
        )
        key = "surface.points" if surface.points else "surface.elevation"
        yield problem(
            key, f"brings the surface down to the bed at {where}", "give a smaller elevation"
        )


def _body_place(scene: Scene) -> Iterator[Problem]:
    body, grain, bed, domain = scene.body, scene.grain, scene.bed_shape, scene.domain
    if body is None:
        return
    key = f"body.{'x' if body.centre is None else 'centre'}"
    into_bed, outside = "", [*_far_out(body, grain, domain)]
    try:
        placement = None if outside else scene.placement
        if placement is not None:
            outside = [*_beyond(body, *_reach(grain, placement), bed, domain, grain.size)]
        if placement is not None and bed is not None and not outside:
            into_bed = _into_bed(grain, placement, bed, scene.contact_tolerance, scene.rests)
    except SceneError as error:
        yield problem(key, *split(str(error)))
        return
    if body.shape == "cylinder" and body.centre is not None:
        yield from _not_across(body.centre[1], body.length, domain)
    for why in outside:
        yield problem(key, why, "move the grain, make it smaller or enlarge the domain")
    if into_bed and body.x is None:
        yield problem(key, into_bed, "raise the grain, or give x to let it rest on the bed")
    elif into_bed:  # lowered onto a bed finer than the resolution of its support
        remedy = (
            "make the bedforms larger or flatter: next to the grain they are too steep to lower it"
        )
        yield problem(key, into_bed, remedy)


def _far_out(body: Any, grain: Any, domain: Domain) -> Iterator[str]:
    if grain.size >= math.hypot(*domain.extents):
        yield f"the grain measures {grain.size:g}, more than the domain"
    centre = (body.x, body.aside) if body.centre is None else body.centre
    for axis, value, (low, high) in zip("xy", centre, domain.spans, strict=False):
        if value is not None and not low < value < high:
            yield f"{axis} = {value:g} is outside the domain, {low:g} to {high:g}"


def _beyond(
    body: Any, low: Floats, high: Floats, bed: Any, domain: Domain, size: float
) -> Iterator[str]:
    up = domain.up
    sides = [(0, low, "left side", domain.left), (0, high, "right side", domain.right)]
    if domain.gdim == 3 and body.shape != "cylinder":
        near, far = domain.across
        sides += [(1, low, "side at least y", near), (1, high, "side at largest y", far)]
    sides.append((up, high, "top", domain.ceiling))
    if bed is None:
        sides.append((up, low, "lower side", domain.bottom))
    for axis, end, side, place in sides:
        distance = end[axis] - place if end is low else place - end[axis]
        if distance <= 0.0:
            yield f"the grain reaches {'xyz'[axis]} = {end[axis]:g}, the domain's {side} is at {place:g}"
        elif distance < NEARLY_TOUCHING * size:
            yield f"the grain nearly touches the domain's {side}, from which it is {distance:.3g}"


def _not_across(middle: float, length: float, domain: Domain) -> Iterator[Problem]:
    low, high = (middle + end * length for end in (-0.5, 0.5))
    near, far = domain.across
    if max(abs(low - near), abs(high - far)) > _SAME * (far - near):
        why = f"the cylinder reaches from y = {low:g} to {high:g}, the domain from {near:g} to {far:g}"
        yield problem("body.length", why, "give domain.width, and the middle in centre")


def _into_bed(grain: Any, placement: Placement, bed: Any, tolerance: float, rests: bool) -> str:
    depth = -clearance(grain, placement, bed)[0]
    if depth > tolerance:
        return f"the grain reaches {depth:.3g} into the bed"
    held = not rests and -depth <= max(tolerance, TOUCHING * grain.size)
    return "the grain touches the bed above which centre holds it" if held else ""


def _reach(grain: Any, placement: Placement) -> tuple[Floats, Floats]:
    if placement.gdim == 2:
        points = placement.to_scene(grain.chain.points(65))
    else:
        axes = np.vstack([np.eye(3), -np.eye(3)]) @ placement.rotation
        points = placement.to_scene([grain.extreme(axis) for axis in axes])
    return points.min(axis=0), points.max(axis=0)

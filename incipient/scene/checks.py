"""Contradictions between the sections of a scene, each with the remedy."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from ..errors import SceneError
from .effects import contradictory
from .messages import Problem, split

if TYPE_CHECKING:
    import numpy as np

    from .model import Scene

# Distances in grain sizes: from the bed, where cells get as small as the gap; from a side, where they do not.
TOUCHING, NEARLY_TOUCHING = 1e-6, 1e-3
FINEST_PLACE = 1e-6  # of the smallest size in the scene: how well places must be known at the least
CELLS_OF_A_FORM = 20  # at the least
_CHANNEL_FLOWS = ("shear", "poiseuille", "uniform", "open-channel")
_TOPS_OF_FLOWS = {
    "poiseuille": ("auto", "wall"),
    "open-channel": ("auto", "slip", "stream"),
    "lid": ("auto", "wall"),
}


def contradictions(scene: Scene) -> list[Problem]:
    """All contradictions between sections; those of places and extents only when there are no others."""
    checks = (
        _flow,
        _scale,
        _bed_needed,
        _body_needed,
        _slope,
        _time,
        _motion,
        _ignored,
        _accuracy,
        contradictory,
    )
    found = [problem for check in checks for problem in check(scene)]
    if found:
        return found
    in_turn = (_resolution, _forms, _bed_extent, _datum_of_the_bed, _body_place)
    return next((problems for check in in_turn if (problems := [*check(scene)])), [])


def _flow(scene: Scene) -> Iterator[Problem]:
    kind, domain = scene.flow.kind, scene.domain
    if kind == "lid" and domain.kind != "box":
        yield Problem(
            ("flow", "kind"), "a lid closes a box but the domain is a channel", 'set domain.kind = "box"'
        )
        return
    if kind in _CHANNEL_FLOWS and domain.kind == "box":
        why = f'"{kind}" flows through but a box is closed'
        yield Problem(("flow", "kind"), why, 'set domain.kind = "channel", or use "lid" or "still"')
        return
    if domain.kind == "box" and domain.top == "stream" and kind != "expression":
        yield Problem(("domain", "top"), "a closed box has no stream on top", 'use "wall", "slip" or "auto"')
        return
    allowed = _TOPS_OF_FLOWS.get(kind, (domain.top,))
    if domain.top not in allowed:
        choices = " or ".join(f'"{top}"' for top in allowed)
        yield Problem(("domain", "top"), f'"{domain.top}" contradicts the flow "{kind}"', f"use {choices}")


def _scale(scene: Scene) -> Iterator[Problem]:
    if scene.fluid.scale == "grain" and scene.body is None:
        yield Problem(
            ("fluid", "scale"), '"grain" but there is no grain', 'add a section [body] or use "flow"'
        )


def _bed_needed(scene: Scene) -> Iterator[Problem]:
    if scene.bed is not None:
        return
    if getattr(scene.flow, "datum", "crest") != "crest":
        why = "is a height of the bed but there is none"
        yield Problem(("flow", "datum"), why, "add a section [bed] or leave it out")
    if scene.contact is not None and not (scene.body is not None and scene.body.moves):
        why = "friction needs a bed to rub against but there is none"
        yield Problem(("contact", "friction"), why, "add a section [bed] or leave [contact] out")
    if scene.body is not None and scene.body.x is not None:
        why = "the grain is to rest on a bed but there is none"
        yield Problem(("body", "x"), why, "add a section [bed], or give centre instead")


def _body_needed(scene: Scene) -> Iterator[Problem]:
    if scene.contact is not None and scene.body is None:
        why = "there is no grain to touch anything"
        yield Problem(("contact",), why, "add a section [body] or leave [contact] out")


def _slope(scene: Scene) -> Iterator[Problem]:
    if scene.bed is not None and scene.bed.slope_angle and scene.gravity is None:
        why = "a slope turns gravity but there is no gravity"
        yield Problem(("bed", "slope"), why, 'add a section [gravity] or use kind = "flat"')


def _time(scene: Scene) -> Iterator[Problem]:
    if scene.time is not None:
        return
    steady, remedy = "but without [time] the flow is steady", "add a section [time]"
    if scene.flow.kind == "expression" and scene.flow.unsteady:
        yield Problem(("flow", "components"), f"depend on t {steady}", f"{remedy} or leave t out")
    if scene.numerics.convection == "extrapolated":
        why = f'"extrapolated" needs earlier steps {steady}'
        yield Problem(("numerics", "convection"), why, f'{remedy} or use "implicit"')
    if scene.output.every > 0:
        yield Problem(("output", "every"), f"counts time steps {steady}", f"{remedy} or leave it out")
    if scene.output.checkpoint > 0:
        yield Problem(("output", "checkpoint"), f"counts time steps {steady}", f"{remedy} or leave it out")


def _motion(scene: Scene) -> Iterator[Problem]:
    if scene.body is None or not scene.body.moves:
        return
    if scene.time is None:
        yield Problem(("body", "motion"), "a grain moves in time", "add a section [time]")


def _ignored(scene: Scene) -> Iterator[Problem]:
    """Keys of [numerics] with another value than the default that the scene has no use for."""
    numerics = scene.numerics
    unused = []
    if scene.body is None or not scene.body.moves:
        keys = ("coupling", "interface_tolerance", "remesh_below")
        unused += [(key, "is read only for a grain that moves", "set body.motion") for key in keys]
    if scene.time is None:
        unused.append(("form", "is read only for flow in time", "add a section [time]"))
    for key, why, remedy in unused:
        if getattr(numerics, key) != type(numerics).model_fields[key].default:
            yield Problem(("numerics", key), why, f"leave it out or {remedy}")


def _accuracy(scene: Scene) -> Iterator[Problem]:
    """An accuracy is that of a load on a grain; that of a verdict needs all that a verdict needs."""
    numerics, body = scene.numerics, scene.body
    if numerics.accuracy is None:
        for budget in ("budget_seconds", "budget_mib"):
            if getattr(numerics, budget) is not None:
                why = "limits what is spent on an accuracy but none is asked for"
                yield Problem(("numerics", budget), why, "add numerics.accuracy or leave it out")
        if numerics.accuracy_includes != "discretisation":
            why = "says what an accuracy includes but none is asked for"
            yield Problem(("numerics", "accuracy_includes"), why, "add numerics.accuracy or leave it out")
        return
    key, verdict = ("numerics", "accuracy"), numerics.accuracy == "verdict"
    if body is None:
        why = "is that of the load on a grain but there is none"
        yield Problem(key, why, "add a section [body], or leave it out and choose numerics.mesh_size")
        return
    if scene.flow.kind == "still" and not body.moves:
        yield Problem(key, "is relative but a fluid at rest exerts no force", "leave it out")
        return
    if not verdict and numerics.accuracy_of != "safety factor":
        return
    if body.x is None or scene.bed is None or scene.contact is None or scene.mass is None:
        what = "a verdict" if verdict else "a safety factor"
        why = f"{what} needs a grain that rests on a bed, its density and friction"
        remedy = "give body.x, body.density, [bed] and [contact], or a number for the accuracy of the force"
        yield Problem(key if verdict else ("numerics", "accuracy_of"), why, remedy)
    elif verdict and scene.time is not None:
        yield Problem(key, '"verdict" is for steady flow', "give a number, or leave [time] out")


def _resolution(scene: Scene) -> Iterator[Problem]:
    """Coordinates so large that numbers next to each other are too far apart to place a grain, or cells."""
    domain, grain = scene.domain, scene.grain
    finest = FINEST_PLACE if grain is None or scene.contact is None else scene.contact.tolerance
    for axis, extent in enumerate((domain.length, domain.height)):
        apart = math.ulp(abs(domain.origin[axis]) + extent)
        needed = finest * min(extent, extent if grain is None else grain.size)
        if 4.0 * apart > needed:
            why = (
                f"is so large that numbers there are {apart:.2g} apart, but places are needed to {needed:.2g}"
            )
            key = "origin" if abs(domain.origin[axis]) > extent else ("length", "height")[axis]
            yield Problem(("domain", key), why, "move the scene towards zero, or make it smaller")


def _forms(scene: Scene) -> Iterator[Problem]:
    """More bed forms than can be meshed, which it would take too long to look at one by one."""
    if scene.bed is None:
        return
    forms = scene.bed.forms(scene.domain.length)
    if forms * CELLS_OF_A_FORM > scene.numerics.max_cells:
        why = (
            f"has about {forms:.2g} forms on the domain's length, with at least {CELLS_OF_A_FORM} cells each more than "
            f"numerics.max_cells = {scene.numerics.max_cells}"
        )
        remedy = "shorten the domain or enlarge the forms, or allow more with --set numerics.max_cells=NUMBER"
        yield Problem(("bed",), why, remedy)


def _bed_extent(scene: Scene) -> Iterator[Problem]:
    domain, bed = scene.domain, scene.bed
    if bed is None:
        return
    if bed.kind == "polyline":
        first, last = bed.points[0][0], bed.points[-1][0]
        if first > domain.left or last < domain.right:
            why = (
                f"reaches from x = {first:g} to {last:g}, the domain from {domain.left:g} to {domain.right:g}"
            )
            yield Problem(("bed",), why, "add points or shorten the domain")
    _, highest = _bed_heights(scene)
    if highest >= domain.ceiling:
        why = f"rises to y = {highest:g}, the top is at {domain.ceiling:g}"
        yield Problem(("bed",), why, "enlarge domain.height or lower the bed")


def _datum_of_the_bed(scene: Scene) -> Iterator[Problem]:
    """A datum given as a number must be a height that the bed has: above it a layer of fluid would be at rest."""
    level, base = getattr(scene.flow, "datum", "crest"), scene.domain.bottom
    if isinstance(level, str) or scene.bed is None:
        return
    lowest, highest = (height - base for height in _bed_heights(scene))
    slack = 1e-9 * scene.domain.height
    if not lowest - slack <= level <= highest + slack:
        why = f"is {level:g}, the bed's heights above its base line go from {lowest:g} to {highest:g}"
        yield Problem(("flow", "datum"), why, 'give one of them, or "crest" or "mean"')


def _body_place(scene: Scene) -> Iterator[Problem]:
    """The grain must lie within the domain, above the bed and clear of the walls."""
    if scene.body is None:
        return
    key = ("body", "x" if scene.body.centre is None else "centre")
    try:
        outside = [*_far_out(scene)] or [*_beyond(scene)]
        into_bed = [] if outside else [*_into_bed(scene)]
    except SceneError as error:
        yield Problem(key, *split(str(error)))
        return
    for why in outside:
        yield Problem(key, why, "move the grain, make it smaller or enlarge the domain")
    for why in into_bed:
        yield Problem(key, why, "raise the grain, or give x to let it rest on the bed")


def _far_out(scene: Scene) -> Iterator[str]:
    """Grains that need not be placed to see that they do not fit."""
    domain, body, grain = scene.domain, scene.body, scene.grain
    if body is None or grain is None:
        return
    if grain.size >= math.hypot(domain.length, domain.height):
        yield f"the grain measures {grain.size:g}, more than the domain"
    x = body.x if body.centre is None else body.centre[0]
    if x is not None and not domain.left < x < domain.right:
        yield f"x = {x:g} is outside the domain, {domain.left:g} to {domain.right:g}"


def _beyond(scene: Scene) -> Iterator[str]:
    """How the grain leaves the domain, or touches one of its sides, if only nearly."""
    domain, grain, outline = scene.domain, scene.grain, _outline(scene)
    assert grain is not None
    (left, low), (right, high) = outline.min(axis=0), outline.max(axis=0)
    sides = [
        ("x", left, left - domain.left, "left side", domain.left),
        ("x", right, domain.right - right, "right side", domain.right),
        ("y", high, domain.ceiling - high, "top", domain.ceiling),
    ]
    if scene.bed is None:
        sides.append(("y", low, low - domain.bottom, "lower side", domain.bottom))
    for axis, reach, distance, side, place in sides:
        if distance <= 0.0:
            yield f"the grain reaches {axis} = {reach:g}, the domain's {side} is at {place:g}"
        elif distance < NEARLY_TOUCHING * grain.size:
            yield f"the grain nearly touches the domain's {side}, from which it is {distance:.3g}"


def _into_bed(scene: Scene) -> Iterator[str]:
    """How deep the grain is in the bed, or that it touches the bed above which it is to be held."""
    bed, grain, placement = scene.bed_shape, scene.grain, scene.placement
    if bed is None or grain is None or placement is None:
        return
    from ..geometry.rest import clearance

    depth = -clearance(grain, placement, bed)[0]
    if depth > scene.contact_tolerance:
        yield f"the grain reaches {depth:.3g} into the bed"
    elif not scene.rests and -depth <= max(scene.contact_tolerance, TOUCHING * grain.size):
        yield "the grain touches the bed above which centre holds it"


def _outline(scene: Scene) -> np.ndarray:
    """Points (n, 2) on the grain's surface, in the scene."""
    import numpy as np

    grain, placement = scene.grain, scene.placement
    if grain is None or placement is None:
        return np.empty((0, 2))
    return placement.to_scene(grain.chain.points(65))


def _bed_points(scene: Scene) -> np.ndarray:
    """Points (n, 2) on the bed within the domain, its corners among them."""
    import numpy as np

    bed, domain = scene.bed_shape, scene.domain
    if bed is None:
        return np.empty((0, 2))
    x = np.linspace(domain.left, domain.right, 2001)
    x = np.concatenate([x, bed.corners(domain.left, domain.right)])
    return np.column_stack([x, bed.height(x)])


def _bed_heights(scene: Scene) -> tuple[float, float]:
    """The lowest and the highest y of the bed, the crest of one that repeats also where the domain has none."""
    bed, domain, heights = scene.bed_shape, scene.domain, _bed_points(scene)[:, 1]
    assert bed is not None
    return float(heights.min()), max(float(heights.max()), bed.crest_level(domain.left, domain.right))

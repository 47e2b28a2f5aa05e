"""Contradictions between the sections of a scene, each with the remedy."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from ..errors import SceneError
from . import effects_checks, surface_checks, symmetry, turbulence_checks
from .messages import Key, Problem, split
from .model import SceneSections
from .numerics import OF_SURFACE, OF_WALLS

# Distances in grain sizes: from the bed, where cells get as small as the gap; from a side, where they do not.
TOUCHING, NEARLY_TOUCHING = 1e-6, 1e-3
FINEST_PLACE = 1e-6  # of the smallest size in the scene: how well places must be known at the least
_SAME = 1e-9  # of the width: a cylinder reaches from side to side
_SPACING, _PLACES = 0.02, 201  # of points on a solid grain, in its size; in each direction on a bed in space
CELLS_OF_A_FORM = 20  # at the least
_IN_SPACE = {"body": '"sphere"', "bed": '"spheres"'}
_CHANNEL_FLOWS = ("shear", "poiseuille", "uniform", "open-channel", "log-law")
_ROUGHEST = 500.0  # u* k_s/nu up to which the mean profile follows the measured one (docs/numerics.md)
_TOPS_OF_FLOWS = {
    "poiseuille": ("auto", "wall"),
    "open-channel": ("auto", "slip", "stream", "free-surface"),
    "log-law": ("auto", "slip", "stream"),
    "lid": ("auto", "wall"),
}


def contradictions(scene: SceneSections) -> list[Problem]:
    """All contradictions between sections; those of places and extents only when there are no others."""
    checks = (
        _dimensions,
        _flow,
        _scale,
        _bed_needed,
        _body_needed,
        _slope,
        _time,
        _motion,
        _ignored,
        _accuracy,
        effects_checks.contradictory,
        surface_checks.contradictory,
        turbulence_checks.contradictory,
        _steps,
    )
    found = [problem for check in checks for problem in check(scene)]
    if found:
        return found
    in_turn = (
        _resolution,
        _forms,
        _bed_extent,
        _datum_of_the_bed,
        surface_checks.misplaced,
        _body_place,
        symmetry.contradictory,
    )
    return next((problems for check in in_turn if (problems := [*check(scene)])), [])


def _steps(scene: SceneSections) -> Iterator[Problem]:
    """Contact is found on beds that are graphs."""
    bed = scene.bed
    if bed is None or bed.kind != "polyline" or scene.body is None:
        return
    for (left, _), (right, _) in pairwise(bed.points):
        if left == right:
            why = f"has a vertical step at x = {left:g}, and grains over steps are not simulated by this version"
            yield Problem(("bed", "points"), why, "give the step a width, or leave the grain out")
            return


def _dimensions(scene: SceneSections) -> Iterator[Problem]:
    """Grain, bed and flow must be of the scene's dimension, which the domain's width decides."""
    body, bed, flow, gdim = scene.body, scene.bed, scene.flow, scene.gdim
    if body is not None and body.gdim != gdim:
        yield Problem(*_other_dimension("body", "shape", body.shape, gdim))
    if bed is not None and gdim not in bed.gdims:
        yield Problem(*_other_dimension("bed", "kind", bed.kind, gdim))
    if flow.kind == "expression" and len(flow.components) != gdim:
        remedy = "give two, as in [x, y]" if gdim == 2 else "give three, as in [x, y, z]"
        yield Problem(("flow", "components"), f"has {len(flow.components)} items", remedy)


def _other_dimension(section: str, key: str, value: str, gdim: int) -> tuple[Key, str, str]:
    """Key, why and remedy of something that is not of the scene's dimension."""
    if gdim == 2:
        why = f'domain.width is missing, which the "{value}" in space needs'
        return (section, key), why, f"add domain.width, or use a {section} of the plane"
    why = f'"{value}" lies in the plane, but domain.width makes the scene three-dimensional'
    return (section, key), why, f"use a {section} in space such as {_IN_SPACE[section]}, or leave width out"


def _flow(scene: SceneSections) -> Iterator[Problem]:
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
    yield from _roughness(scene)


def _roughness(scene: SceneSections) -> Iterator[Problem]:
    flow = scene.flow
    needs_grain = scene.fluid.scale == "grain" and scene.body is None
    if flow.kind != "log-law" or needs_grain:
        return
    rough = flow.shear_velocity * flow.roughness / scene.viscosity
    if rough > _ROUGHEST:
        why = f"is {rough:.3g} times nu/u*; the mean profile is known up to {_ROUGHEST:g} times that"
        yield Problem(("flow", "roughness"), why, "reduce it, or fluid.reynolds")


def _scale(scene: SceneSections) -> Iterator[Problem]:
    if scene.fluid.scale == "grain" and scene.body is None:
        yield Problem(
            ("fluid", "scale"), '"grain" but there is no grain', 'add a section [body] or use "flow"'
        )


def _bed_needed(scene: SceneSections) -> Iterator[Problem]:
    if scene.bed is not None:
        return
    if getattr(scene.flow, "datum", "auto") not in ("auto", "crest"):
        why = "is a height of the bed but there is none"
        yield Problem(("flow", "datum"), why, "add a section [bed] or leave it out")
    if scene.contact is not None and not (scene.body is not None and scene.body.moves):
        why = "friction needs a bed to rub against but there is none"
        yield Problem(("contact", "friction"), why, "add a section [bed] or leave [contact] out")
    if scene.body is not None and scene.body.x is not None:
        why = "the grain is to rest on a bed but there is none"
        yield Problem(("body", "x"), why, "add a section [bed], or give centre instead")


def _body_needed(scene: SceneSections) -> Iterator[Problem]:
    if scene.contact is not None and scene.body is None:
        why = "there is no grain to touch anything"
        yield Problem(("contact",), why, "add a section [body] or leave [contact] out")


def _slope(scene: SceneSections) -> Iterator[Problem]:
    if scene.bed is not None and scene.bed.slope_angle and scene.gravity is None:
        why = "a slope turns gravity but there is no gravity"
        yield Problem(("bed", "slope"), why, 'add a section [gravity] or use kind = "flat"')


def _time(scene: SceneSections) -> Iterator[Problem]:
    if scene.time is not None:
        if scene.time.until_steady is not None:
            for why, remedy in _never_steady(scene):
                yield Problem(("time", "until_steady"), why, f"leave it out or {remedy}")
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


def _never_steady(scene: SceneSections) -> Iterator[tuple[str, str]]:
    """Why the flow of a scene in time cannot become steady, each with a remedy."""
    from .expression import Expression

    surface = scene.surface
    if scene.body is not None and scene.body.moves:
        yield "is for a flow but the grain moves", "hold the grain"
    if scene.effects.unsteadiness is False:
        yield "is for a flow in time but effects.unsteadiness is false", "leave that out"
    if scene.flow.kind == "still":
        yield "is relative to the velocity of a stream but the fluid is still", "use another flow.kind"
    if scene.flow.kind == "expression" and scene.flow.unsteady:
        yield "is for a steady flow but flow.components depend on t", "leave t out"
    if surface is not None and surface.wave is not None:
        yield "is for a steady flow but surface.wave lets waves in", "leave that out"
    for key in ("inflow", "pressure", "seepage") if surface is not None else ():
        if "t" in Expression(getattr(surface, key)).variables:
            yield f"is for a steady flow but surface.{key} depends on t", "leave t out"


def _motion(scene: SceneSections) -> Iterator[Problem]:
    if scene.body is None or not scene.body.moves:
        return
    if scene.time is None:
        yield Problem(("body", "motion"), "a grain moves in time", "add a section [time]")


def _ignored(scene: SceneSections) -> Iterator[Problem]:
    """Keys of [numerics] with another value than the default that the scene has no use for."""
    numerics = scene.numerics
    unused = []
    if scene.body is None or not scene.body.moves:
        keys = ("coupling", "remesh_below", *(() if scene.has_surface else ("interface_tolerance",)))
        unused += [(key, "is read only for a grain that moves", "set body.motion") for key in keys]
    if scene.time is None:
        unused.append(("form", "is read only for flow in time", "add a section [time]"))
    for key, why, remedy in unused:
        if getattr(numerics, key) != type(numerics).model_fields[key].default:
            yield Problem(("numerics", key), why, f"leave it out or {remedy}")


def _accuracy(scene: SceneSections) -> Iterator[Problem]:
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
    if numerics.accuracy_of == OF_WALLS and (body is not None or not scene.is_turbulent):
        why = f'"{OF_WALLS}" is that of a turbulent channel without a grain'
        yield Problem(("numerics", "accuracy_of"), why, 'use "auto"')
        return
    if body is None and scene.is_turbulent:  # see `turbulence`
        return
    if body is None and not scene.has_surface:
        why = "is that of the load on a grain or of a free surface but there is neither"
        yield Problem(key, why, "add a section [body], or leave it out and choose numerics.mesh_size")
        return
    if numerics.accuracy_of in OF_SURFACE and not scene.has_surface:
        why = f'"{numerics.accuracy_of}" is that of a free surface but there is none'
        of = ("numerics", "accuracy_of")
        yield Problem(of, why, 'use "force", or domain.top = "free-surface"')
        return
    if body is None:
        if verdict or scene.accuracy_of not in OF_SURFACE:
            what = '"verdict"' if verdict else f'"{numerics.accuracy_of}"'
            why, remedy = f"{what} is that of a grain but there is none", "add a section [body]"
            where, other = (
                (key, "give a number") if verdict else (("numerics", "accuracy_of"), 'use "elevation"')
            )
            yield Problem(where, why, f"{remedy} or {other}")
        return
    if scene.flow.kind == "still" and not body.moves and not scene.has_surface:
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


def _resolution(scene: SceneSections) -> Iterator[Problem]:
    """Coordinates so large that numbers next to each other are too far apart to place a grain, or cells."""
    domain, grain = scene.domain, scene.grain
    finest = FINEST_PLACE if grain is None or scene.contact is None else scene.contact.tolerance
    for axis, extent in enumerate(domain.extents):
        apart = math.ulp(abs(domain.origin[axis]) + extent)
        needed = finest * min(extent, extent if grain is None else grain.size)
        if 4.0 * apart > needed:
            why = (
                f"is so large that numbers there are {apart:.2g} apart, but places are needed to {needed:.2g}"
            )
            names = ("length", "height") if scene.gdim == 2 else ("length", "width", "height")
            key = "origin" if abs(domain.origin[axis]) > extent else names[axis]
            yield Problem(("domain", key), why, "move the scene towards zero, or make it smaller")


def _forms(scene: SceneSections) -> Iterator[Problem]:
    """More bed forms than can be meshed, which it would take too long to look at; in space those below the grain."""
    if scene.bed is None:
        return
    domain, grain = scene.domain, scene.grain
    forms, where = scene.bed.forms(domain.length), "on the domain's length"
    if scene.gdim == 3:
        area = domain.extents[0] * domain.extents[1]
        area, where = (
            (area, "in the domain") if grain is None else (min(grain.size**2, area), "under the grain")
        )
        forms = area / (2.0 * scene.bed_shape.feature) ** 2
    if forms * CELLS_OF_A_FORM > scene.numerics.max_cells:
        why = (
            f"has about {forms:.2g} forms {where}, with at least {CELLS_OF_A_FORM} cells each more than "
            f"numerics.max_cells = {scene.numerics.max_cells}"
        )
        remedy = (
            "enlarge them, give a flat bed in their place, or allow more with --set numerics.max_cells=NUMBER"
        )
        yield Problem(("bed",), why, remedy)


def _bed_extent(scene: SceneSections) -> Iterator[Problem]:
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
    yield from _beyond_height_map(scene)
    _, highest = _bed_heights(scene)
    if highest >= domain.ceiling:
        why = f"rises to {'xyz'[scene.up]} = {highest:g}, the top is at {domain.ceiling:g}"
        yield Problem(("bed",), why, "enlarge domain.height or lower the bed")


def _beyond_height_map(scene: SceneSections) -> Iterator[Problem]:
    """A height map that does not reach as far as the domain."""
    bed, domain = scene.bed_shape, scene.domain
    if scene.gdim == 2 or bed is None:
        return
    for axis, reach, side in zip("xy", bed.extent, ((domain.left, domain.right), domain.across), strict=True):
        slack = 1e-9 * (side[1] - side[0])
        if side[0] < reach[0] - slack or side[1] > reach[1] + slack:
            why = f"reaches from {axis} = {reach[0]:g} to {reach[1]:g}, the domain from {side[0]:g} to {side[1]:g}"
            yield Problem(("bed",), why, "enlarge its cell, change its offset or shrink the domain")


def _datum_of_the_bed(scene: SceneSections) -> Iterator[Problem]:
    """A datum given as a number must be a height that the bed has: above it a layer of fluid would be at rest."""
    level, base = getattr(scene.flow, "datum", "auto"), scene.domain.bottom
    if level == "effective" and scene.gdim == 3:
        yield Problem(
            ("flow", "datum"), 'is "effective" in space, where it is not computed', 'use "auto" or a height'
        )
    if isinstance(level, str) or scene.bed is None:
        return
    lowest, highest = (height - base for height in _bed_heights(scene))
    slack = 1e-9 * scene.domain.height
    if not lowest - slack <= level <= highest + slack:
        why = f"is {level:g}, the bed's heights above its base line go from {lowest:g} to {highest:g}"
        yield Problem(("flow", "datum"), why, 'give one of them, or "auto", "crest" or "mean"')


def _body_place(scene: SceneSections) -> Iterator[Problem]:
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
    for why in _not_across(scene):
        yield Problem(("body", "length"), why, "give domain.width, and the middle in centre")
    for why in outside:
        yield Problem(key, why, "move the grain, make it smaller or enlarge the domain")
    remedy = "raise the grain, or give x to let it rest on the bed"
    if scene.body.x is not None:  # lowered onto a bed whose shape is finer than what tells how low it may get
        remedy = (
            "enlarge the bed's forms or make them flatter: beside the grain they are too steep to lower it"
        )
    for why in into_bed:
        yield Problem(key, why, remedy)


def _far_out(scene: SceneSections) -> Iterator[str]:
    """Grains that need not be placed to see that they do not fit."""
    domain, body, grain = scene.domain, scene.body, scene.grain
    if body is None or grain is None:
        return
    if grain.size >= math.hypot(*domain.extents):
        yield f"the grain measures {grain.size:g}, more than the domain"
    x = body.x if body.centre is None else body.centre[0]
    if x is not None and not domain.left < x < domain.right:
        yield f"x = {x:g} is outside the domain, {domain.left:g} to {domain.right:g}"
    if scene.gdim == 3:
        y, (near, far) = body.aside if body.centre is None else body.centre[1], domain.across
        if y is not None and not near < y < far:
            yield f"y = {y:g} is outside the domain, {near:g} to {far:g}"


def _beyond(scene: SceneSections) -> Iterator[str]:
    """How the grain leaves the domain, or touches one of its sides, if only nearly."""
    domain, grain, outline = scene.domain, scene.grain, _outline(scene)
    assert grain is not None
    low, high = outline.min(axis=0), outline.max(axis=0)
    up = scene.up
    sides = [
        ("x", low[0], low[0] - domain.left, "left side", domain.left),
        ("x", high[0], domain.right - high[0], "right side", domain.right),
    ]
    if scene.gdim == 3 and scene.body is not None and scene.body.shape != "cylinder":
        near, far = domain.across
        sides += [
            ("y", low[1], low[1] - near, "side at least y", near),
            ("y", high[1], far - high[1], "side at largest y", far),
        ]
    sides.append(("xyz"[up], high[up], domain.ceiling - high[up], "top", domain.ceiling))
    if scene.bed is None:
        sides.append(("xyz"[up], low[up], low[up] - domain.bottom, "lower side", domain.bottom))
    for axis, reach, distance, side, place in sides:
        if distance <= 0.0:
            yield f"the grain reaches {axis} = {reach:g}, the domain's {side} is at {place:g}"
        elif distance < NEARLY_TOUCHING * grain.size:
            yield f"the grain nearly touches the domain's {side}, from which it is {distance:.3g}"


def _not_across(scene: SceneSections) -> Iterator[str]:
    """How a cylinder does not reach from side to side."""
    body, domain = scene.body, scene.domain
    if body is None or body.shape != "cylinder" or body.centre is None:
        return
    low, high = (body.centre[1] + end * body.length for end in (-0.5, 0.5))
    near, far = domain.across
    if max(abs(low - near), abs(high - far)) > _SAME * (far - near):
        yield f"the cylinder reaches from y = {low:g} to {high:g}, the domain from {near:g} to {far:g}"


def _into_bed(scene: SceneSections) -> Iterator[str]:
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


def _outline(scene: SceneSections) -> np.ndarray:
    """Points (n, gdim) on the grain's surface, in the scene, among them the outermost."""
    grain, placement = scene.grain, scene.placement
    if grain is None or placement is None:
        return np.empty((0, scene.gdim))
    if scene.gdim == 2:
        return placement.to_scene(grain.chain.points(65))
    if not grain.cores:
        return placement.to_scene(grain.surface(_SPACING * grain.size).points)
    axes = np.vstack([np.eye(3), -np.eye(3)])
    balls = [(placement.to_scene(core.points), core.radius) for core in grain.cores]
    return np.concatenate([(points[:, None] + radius * axes).reshape(-1, 3) for points, radius in balls])


def _bed_points(scene: SceneSections) -> np.ndarray:
    """Points (n, gdim) on the bed within the domain, in the plane its corners among them."""
    bed, domain = scene.bed_shape, scene.domain
    if bed is None:
        return np.empty((0, scene.gdim))
    if scene.gdim == 3:
        across = np.linspace(domain.left, domain.right, _PLACES), np.linspace(*domain.across, _PLACES)
        places = np.stack(np.meshgrid(*across), axis=-1).reshape(-1, 2)
        return np.column_stack([places, bed.height(places)])
    x = np.linspace(domain.left, domain.right, 2001)
    x = np.concatenate([x, bed.corners(domain.left, domain.right)])
    return np.column_stack([x, bed.height(x)])


def _bed_heights(scene: SceneSections) -> tuple[float, float]:
    """The lowest and the highest place of the bed, the crest of one that repeats also where the domain has none."""
    bed, domain, heights = scene.bed_shape, scene.domain, _bed_points(scene)[:, -1]
    assert bed is not None
    within = ((domain.left, domain.right), domain.across) if scene.gdim == 3 else (domain.left, domain.right)
    return float(heights.min()), max(float(heights.max()), bed.crest_level(*within))

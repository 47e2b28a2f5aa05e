"""Contradictions between the sections of a scene, each with the remedy."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

from . import contact_checks, effects_checks, gust_checks, surface_checks, turbulence_checks
from .domain import Domain
from .effects import Effects
from .expression import Expression
from .flows import ExpressionFlow, Flow, LogLaw
from .messages import Problem, either, problem
from .model import Output, SceneSections
from .numerics import OF_SURFACE, OF_WALLS, Numerics
from .surface import Surface

_IN_SPACE = {"body": '"sphere"', "bed": '"spheres"'}
_CHANNEL_FLOWS = ("shear", "poiseuille", "uniform", "open-channel", "log-law")
_ROUGHEST = (
    500.0  # u* k_s/nu up to which the mean profile follows the measured one (docs/numerics.md)
)
_TOPS_OF_FLOWS = {
    "poiseuille": ("auto", "wall"),
    "open-channel": ("auto", "slip", "stream", "free-surface"),
    "log-law": ("auto", "slip", "stream"),
    "lid": ("auto", "wall"),
}


def contradictions(scene: SceneSections) -> Iterator[Problem]:
    """All contradictions between sections but for those of places and extents."""
    body, bed, flow, domain, numerics = (
        scene.body,
        scene.bed,
        scene.flow,
        scene.domain,
        scene.numerics,
    )
    time, moves = scene.time, scene.moves
    without_scale = scene.fluid.scale == "grain" and body is None
    yield from _dimensions(body, bed, flow, domain.gdim)
    yield from _flow(flow, domain)
    if isinstance(flow, LogLaw) and domain.kind == "channel" and not without_scale:
        yield from _roughness(flow, scene.viscosity)
    if without_scale:
        yield problem(
            "fluid.scale", '"grain" but there is no grain', 'add a section [body] or use "flow"'
        )
    if bed is None:
        yield from _bed_needed(flow, body, scene.contact is not None and not moves)
    if scene.contact is not None and body is None:
        remedy = "add a section [body] or leave [contact] out"
        yield problem("contact", "there is no grain to touch anything", remedy)
    if bed is not None and bed.slope_angle and scene.gravity is None:
        remedy = 'add a section [gravity] or use kind = "flat"'
        yield problem("bed.slope", "a slope turns gravity but there is no gravity", remedy)
    unsteady = isinstance(flow, ExpressionFlow) and flow.unsteady
    if time is None:
        yield from _of_steady_flow(unsteady, numerics, scene.output)
    elif time.until_steady is not None:
        yield from _never_steady(moves, scene.effects, flow, unsteady, scene.surface or Surface())
    if moves and time is None:
        yield problem("body.motion", "a grain moves in time", "add a section [time]")
    yield from _ignored(numerics, moves, scene.has_surface)
    yield from _budgets(numerics) if numerics.accuracy is None else _accuracy(scene)
    yield from effects_checks.contradictory(scene)
    yield from contact_checks.contradictory(body, scene.contact, time, bed)
    yield from contact_checks.excluded(body, scene.effects.contact)
    yield from surface_checks.contradictory(scene)
    yield from turbulence_checks.contradictory(scene)
    yield from gust_checks.contradictory(flow, time, scene.has_surface, scene.sides)
    if bed is not None and bed.kind == "polyline" and body is not None:
        yield from _steps(bed.points)


def _steps(points: Any) -> Iterator[Problem]:
    """Contact is found on beds that are graphs."""
    steps = [left for (left, _), (right, _) in pairwise(points) if left == right]
    if steps:
        why = f"has a vertical step at x = {steps[0]:g}, and grains over steps are not simulated by this version"
        yield problem("bed.points", why, "give the step a width, or leave the grain out")


def _dimensions(body: Any, bed: Any, flow: Flow, gdim: int) -> Iterator[Problem]:
    """Grain, bed and flow must be of the scene's dimension, which the domain's width decides."""
    if body is not None and body.gdim != gdim:
        yield _other_dimension("body", "shape", body.shape, gdim)
    if bed is not None and gdim not in bed.gdims:
        yield _other_dimension("bed", "kind", bed.kind, gdim)
    if flow.kind == "expression" and len(flow.components) != gdim:
        remedy = "give two, as in [x, y]" if gdim == 2 else "give three, as in [x, y, z]"
        yield problem("flow.components", f"has {len(flow.components)} items", remedy)


def _other_dimension(section: str, key: str, value: str, gdim: int) -> Problem:
    if gdim == 2:
        why = f'domain.width is missing, which the "{value}" in space needs'
        remedy = f"add domain.width, or use a {section} of the plane"
    else:
        why = f'"{value}" lies in the plane, but domain.width makes the scene three-dimensional'
        remedy = f"use a {section} in space such as {_IN_SPACE[section]}, or leave width out"
    return problem(f"{section}.{key}", why, remedy)


def _flow(flow: Flow, domain: Domain) -> Iterator[Problem]:
    kind, boxed, allowed = flow.kind, domain.kind == "box", _TOPS_OF_FLOWS.get(flow.kind)
    if kind == "lid" and not boxed:
        why = "a lid closes a box but the domain is a channel"
        yield problem("flow.kind", why, 'set domain.kind = "box"')
    elif kind in _CHANNEL_FLOWS and boxed:
        why = f'"{kind}" flows through but a box is closed'
        yield problem("flow.kind", why, 'set domain.kind = "channel", or use "lid" or "still"')
    elif boxed and domain.top == "stream" and kind != "expression":
        yield problem(
            "domain.top", "no flow passes the top of a closed box", 'use "wall", "slip" or "auto"'
        )
    elif allowed is not None and domain.top not in allowed:
        yield problem(
            "domain.top", f'"{domain.top}" contradicts the flow "{kind}"', f"use {either(allowed)}"
        )


def _roughness(flow: LogLaw, viscosity: float) -> Iterator[Problem]:
    rough = flow.shear_velocity * flow.roughness / viscosity
    if rough > _ROUGHEST:
        why = (
            f"is {rough:.3g} times nu/u*; the mean profile is known up to {_ROUGHEST:g} times that"
        )
        yield problem("flow.roughness", why, "reduce it, or fluid.reynolds")


def _bed_needed(flow: Flow, body: Any, rubs: bool) -> Iterator[Problem]:
    """What only a bed has a use for; `rubs`: whether there is a contact of a grain that is held."""
    if getattr(flow, "datum", "auto") not in ("auto", "crest"):
        why = "is a height of the bed but there is none"
        yield problem("flow.datum", why, "add a section [bed] or leave it out")
    if rubs:
        why = "friction needs a bed to rub against but there is none"
        yield problem("contact.friction", why, "add a section [bed] or leave [contact] out")
    if body is not None and body.x is not None:
        why = "the grain is to rest on a bed but there is none"
        yield problem("body.x", why, "add a section [bed], or give centre instead")


def _of_steady_flow(unsteady: bool, numerics: Numerics, output: Output) -> Iterator[Problem]:
    """Keys that need [time]."""
    asked = {
        "flow.components": (unsteady, "depend on t", "leave t out"),
        "numerics.convection": (
            numerics.convection == "extrapolated",
            '"extrapolated" needs earlier steps',
            'use "implicit"',
        ),
        "output.every": (output.every > 0, "counts time steps", "leave it out"),
        "output.checkpoint": (output.checkpoint > 0, "counts time steps", "leave it out"),
    }
    for key, (given, why, remedy) in asked.items():
        if given:
            why = f"{why} but without [time] the flow is steady"
            yield problem(key, why, f"add a section [time] or {remedy}")


def _never_steady(
    moves: bool, effects: Effects, flow: Flow, unsteady: bool, surface: Surface
) -> Iterator[Problem]:
    """Why the flow of a scene in time cannot become steady, each with a remedy."""
    reasons = (
        (moves, "a flow but the grain moves", "hold the grain"),
        (
            effects.unsteadiness is False,
            "a flow in time but effects.unsteadiness is false",
            "leave that out",
        ),
        (flow.kind == "still", "a flow but the fluid is still", "use another flow.kind"),
        (unsteady, "a steady flow but flow.components depend on t", "leave t out"),
        (
            getattr(flow, "gust", None) is not None,
            "a steady flow but flow.gust changes it",
            "leave that out",
        ),
        (
            surface.wave is not None,
            "a steady flow but surface.wave lets waves in",
            "leave that out",
        ),
        *(
            (
                "t" in Expression(getattr(surface, key)).variables,
                f"a steady flow but surface.{key} depends on t",
                "leave t out",
            )
            for key in ("pressure",)
        ),
    )
    for given, why, remedy in reasons:
        if given:
            yield problem("time.until_steady", f"is for {why}", f"leave it out or {remedy}")


def _ignored(numerics: Numerics, moves: bool, has_surface: bool) -> Iterator[Problem]:
    """Keys of [numerics] with another value than the default that the scene has no use for."""
    keys = ("remesh_below", *(() if has_surface else ("interface_tolerance",)))
    for key in keys if not moves else ():
        if getattr(numerics, key) != type(numerics).model_fields[key].default:
            why = "is read only for a grain that moves"
            yield problem(f"numerics.{key}", why, "leave it out or set body.motion")


def _budgets(numerics: Numerics) -> Iterator[Problem]:
    """What only an accuracy has a use for."""
    remedy = "add numerics.accuracy or leave it out"
    for budget in ("budget_seconds", "budget_mib"):
        if getattr(numerics, budget) is not None:
            yield problem(
                f"numerics.{budget}",
                "limits what is spent on an accuracy but none is asked for",
                remedy,
            )
    if numerics.accuracy_includes != "discretisation":
        why = "says what an accuracy includes but none is asked for"
        yield problem("numerics.accuracy_includes", why, remedy)


def _accuracy(scene: SceneSections) -> Iterator[Problem]:
    """An accuracy is that of a load on a grain; that of a verdict needs all that a verdict needs."""
    numerics, body, turbulent = scene.numerics, scene.body, scene.is_averaged
    of, verdict = numerics.accuracy_of, numerics.accuracy == "verdict"
    accuracy, quantity = "numerics.accuracy", "numerics.accuracy_of"
    if of == OF_WALLS and (body is not None or not turbulent):
        yield problem(quantity, f'"{of}" is for a turbulent channel without a grain', 'use "auto"')
    elif body is None and turbulent:  # see `turbulence_checks`
        return
    elif body is None and not scene.has_surface:
        why = "needs a grain or a free surface but there is neither"
        yield problem(
            accuracy, why, "add a section [body], or leave it out and choose numerics.mesh_size"
        )
    elif of in OF_SURFACE and not scene.has_surface:
        why = f'"{of}" needs a free surface but there is none'
        yield problem(quantity, why, 'use "force", or domain.top = "free-surface"')
    elif body is None and verdict:
        why = '"verdict" needs a grain but there is none'
        yield problem(accuracy, why, "add a section [body] or give a number")
    elif body is None and scene.accuracy_of not in OF_SURFACE:
        why = f'"{of}" needs a grain but there is none'
        yield problem(quantity, why, 'add a section [body] or use "elevation"')
    elif body is None:
        return
    elif scene.flow.kind == "still" and not body.moves and not scene.has_surface:
        yield problem(accuracy, "is relative but a fluid at rest exerts no force", "leave it out")
    elif (verdict or of == "safety factor") and None in (
        body.x,
        scene.bed,
        scene.contact,
        scene.mass,
    ):
        what = "a verdict" if verdict else "a safety factor"
        why = f"{what} needs a grain that rests on a bed, its density and friction"
        remedy = "give body.x, body.density, [bed] and [contact], or a number for the accuracy of the force"
        yield problem(accuracy if verdict else quantity, why, remedy)
    elif verdict and scene.time is not None:
        yield problem(
            accuracy, '"verdict" is for steady flow', "give a number, or leave [time] out"
        )

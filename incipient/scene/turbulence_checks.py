"""What contradicts the turbulence that a scene asks for."""

from collections.abc import Iterator

from .domain import Domain
from .flows import Flow
from .messages import Problem, either, problem
from .model import SceneSections, Time
from .numerics import OF_WALLS, Numerics
from .surface import FREE

FLOWS = ("poiseuille", "open-channel")
_NOT_SIMULATED = "with turbulence is not simulated by this version"
_STEADY_IN_SPACE = "with turbulence in 3-D is retired: a model of the mean flow has no fluctuations"
_BY_OTHERS = (
    "leave it out for the steady loads on a held grain, or judge forces of a large-eddy simulation: "
    "incipient judge --forces"
)


def contradictory(scene: SceneSections) -> Iterator[Problem]:
    """What keeps a scene from having the turbulence that it asks for."""
    if not scene.is_averaged:
        if scene.turbulence is not None:
            why = "describes turbulence, which effects.turbulence does not ask for"
            yield problem(
                "turbulence", why, "set effects.turbulence = true or leave the section out"
            )
        return
    effects, numerics, time = scene.effects, scene.numerics, scene.time
    if scene.resolves_walls:
        kind = "flat" if scene.bed is None else scene.bed.kind
        level = scene.body is None and kind == "flat"
        if level and scene.turbulence is not None and scene.turbulence.upstream_roughness:
            why = "is read only past grains and bed forms: over level smooth ground what enters would not stay as it is"
            yield problem("turbulence.upstream_roughness", why, "leave it out")
    yield from _of_flow(
        scene.flow, scene.domain, scene.bed is not None and scene.bed.kind != "flat"
    )
    if not scene.fluid.inertia or effects.inertia is False:
        key = "fluid.inertia" if not scene.fluid.inertia else "effects.inertia"
        yield problem(key, "is false, but without inertia there is no turbulence", "leave it out")
    if time is not None:
        if scene.domain.width is not None:
            yield problem("time", _STEADY_IN_SPACE, _BY_OTHERS)
        yield from _of_time(time, numerics)
        if effects.unsteadiness is False:
            why = "is false but turbulence in time is unsteady"
            yield problem("effects.unsteadiness", why, "leave [time] out")
    if numerics.accuracy is not None:
        yield from _of_accuracy(numerics, time is not None, scene.body is not None)


def _of_flow(flow: Flow, domain: Domain, over_forms: bool) -> Iterator[Problem]:
    if domain.width is not None and domain.sides not in (None, "slip"):
        yield problem(
            "domain.sides",
            f'"{domain.sides}" with turbulence is retired: no secondary flow is modelled in corners'
            if domain.sides == "wall"
            else f'"{domain.sides}" {_NOT_SIMULATED}',
            'use "slip", sides without friction',
        )
    if getattr(flow, "gust", None) is not None:
        yield problem("flow.gust", _NOT_SIMULATED, "leave it out")
    if domain.top == FREE:
        yield problem(
            "domain.top", f'"{FREE}" {_NOT_SIMULATED}', 'use "auto", a lid without friction'
        )
    if flow.kind not in FLOWS:
        remedy = (
            f"use {either(FLOWS)}, or judge forces of another program (incipient judge --forces)"
        )
        yield problem("flow.kind", f'"{flow.kind}" {_NOT_SIMULATED}', remedy)
    elif domain.top == "stream":
        yield problem("domain.top", '"stream" contradicts turbulence below it', 'use "auto"')
    elif getattr(flow, "datum", "auto") != "auto" and not (over_forms and domain.width is not None):
        why = "is not read with turbulence, whose profile starts at the bed's height at the inflow"
        yield problem("flow.datum", why, "leave it out")


def _of_time(time: Time, numerics: Numerics) -> Iterator[Problem]:
    if time.start == "stokes":
        why = '"stokes" leaves out inertia, without which there is no turbulence'
        yield problem("time.start", why, 'use "steady" or "rest"')
    if numerics.convection == "extrapolated":
        why = "with turbulence the walls' friction is implicit, and so is convection"
        yield problem("numerics.convection", why, 'use "implicit"')


def _of_accuracy(numerics: Numerics, in_time: bool, has_grain: bool) -> Iterator[Problem]:
    """What an accuracy cannot be that of, or include, with turbulence."""
    if in_time:
        why = "is not sought of turbulence in time by this version"
        yield problem(
            "numerics.accuracy", why, "leave it out, and see the error bars, or leave [time] out"
        )
    if has_grain:
        return
    if numerics.accuracy == "verdict":
        yield problem(
            "numerics.accuracy", '"verdict" needs a grain but there is none', "give a number"
        )
    if numerics.accuracy_of not in ("auto", OF_WALLS):
        why = f'"{numerics.accuracy_of}" does not exist in a turbulent channel without a grain'
        yield problem("numerics.accuracy_of", why, f'use "{OF_WALLS}"')
    if numerics.accuracy_includes == "all":
        why = '"all" means gap and domain but without a grain both belong to the scene'
        yield problem("numerics.accuracy_includes", why, "leave it out")

"""What contradicts the turbulence that a scene asks for."""

from __future__ import annotations

from collections.abc import Iterator

from .messages import Key, Problem
from .model import SceneSections
from .numerics import OF_WALLS

FLOWS = ("poiseuille", "open-channel")


def contradictory(scene: SceneSections) -> Iterator[Problem]:
    """What keeps a scene from having the turbulence that it asks for."""
    if not scene.is_turbulent:
        if scene.turbulence is not None:
            remedy = "set effects.turbulence = true or leave the section out"
            yield Problem(
                ("turbulence",), "describes turbulence, which effects.turbulence does not ask for", remedy
            )
        return
    for key, why, remedy in (*_of_place(scene), *_of_flow(scene), *_of_time(scene), *_of_accuracy(scene)):
        yield Problem(key, why, remedy)


def _of_place(scene: SceneSections) -> Iterator[tuple[Key, str, str]]:
    if scene.gdim == 3 and scene.sides == "stream":
        why = '"stream" with turbulence is not simulated by this version'
        yield ("domain", "sides"), why, 'use "wall", or "slip", sides without friction'
    if scene.has_surface:
        why = '"free-surface" with turbulence is not simulated by this version'
        yield ("domain", "top"), why, 'use "auto", a lid without friction'


def _of_flow(scene: SceneSections) -> Iterator[tuple[Key, str, str]]:
    if scene.flow.kind not in FLOWS:
        why = f'"{scene.flow.kind}" with turbulence is not simulated by this version'
        yield ("flow", "kind"), why, 'use "poiseuille" or "open-channel"'
    elif scene.domain.top == "stream":
        yield ("domain", "top"), '"stream" contradicts turbulence below it', 'use "auto"'
    elif getattr(scene.flow, "datum", "auto") != "auto":
        why = "is not there with turbulence, whose profile starts at the bed's height at the inflow"
        yield ("flow", "datum"), why, "leave it out"
    if not scene.fluid.inertia or scene.effects.inertia is False:
        key = ("fluid", "inertia") if not scene.fluid.inertia else ("effects", "inertia")
        yield key, "is false, but without inertia there is no turbulence", "leave it out"


def _of_time(scene: SceneSections) -> Iterator[tuple[Key, str, str]]:
    if scene.time is None:
        return
    if scene.time.start == "stokes":
        why = '"stokes" leaves out inertia, without which there is no turbulence'
        yield ("time", "start"), why, 'use "steady" or "rest"'
    if scene.effects.unsteadiness is False:
        yield ("effects", "unsteadiness"), "is false but turbulence in time is unsteady", "leave [time] out"
    if scene.numerics.convection == "extrapolated":
        why = "with turbulence the walls' friction is implicit, and so is convection"
        yield ("numerics", "convection"), why, 'use "implicit"'
    if scene.numerics.form == "energy-stable":
        yield ("numerics", "form"), "is not there with turbulence by this version", 'use "printed"'


def _of_accuracy(scene: SceneSections) -> Iterator[tuple[Key, str, str]]:
    """What an accuracy cannot be that of, or include, with turbulence."""
    numerics = scene.numerics
    if numerics.accuracy is None:
        return
    if scene.time is not None:
        why = "is not sought of turbulence in time by this version"
        yield ("numerics", "accuracy"), why, "leave it out, and see the error bars, or leave [time] out"
    if scene.body is not None:
        return
    if numerics.accuracy == "verdict":
        yield ("numerics", "accuracy"), '"verdict" is that of a grain but there is none', "give a number"
    if numerics.accuracy_of not in ("auto", OF_WALLS):
        why = f'"{numerics.accuracy_of}" is not there in a turbulent channel without a grain'
        yield ("numerics", "accuracy_of"), why, f'use "{OF_WALLS}"'
    if numerics.accuracy_includes == "all":
        why = '"all" means gap and domain but without a grain both belong to the scene'
        yield ("numerics", "accuracy_includes"), why, "leave it out"

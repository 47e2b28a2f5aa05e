"""Effects that a scene forces on or off and that contradict the rest of it."""

from __future__ import annotations

from collections.abc import Iterator

from .messages import Problem
from .model import SceneSections


def contradictory(scene: SceneSections) -> Iterator[Problem]:
    """Effects forced on that the scene says nothing about, and forced off that it cannot do without."""
    checks = (_of_dimension, _of_flow, _of_time, _of_grain)
    for name, why, remedy in (found for check in checks for found in check(scene)):
        yield Problem(("effects", name), why, remedy)


def _of_dimension(scene: SceneSections) -> Iterator[tuple[str, str, str]]:
    asked, in_space = scene.effects.third_dimension, scene.gdim == 3
    if asked is True and not in_space:
        yield "third_dimension", "is true but the scene lies in the plane", "add domain.width"
    if asked is False and in_space:
        yield "third_dimension", "is false but domain.width is given", "leave one of them out"


def _of_flow(scene: SceneSections) -> Iterator[tuple[str, str, str]]:
    effects = scene.effects
    if effects.inertia is True and not scene.fluid.inertia:
        yield "inertia", "is true but fluid.inertia = false", "leave one of them out"
    if effects.gravity is True and scene.gravity is None:
        yield "gravity", "is true but there is no gravity", "add a section [gravity]"


def _of_time(scene: SceneSections) -> Iterator[tuple[str, str, str]]:
    name, time = "unsteadiness", scene.time
    if scene.effects.unsteadiness is True and time is None:
        yield name, "is true but without [time] the flow is steady", "add a section [time]"
    if scene.effects.unsteadiness is not False or time is None:
        return
    if scene.body is not None and scene.body.moves:
        yield name, "is false but a grain moves in time", 'use "auto", or body.motion = "fixed"'
    if time.tolerance is not None:
        yield name, "is false but steps adapt to the rate of change", "leave time.tolerance out"
    if scene.numerics.convection == "extrapolated":
        yield name, "is false but convection needs earlier steps", 'use numerics.convection = "implicit"'


def _of_grain(scene: SceneSections) -> Iterator[tuple[str, str, str]]:
    effects, body = scene.effects, scene.body
    motion = "fixed" if body is None else body.motion
    moves = motion != "fixed"
    told = f'body.motion = "{motion}"' if body is not None else "there is no grain"
    if effects.contact is True and (scene.bed is None or body is None or body.x is None):
        yield "contact", "is true but no grain rests on a bed", "add [bed], and [body] with x"
    if effects.moving_mesh != "auto" and effects.moving_mesh != (moves or scene.has_surface):
        remedy = 'set body.motion = "fixed"' if moves else 'set body.motion = "free" or "prescribed"'
        if scene.has_surface and not moves:
            told, remedy = "the surface is free", 'use "auto"'
        yield "moving_mesh", f"is {str(effects.moving_mesh).lower()} but {told}", remedy
    if effects.free_body != "auto" and effects.free_body != (motion == "free"):
        remedy = 'set body.motion = "free"' if effects.free_body else 'set body.motion = "fixed"'
        yield "free_body", f"is {str(effects.free_body).lower()} but {told}", remedy

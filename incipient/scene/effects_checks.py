"""Effects that a scene forces on or off and that contradict the rest of it."""

from collections.abc import Iterator
from typing import Any

from .effects import Effects
from .messages import Problem, problem
from .model import SceneSections, Time


def contradictory(scene: SceneSections) -> Iterator[Problem]:
    """Effects forced on that the scene says nothing about, and forced off that it cannot do without."""
    effects, body = scene.effects, scene.body
    yield from _of_dimension(effects.third_dimension, scene.gdim == 3)
    if effects.inertia is True and not scene.fluid.inertia:
        yield problem(
            "effects.inertia", "is true but fluid.inertia = false", "leave one of them out"
        )
    if effects.gravity is True and scene.gravity is None:
        yield problem(
            "effects.gravity", "is true but there is no gravity", "add a section [gravity]"
        )
    if effects.unsteadiness is True and scene.time is None:
        why = "is true but without [time] the flow is steady"
        yield problem("effects.unsteadiness", why, "add a section [time]")
    if effects.unsteadiness is False and scene.time is not None:
        moves, extrapolated = scene.moves, scene.numerics.convection == "extrapolated"
        yield from _quasi_steady(moves, scene.time, extrapolated)
    if effects.contact is True and (scene.bed is None or body is None or body.x is None):
        yield problem(
            "effects.contact", "is true but no grain rests on a bed", "add [bed], and [body] with x"
        )
    yield from _of_motion(effects, body, scene.has_surface)


def _of_dimension(asked: Any, in_space: bool) -> Iterator[Problem]:
    key = "effects.third_dimension"
    if asked is True and not in_space:
        yield problem(key, "is true but the scene lies in the plane", "add domain.width")
    if asked is False and in_space:
        yield problem(key, "is false but domain.width is given", "leave one of them out")


def _quasi_steady(moves: bool, time: Time, extrapolated: bool) -> Iterator[Problem]:
    """What keeps a flow in time from being quasi-steady."""
    reasons = (
        (moves, "a grain moves in time", 'use "auto", or body.motion = "fixed"'),
        (
            time.tolerance is not None,
            "steps adapt to the rate of change",
            "leave time.tolerance out",
        ),
        (extrapolated, "convection needs earlier steps", 'use numerics.convection = "implicit"'),
    )
    for given, why, remedy in reasons:
        if given:
            yield problem("effects.unsteadiness", f"is false but {why}", remedy)


def _of_motion(effects: Effects, body: Any, has_surface: bool) -> Iterator[Problem]:
    motion = "fixed" if body is None else body.motion
    moves, fact = (
        motion != "fixed",
        f'body.motion = "{motion}"' if body is not None else "there is no grain",
    )
    asked = effects.free_body
    if asked != "auto" and asked != (body is not None and body.is_free):
        remedy = f'set body.motion = "{"free" if asked else "fixed"}"'
        yield problem("effects.free_body", f"is {str(asked).lower()} but {fact}", remedy)
    asked = effects.moving_mesh
    if asked != "auto" and asked != (moves or has_surface):
        remedy = (
            'set body.motion = "fixed"' if moves else 'set body.motion = "free" or "prescribed"'
        )
        if has_surface and not moves:
            fact, remedy = "the surface is free", 'use "auto"'
        yield problem("effects.moving_mesh", f"is {str(asked).lower()} but {fact}", remedy)

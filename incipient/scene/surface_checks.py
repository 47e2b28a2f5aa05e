"""What contradicts the free surface that a scene asks for."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..errors import SceneError
from .domain import Domain
from .expression import Expression
from .messages import Problem, counted, problem, split
from .model import SceneSections, Time
from .open_channel import of_box, of_channel
from .surface import FREE, Surface

_SAMPLES = 201  # along each side of the surface, where its first elevation is looked at
# What formulas of a scene in the plane must not depend on, and the remedy.
_NOT_IN_THE_PLANE = {
    "elevation": ("y", "use x only"),
}


def contradictory(scene: SceneSections) -> Iterator[Problem]:
    """What keeps a scene from having the free surface that it asks for."""
    effects, gravity = scene.effects, scene.gravity
    if not scene.has_surface:
        if scene.surface is not None:
            why = f'describes a free surface, but the top is "{scene.top}"'
            yield problem("surface", why, f'set domain.top = "{FREE}" or leave the section out')
        if effects.free_surface is True:
            yield problem(
                "effects.free_surface", "is true but there is none", f'set domain.top = "{FREE}"'
            )
        return
    if effects.free_surface is False:
        why = f'is false but domain.top = "{FREE}"'
        yield problem(
            "effects.free_surface", why, 'leave one of them out, as a lid is domain.top = "slip"'
        )
    surface, domain = scene.surface or Surface(), scene.domain
    yield from _of_time(scene.time, domain)
    if effects.unsteadiness is False:
        yield problem(
            "effects.unsteadiness", "is false but a free surface moves in time", 'use "auto"'
        )
    if gravity is None or effects.gravity is False or gravity.acceleration == 0.0:
        yield problem(
            "domain.top", "gravity is what keeps a free surface level", "add a section [gravity]"
        )
    if domain.kind == "channel":
        yield from of_channel(scene.flow, domain, surface, scene.time)
    elif scene.flow.kind != "still":
        why = "a free surface is simulated in a box whose fluid starts from rest"
        yield problem("flow.kind", why, 'use "still", or domain.kind = "channel"')
    else:
        yield from of_box(surface)
    yield from _of_bottom(surface, scene.bed is not None)
    yield from _of_dimension(surface, domain.gdim)


def _of_time(time: Time | None, domain: Domain) -> Iterator[Problem]:
    if time is None:
        yield problem("domain.top", "a free surface moves in time", "add a section [time]")
    elif time.start != "rest" and domain.kind == "box":
        why = "below a free surface the fluid of a box starts from rest"
        yield problem("time.start", why, 'use "rest"')


def _of_bottom(surface: Surface, has_bed: bool) -> Iterator[Problem]:
    if surface.bottom == "slip" and has_bed:
        yield problem("surface.bottom", "is for a domain without [bed]", "leave one of them out")


def _of_dimension(surface: Surface, gdim: int) -> Iterator[Problem]:
    if gdim == 3 and surface.points:
        why = "are those of a scene in the plane"
        yield problem("surface.points", why, "give the elevation as a formula")
    for key, (variable, remedy) in _NOT_IN_THE_PLANE.items() if gdim == 2 else ():
        if variable in Expression(getattr(surface, key)).variables:
            why = f"depends on {variable} but the scene lies in the plane"
            yield problem(f"surface.{key}", why, remedy)


def misplaced(surface: Surface, domain: Domain, bed: Any) -> Iterator[Problem]:
    """Stations outside of the domain, and a first elevation that is not above bed and grain."""
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
    axes = [np.linspace(*span, _SAMPLES) for span in domain.spans]
    across = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, len(axes))
    places = np.zeros((3, len(across)))
    places[: len(axes)] = across.T
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

"""What contradicts the free surface that a scene asks for."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..errors import SceneError
from .messages import Key, Problem, counted, split
from .model import SceneSections
from .open_channel import of_box, of_channel
from .surface import FREE, Surface

_SAMPLES = 201  # along each side of the surface, where its first elevation is looked at


def contradictory(scene: SceneSections) -> Iterator[Problem]:
    """What keeps a scene from having the free surface that it asks for."""
    asked = scene.effects.free_surface
    if not scene.has_surface:
        if scene.surface is not None:
            why = f'describes a free surface, but the top is "{scene.top}"'
            yield Problem(("surface",), why, f'set domain.top = "{FREE}" or leave the section out')
        if asked is True:
            yield Problem(
                ("effects", "free_surface"), "is true but there is none", f'set domain.top = "{FREE}"'
            )
        return
    if asked is False:
        why = f'is false but domain.top = "{FREE}"'
        yield Problem(
            ("effects", "free_surface"), why, 'leave one of them out, as a lid is domain.top = "slip"'
        )
    for key, why, remedy in (*_of_time(scene), *_of_forces(scene), *_of_sides(scene)):
        yield Problem(key, why, remedy)


def _of_time(scene: SceneSections) -> Iterator[tuple[Key, str, str]]:
    top = ("domain", "top")
    if scene.time is None:
        yield top, "a free surface moves in time", "add a section [time]"
    elif scene.time.start != "rest" and scene.domain.kind == "box":
        yield ("time", "start"), "below a free surface the fluid of a box starts from rest", 'use "rest"'
    if scene.effects.unsteadiness is False:
        yield ("effects", "unsteadiness"), "is false but a free surface moves in time", 'use "auto"'


def _of_forces(scene: SceneSections) -> Iterator[tuple[Key, str, str]]:
    if scene.gravity is None or scene.effects.gravity is False or scene.gravity.acceleration == 0.0:
        yield ("domain", "top"), "gravity is what keeps a free surface level", "add a section [gravity]"


def _of_sides(scene: SceneSections) -> Iterator[tuple[Key, str, str]]:
    surface, domain = scene.surface or Surface(), scene.domain
    if domain.kind == "channel":
        yield from of_channel(scene, surface)
    elif scene.flow.kind != "still":
        why = "a free surface is simulated in a box whose fluid starts from rest"
        yield ("flow", "kind"), why, 'use "still", or domain.kind = "channel"'
    else:
        yield from of_box(surface)
    if surface.bottom == "slip" and scene.bed is not None:
        yield ("surface", "bottom"), "is that of a domain without [bed]", "leave one of them out"
    if surface.bottom == "slip" and surface.seepage != "0":
        why = "enters straight up, which a bottom that slips does not ask for"
        yield ("surface", "seepage"), why, "leave surface.bottom out"
    if surface.points and scene.gdim == 3:
        yield ("surface", "points"), "are those of a scene in the plane", "give the elevation as a formula"
    for name, remedy in (("elevation", "use x only"), ("seepage", "use x and t only")):
        if scene.gdim == 2 and "y" in _variables(getattr(surface, name)):
            yield ("surface", name), "depends on y but the scene lies in the plane", remedy


def _variables(text: str) -> frozenset[str]:
    from .expression import Expression

    return Expression(text).variables


def misplaced(scene: SceneSections) -> Iterator[Problem]:
    """Stations outside of the domain, and a first elevation that is not above bed and grain."""
    if not scene.has_surface:
        return
    surface, domain = scene.surface or Surface(), scene.domain
    sides = [("x", domain.left, domain.right)] + ([("y", *domain.across)] if scene.gdim == 3 else [])
    for number, place in enumerate(surface.places()):
        key = ("surface", "stations", number)
        if len(place) != len(sides):
            remedy = "give its x" if scene.gdim == 2 else "give [x, y]"
            yield Problem(key, f"has {counted(len(place), 'coordinate')}", remedy)
            return
        for (axis, low, high), value in zip(sides, place, strict=True):
            if not low <= value <= high:
                yield Problem(key, f"{axis} = {value:g} is outside the domain", f"give {low:g} to {high:g}")
                return
    yield from _too_low(scene, surface)


def _too_low(scene: SceneSections, surface: Surface) -> Iterator[Problem]:
    domain, bed = scene.domain, scene.bed_shape
    axes = [np.linspace(domain.left, domain.right, _SAMPLES)]
    if scene.gdim == 3:
        axes.append(np.linspace(*domain.across, _SAMPLES))
    across = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, scene.gdim - 1)
    places = np.zeros((3, len(across)))
    places[: scene.gdim - 1] = across.T
    try:
        heights = domain.ceiling + surface.height(places)
    except SceneError as error:
        yield Problem(("surface", "elevation"), *split(str(error)))
        return
    floor = np.full(len(across), domain.bottom)
    if bed is not None:
        floor = bed.height(across[:, 0] if scene.gdim == 2 else across)
    lowest = int(np.argmin(heights - floor))
    if heights[lowest] <= floor[lowest]:
        where = ", ".join(f"{axis} = {value:g}" for axis, value in zip("xy", across[lowest], strict=False))
        key = ("surface", "points" if surface.points else "elevation")
        yield Problem(key, f"brings the surface down to the bed at {where}", "give a smaller elevation")

"""Where a scene's free surface is: stations outside of the domain, a surface below the bed."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..errors import SceneError
from .domain import Domain
from .messages import Problem, counted, problem, split
from .surface import Surface

_SAMPLES = 201  # along each side of the surface, where its first elevation is looked at


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

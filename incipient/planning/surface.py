"""The free surface of a scene: the condition on the flow, and the elevation that it starts with."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..scene import Scene
from .cells import side_names, sides_across
from .open_channel import sponges, surface_of

if TYPE_CHECKING:
    from ..fluid.conditions import FreeSurface

OUTLINE = 65  # points on each curve of a grain's outline


def free_surface(scene: Scene) -> FreeSurface:
    """The condition on top of a scene whose top is a free surface. Not collective."""
    from ..fluid.conditions import FreeSurface
    from ..scene.expression import Expression

    asked, domain = surface_of(scene), scene.domain
    # Where the still level meets the right end, the pressure without the hydrostatic part is zero.
    origin = (domain.right, *((domain.middle,) if scene.gdim == 3 else ()), domain.ceiling)
    pressure = None if asked.pressure == "0" else Expression(asked.pressure, "surface.pressure")
    top, gravity = side_names(scene)[2], tuple(scene.gravity_vector.tolist())
    return FreeSurface(top, gravity, origin, pressure, asked.tension, sticking(scene), sponges(scene))


def sticking(scene: Scene) -> tuple[str, ...]:
    """Names of the sides to which fluid below a free surface sticks, and the surface is pinned. Not collective."""
    _, right, _, left = side_names(scene)
    ends = (left, right) if surface_of(scene).ends == "no-slip" else ()
    return ends if scene.sides == "slip" else (*ends, *sides_across(scene))


def depths(scene: Scene, places: np.ndarray) -> tuple[np.ndarray, str]:
    """From the still level at places (n, 3) down to the bed or a grain that rests there (n,), and which in words.

    A grain in space is left to the mesh, whose cells above it fold before the surface touches it. Not collective.
    """
    domain, bed = scene.domain, scene.bed_shape
    floor = np.full(len(places), domain.bottom)
    if bed is not None:
        floor = bed.height(places[:, 0] if scene.gdim == 2 else places[:, :2])
    below = "the bed" if bed is not None else "the bottom"
    grain, placement = scene.grain, scene.placement
    moves = scene.body is not None and scene.body.moves
    if scene.gdim == 3 or grain is None or placement is None or moves:
        return domain.ceiling - floor, below
    outline = placement.to_scene(grain.chain.points(OUTLINE))
    low, high = outline[:, 0].min(), outline[:, 0].max()
    for row, x in enumerate(places[:, 0]):
        if low <= x <= high:
            near = outline[np.abs(outline[:, 0] - x) <= (high - low) / len(outline) * 8.0]
            floor[row] = max(floor[row], near[:, 1].max(initial=floor[row]))
    return domain.ceiling - floor, f"{below} or the grain"


def stays_below(scene: Scene) -> tuple[str, ...]:
    """Names of the boundaries whose nodes stay where they are when the surface rises. Not collective."""
    return (side_names(scene)[0], *(("body",) if scene.body is not None else ()))

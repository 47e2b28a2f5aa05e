"""The free surface of a scene: pinned sides, and depth of the fluid below."""

import numpy as np

from .flow_setup import Setup
from .scene_geometry import Geometry

OUTLINE = 65  # points on each curve of a grain's outline


def sticking(setup: Setup) -> tuple[str, ...]:
    """Names of the sides to which fluid below a free surface sticks, and the surface is pinned. Not collective."""
    ends = (setup.sides.left, setup.sides.right) if setup.surface.ends == "no-slip" else ()
    return ends if setup.geometry.sides == "slip" else (*ends, *setup.sides.across)


def depths(geometry: Geometry, places: np.ndarray) -> tuple[np.ndarray, str]:
    """The depth (n,) below the still level at positions (n, 3), down to bed or resting grain, and which in words.

    A 3-D grain does not count: the mesh above it folds before the surface touches it. Not collective.
    """
    domain, bed = geometry.domain, geometry.bed
    floor = np.full(len(places), domain.bottom)
    if bed is not None:
        floor = bed.height(places[:, 0] if geometry.gdim == 2 else places[:, :2])
    below = "the bed" if bed is not None else "the bottom"
    grain, placement = geometry.grain, geometry.placement
    if geometry.gdim == 3 or grain is None or placement is None or geometry.moves:
        return domain.ceiling - floor, below
    outline = placement.to_scene(grain.chain.points(OUTLINE))
    low, high = outline[:, 0].min(), outline[:, 0].max()
    for row, x in enumerate(places[:, 0]):
        if low <= x <= high:
            near = outline[np.abs(outline[:, 0] - x) <= (high - low) / len(outline) * 8.0]
            floor[row] = max(floor[row], near[:, 1].max(initial=floor[row]))
    return domain.ceiling - floor, f"{below} or the grain"


def stays_below(setup: Setup) -> tuple[str, ...]:
    """Names of the boundaries whose nodes stay where they are when the surface rises. Not collective."""
    return (setup.sides.bottom, *(("body",) if setup.geometry.grain is not None else ()))

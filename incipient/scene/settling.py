"""Equilibrium of a released grain on its bed."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

from ..errors import SceneError
from ..geometry.placement import Placement
from ..geometry.settle import settle

DEFAULT_FRICTION = 1.0  # where the scene has no contact: rough enough for slopes of 45 degrees


# The placement of a scene is read many times; computing it takes one or two seconds.
@lru_cache(maxsize=16)
def rested(
    grain: Any,
    bed: Any,
    above: Placement,
    down: tuple[float, ...],
    friction: float | None,
    reach: float,
) -> Placement:
    """Equilibrium of a grain released above a placement, in 2-D or in 3-D.

    down: direction of gravity; reach: distance over which the grain may roll. Raises SceneError without a stable rest.
    """
    hold = DEFAULT_FRICTION if friction is None else friction
    start = replace(above, centre=(*above.centre[:-1], bed.crest + grain.size))
    settled = settle(grain, bed, start, down, hold, reach / grain.size)
    if not settled.stable:
        turn = "angle" if above.gdim == 2 else "y or orientation"
        raise SceneError(
            f"the grain {settled.outcome.value}; change x or {turn}, or leave settle out"
        )
    return settled.placement

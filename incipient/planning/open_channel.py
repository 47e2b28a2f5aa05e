"""A channel with a free surface: what enters it, and the sponge in which its waves die out (docs/channels.md)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ..scene import Scene, Surface
from ..scene.open_channel import froude
from .cells import largest_cell, largest_cell_in_space, side_names
from .stream import inflow, undisturbed

if TYPE_CHECKING:
    from ..fluid.conditions import Condition, Sponge

# Length, over the depth, of the zone in which the surface comes in level; a cell at the least.
LEVEL = 0.25
# A long wave that runs through the sponge to the end and back keeps exp(-ABSORBED) of its height.
ABSORBED = 5.0


def ends(scene: Scene) -> list[Condition]:
    """The conditions at both ends of a channel with a free surface. Not collective."""
    from ..fluid.conditions import Entering, Open, Slip
    from ..scene.expression import Expression

    asked, (_, right, _, left) = surface_of(scene), side_names(scene)
    stream, beside = inflow(scene), Expression(asked.inflow)
    largest = largest_cell(scene) if scene.gdim == 2 else largest_cell_in_space(scene, scene.order)
    level = max(LEVEL * scene.domain.height, scene.numerics.mesh_size * largest)
    entering = Entering(left, 0, lambda x, t: stream(x, t)[0] + beside(x, t), level, froude(scene) >= 1.0)
    return [entering, Open(right) if asked.outflow == "open" else Slip(right, axis=0)]


def sponge_of(scene: Scene) -> Sponge | None:
    """The sponge before the end of a channel; None: there is none. Not collective."""
    from ..fluid.conditions import Sponge

    length, domain = surface_of(scene).sponge, scene.domain
    if length == 0.0:
        return None
    gravity = float(abs(scene.gravity_vector[scene.up]))
    # A wave of speed c loses exp(-s x/(2 c)) of its height, with s a third of the rate at the end in the mean.
    speed = math.sqrt(gravity * domain.height)
    return Sponge(domain.right - length, length, 3.0 * ABSORBED * speed / length, undisturbed(scene))


def surface_of(scene: Scene) -> Surface:
    """The section [surface] of a scene whose top is free, or what it is by default. Not collective."""
    return scene.surface or Surface()

"""Conditions of a flow below a free surface: on top, at the ends of a channel, and in a sponge."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..fluid.conditions import (
    Condition,
    Entering,
    FreeSurface,
    IncomingWave,
    Open,
    Slip,
    Sponge,
)
from ..setup.base_flow import BaseFlow
from ..setup.setup import Setup
from .discretisation import LEVEL, far_cell, velocity_order

if TYPE_CHECKING:
    from ..setup.waves import StokesWave

Profile = Callable[[Floats, float], Floats]

# A long wave that runs through the sponge to the end and back keeps exp(-ABSORBED) of its height.
ABSORBED = 5.0


def free_surface(setup: Setup) -> FreeSurface:
    """The condition on a free surface."""
    domain, scene = setup.scene.domain, setup.scene
    # The pressure without the hydrostatic part is zero where the still level meets the right end.
    origin = (domain.right, *((domain.middle,) if scene.gdim == 3 else ()), domain.ceiling)
    top, gravity = setup.sides.top, tuple(scene.gravity_vector.tolist())
    return FreeSurface(top, gravity, origin, setup.pinned_sides, sponge(setup))


def ends(setup: Setup) -> list[Condition]:
    """The conditions at both ends of a channel with a free surface."""
    scene, largest = setup.scene, far_cell(setup.scene, velocity_order(setup)[0])
    level = max(LEVEL * scene.domain.height, scene.numerics.mesh_size * largest)
    from ..setup.waves import wave_of

    wave, base_flow = wave_of(setup), setup.base_flow
    if wave is None:
        along, coming = (lambda x, t: base_flow.entering(x, t)[0]), None
    else:
        along, coming = _with_wave(base_flow, wave), _coming_in(base_flow, wave)
    entering = Entering(
        setup.sides.left, 0, along, level, (setup.numbers.froude or 0.0) >= 1.0, coming
    )
    right = setup.sides.right
    return [entering, Open(right) if setup.surface.outflow == "open" else Slip(right, axis=0)]


def sponge(setup: Setup) -> Sponge | None:
    """The zone before the right end of a channel in which waves die out, or None."""
    surface, domain, scene = setup.surface, setup.scene.domain, setup.scene
    if surface.sponge == 0.0:
        return None
    # A wave of speed c loses exp(-s x/(2 c)) of its height, with s a third of the rate at the end, on average.
    rate = 3.0 * ABSORBED * math.sqrt(abs(scene.gravity_vector[scene.up]) * domain.height)
    start = domain.right - surface.sponge
    return Sponge(start, domain.right, rate / surface.sponge, setup.base_flow.velocity)


def _with_wave(base_flow: BaseFlow, wave: StokesWave) -> Profile:
    """The velocity at the inflow, of base flow and wave over the depth below the wave.

    It is weighted by the area of the initial mesh.
    """
    base_velocity, datum, up = base_flow.entering, base_flow.datum, base_flow.domain.up

    def along(x: Floats, t: float) -> Floats:
        deeper, places = 1.0 + wave.elevation(np.zeros(1), t)[0] / wave.depth, x.copy()
        places[up] = datum + (x[up] - datum) * deeper
        waving, _ = wave.velocity(np.zeros(x.shape[1]), places[up] - datum, t)
        return np.asarray((base_velocity(places, t)[0] + waving) * deeper)

    return along


def _coming_in(base_flow: BaseFlow, wave: StokesWave) -> IncomingWave:
    base_velocity, left, datum, up = (
        base_flow.velocity,
        base_flow.domain.left,
        base_flow.datum,
        base_flow.domain.up,
    )

    def velocity(x: Floats, t: float) -> Floats:
        total = base_velocity(x, t)
        for axis, waving in zip((0, up), wave.velocity(x[0] - left, x[up] - datum, t), strict=True):
            total[axis] += waving
        return total

    return IncomingWave(velocity, lambda x, t: wave.elevation(x[0] - left, t))

"""A channel with a free surface: what enters it, and the sponges in which its waves die out (docs/channels.md)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..errors import SceneError
from ..scene import Surface
from ..scene.expression import Expression
from .base_flow import BaseFlow
from .flow_setup import Setup

if TYPE_CHECKING:
    from ..fluid.conditions import Condition, Sponge, Wave
    from .waves import StokesWave

Profile = Callable[[Floats, float], Floats]

# Length, over the depth, of the zone in which the surface comes in level; a cell at the least.
LEVEL = 0.25
NEAR_CRITICAL = 0.95, 1.3  # Froude numbers of which a plan warns
# A long wave that runs through the sponge to the end and back keeps exp(-ABSORBED) of its height.
ABSORBED = 5.0


def ends(setup: Setup) -> list[Condition]:
    """The conditions at both ends of a channel with a free surface. Not collective."""
    from ..fluid.conditions import Entering, Open, Slip

    scene, cells = setup.scene, setup.far_cells
    largest = cells.largest if scene.gdim == 2 else cells.largest_in_space(setup.order.number)
    level = max(LEVEL * scene.domain.height, scene.numerics.mesh_size * largest)
    wave, base_flow = wave_of(setup), setup.base_flow
    along = _with_formula(base_flow, setup.surface) if wave is None else _with_wave(base_flow, wave)
    coming = None if wave is None else _coming_in(base_flow, wave)
    entering = Entering(setup.sides.left, 0, along, level, froude(setup) >= 1.0, coming)
    right = setup.sides.right
    return [entering, Open(right) if setup.surface.outflow == "open" else Slip(right, axis=0)]


def sponges(setup: Setup) -> tuple[Sponge, ...]:
    """The zones at the ends of a channel in which waves die out. Not collective."""
    from ..fluid.conditions import Sponge

    asked, domain, scene = setup.surface, setup.geometry.domain, setup.scene
    # A wave of speed c loses exp(-s x/(2 c)) of its height, with s a third of the rate at the end in the mean.
    rate = 3.0 * ABSORBED * math.sqrt(abs(scene.gravity_vector[scene.up]) * domain.height)
    found = []
    if asked.sponge > 0.0:
        start = domain.right - asked.sponge
        found.append(Sponge(start, domain.right, rate / asked.sponge, setup.base_flow.velocity))
    if asked.wave is not None and asked.wave.zone > 0.0:
        start, length = domain.left + asked.wave.zone, asked.wave.zone
        found.append(Sponge(start, domain.left, rate / length, None))
    return tuple(found)


def seepage(asked: Surface, up: int) -> Callable[[Floats, float], Floats]:
    """The velocity at which fluid seeps through the bed, straight up in the coordinate `up`. Not collective."""
    speed = Expression(asked.seepage, "surface.seepage")
    return lambda x, t: np.vstack([*np.zeros((up, x.shape[1])), speed(x, t)])


def wave_of(setup: Setup) -> StokesWave | None:
    """The wave that a wave maker lets into a channel; None: there is none. Not collective.

    Raises:
        SceneError: it is too high for what is known of it.
    """
    asked, base_flow = setup.surface.wave, setup.base_flow
    if asked is None:
        return None
    from .waves import HIGHEST, stokes_wave

    gravity = float(abs(setup.scene.gravity_vector[base_flow.up]))

    def speed(y: Floats) -> Floats:
        places = base_flow.column(base_flow.domain.entrance, base_flow.datum + y)
        return np.asarray(base_flow.velocity(places, 0.0)[0])

    wave = stokes_wave(asked.amplitude, 2.0 * math.pi / asked.period, base_flow.depth, gravity, speed)
    if wave.second > HIGHEST * wave.amplitude:
        raise SceneError(
            f"surface.wave: its second harmonic is {wave.second / wave.amplitude:.2g} of the first, more than "
            f"{HIGHEST:g}: give a smaller amplitude or period, or the velocity as surface.inflow"
        )
    return wave


def _with_formula(base_flow: BaseFlow, asked: Surface) -> Profile:
    """The velocity along a channel at its inflow with what a formula adds to the stream."""
    stream, beside = base_flow.entering, Expression(asked.inflow, "surface.inflow")
    return lambda x, t: stream(x, t)[0] + beside(x, t)


def _with_wave(base_flow: BaseFlow, wave: StokesWave) -> Profile:
    """The velocity along a channel at its inflow, of stream and wave over the depth below the wave.

    It is counted by the area as the mesh was made.
    """
    stream, datum, up = base_flow.entering, base_flow.datum, base_flow.up

    def along(x: Floats, t: float) -> Floats:
        deeper, places = 1.0 + wave.elevation(np.zeros(1), t)[0] / wave.depth, x.copy()
        places[up] = datum + (x[up] - datum) * deeper
        waving, _ = wave.velocity(np.zeros(x.shape[1]), places[up] - datum, t)
        return np.asarray((stream(places, t)[0] + waving) * deeper)

    return along


def _coming_in(base_flow: BaseFlow, wave: StokesWave) -> Wave:
    from ..fluid.conditions import Wave

    stream, left, datum, up = base_flow.velocity, base_flow.domain.left, base_flow.datum, base_flow.up

    def velocity(x: Floats, t: float) -> Floats:
        found = stream(x, t)
        for axis, waving in zip((0, up), wave.velocity(x[0] - left, x[up] - datum, t), strict=True):
            found[axis] += waving
        return found

    return Wave(velocity, lambda x, t: wave.elevation(x[0] - left, t))


def froude(setup: Setup) -> float:
    """V/sqrt(g H) of the base flow, g across the bed and H from the datum to the still level; zero at rest."""
    base_flow = setup.base_flow
    gravity = float(abs(setup.scene.gravity_vector[base_flow.up]))
    if base_flow.flow.kind == "still" or gravity == 0.0:
        return 0.0
    return base_flow.reference / math.sqrt(gravity * base_flow.depth)


def near_critical(setup: Setup) -> str:
    """A warning for near-critical flow, or an empty string. Not collective."""
    if not setup.scene.has_surface or setup.scene.domain.kind != "channel":
        return ""
    number = froude(setup)
    if not NEAR_CRITICAL[0] <= number <= NEAR_CRITICAL[1]:
        return ""
    low, high = NEAR_CRITICAL
    return (
        f"the Froude number, {number:.3g}, is between {low:g} and {high:g}: long waves hardly leave near-critical "
        "flow, so that its level depends on the ends and on the length of the run; compare with a larger "
        "domain.length and time.end, or choose another gravity.acceleration or flow.velocity"
    )

"""A channel with a free surface: what enters it, and the sponges in which its waves die out (docs/channels.md)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..errors import SceneError
from ..scene import Scene, Surface
from ..scene.open_channel import froude
from .base_flow import column, inflow, undisturbed
from .cells import largest_cell, largest_cell_in_space, side_names

if TYPE_CHECKING:
    from ..fluid.conditions import Condition, Sponge, Wave
    from .waves import StokesWave

Profile = Callable[[Floats, float], Floats]

# Length, over the depth, of the zone in which the surface comes in level; a cell at the least.
LEVEL = 0.25
NEAR_CRITICAL = 0.95, 1.3  # Froude numbers of which a plan warns
# A long wave that runs through the sponge to the end and back keeps exp(-ABSORBED) of its height.
ABSORBED = 5.0


def ends(scene: Scene) -> list[Condition]:
    """The conditions at both ends of a channel with a free surface. Not collective."""
    from ..fluid.conditions import Entering, Open, Slip

    asked, (_, right, _, left) = surface_of(scene), side_names(scene)
    largest = largest_cell(scene) if scene.gdim == 2 else largest_cell_in_space(scene, scene.order)
    level = max(LEVEL * scene.domain.height, scene.numerics.mesh_size * largest)
    wave = wave_of(scene)
    along = _beside_stream(scene) if wave is None else _with_stream(scene, wave)
    coming = None if wave is None else _coming_in(scene, wave)
    entering = Entering(left, 0, along, level, froude(scene) >= 1.0, coming)
    return [entering, Open(right) if asked.outflow == "open" else Slip(right, axis=0)]


def sponges(scene: Scene) -> tuple[Sponge, ...]:
    """The zones at the ends of a channel in which waves die out. Not collective."""
    from ..fluid.conditions import Sponge

    asked, domain = surface_of(scene), scene.domain
    # A wave of speed c loses exp(-s x/(2 c)) of its height, with s a third of the rate at the end in the mean.
    rate = 3.0 * ABSORBED * math.sqrt(abs(scene.gravity_vector[scene.up]) * domain.height)
    found = []
    if asked.sponge > 0.0:
        start = domain.right - asked.sponge
        found.append(Sponge(start, domain.right, rate / asked.sponge, undisturbed(scene)))
    if asked.wave is not None and asked.wave.zone > 0.0:
        start, length = domain.left + asked.wave.zone, asked.wave.zone
        found.append(Sponge(start, domain.left, rate / length, None))
    return tuple(found)


def seepage(scene: Scene) -> Callable[[Floats, float], Floats]:
    """The velocity at which fluid seeps through the bed of a scene, straight up. Not collective."""
    from ..scene.expression import Expression

    speed, up = Expression(surface_of(scene).seepage, "surface.seepage"), scene.up
    return lambda x, t: np.vstack([*np.zeros((up, x.shape[1])), speed(x, t)])


def wave_of(scene: Scene) -> StokesWave | None:
    """The wave that a wave maker lets into a channel; None: there is none. Not collective.

    Raises:
        SceneError: it is too high for what is known of it.
    """
    asked = surface_of(scene).wave
    if asked is None:
        return None
    from .waves import HIGHEST, stokes_wave

    depth, gravity = scene.domain.ceiling - scene.datum, float(abs(scene.gravity_vector[scene.up]))
    stream = undisturbed(scene)

    def speed(y: Floats) -> Floats:
        places = column(scene, scene.domain.entrance, scene.datum + y)
        return np.asarray(stream(places, 0.0)[0])

    wave = stokes_wave(asked.amplitude, 2.0 * math.pi / asked.period, depth, gravity, speed)
    if wave.second > HIGHEST * wave.amplitude:
        raise SceneError(
            f"surface.wave: its second harmonic is {wave.second / wave.amplitude:.2g} of the first, more than "
            f"{HIGHEST:g}: give a smaller amplitude or period, or the velocity as surface.inflow"
        )
    return wave


def _beside_stream(scene: Scene) -> Profile:
    """The velocity along a channel at its inflow with what a formula adds to the stream."""
    from ..scene.expression import Expression

    stream, beside = inflow(scene), Expression(surface_of(scene).inflow, "surface.inflow")
    return lambda x, t: stream(x, t)[0] + beside(x, t)


def _with_stream(scene: Scene, wave: StokesWave) -> Profile:
    """The velocity along a channel at its inflow, of stream and wave over the depth below the wave.

    It is counted by the area as the mesh was made.
    """
    stream, (datum, up) = inflow(scene), (scene.datum, scene.up)

    def along(x: Floats, t: float) -> Floats:
        deeper, places = 1.0 + wave.elevation(np.zeros(1), t)[0] / wave.depth, x.copy()
        places[up] = datum + (x[up] - datum) * deeper
        waving, _ = wave.velocity(np.zeros(x.shape[1]), places[up] - datum, t)
        return np.asarray((stream(places, t)[0] + waving) * deeper)

    return along


def _coming_in(scene: Scene, wave: StokesWave) -> Wave:
    from ..fluid.conditions import Wave

    stream, left, datum, up = undisturbed(scene), scene.domain.left, scene.datum, scene.up

    def velocity(x: Floats, t: float) -> Floats:
        found = stream(x, t)
        for axis, waving in zip((0, up), wave.velocity(x[0] - left, x[up] - datum, t), strict=True):
            found[axis] += waving
        return found

    return Wave(velocity, lambda x, t: wave.elevation(x[0] - left, t))


def surface_of(scene: Scene) -> Surface:
    """The section [surface] of a scene whose top is free, or what it is by default. Not collective."""
    return scene.surface or Surface()


def near_critical(scene: Scene) -> str:
    """What is to be known of a stream about as fast as its long waves, or an empty string. Not collective."""
    if not scene.has_surface or scene.domain.kind != "channel":
        return ""
    number = froude(scene)
    if not NEAR_CRITICAL[0] <= number <= NEAR_CRITICAL[1]:
        return ""
    low, high = NEAR_CRITICAL
    return (
        f"the Froude number, {number:.3g}, is between {low:g} and {high:g}: long waves hardly leave a stream near the "
        "critical one, so that its level hangs on the ends and on how long the run is; compare with a larger "
        "domain.length and time.end, or choose another gravity.acceleration or flow.velocity"
    )

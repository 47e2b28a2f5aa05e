"""A channel with a free surface: its Froude number, and the wave of a wave maker (docs/explanation/surface.md)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..errors import SceneError
from .flow_setup import Setup

if TYPE_CHECKING:
    from .waves import StokesWave

# Length, over the depth, of the zone in which the surface comes in level; a cell at the least.
LEVEL = 0.25
NEAR_CRITICAL = 0.95, 1.3  # Froude numbers of which a plan warns


def wave_of(setup: Setup) -> StokesWave | None:
    """The wave that a wave maker lets into a channel; None: there is none. Not collective.

    Raises:
        SceneError: it is too high for what is known of it.
    """
    settings, base_flow = setup.surface.wave, setup.base_flow
    if settings is None:
        return None
    from .waves import HIGHEST, stokes_wave

    gravity = float(abs(setup.scene.gravity_vector[base_flow.domain.up]))

    def speed(y: Floats) -> Floats:
        places = base_flow.column(base_flow.domain.entrance, base_flow.datum + y)
        return np.asarray(base_flow.velocity(places, 0.0)[0])

    wave = stokes_wave(
        settings.amplitude, 2.0 * math.pi / settings.period, base_flow.depth, gravity, speed
    )
    if wave.second > HIGHEST * wave.amplitude:
        raise SceneError(
            f"surface.wave: its second harmonic is {wave.second / wave.amplitude:.2g} of the first, more than "
            f"{HIGHEST:g}: give a smaller amplitude or period"
        )
    return wave


def froude(setup: Setup) -> float:
    """V/sqrt(g H) of the base flow, g across the bed and H from the datum to the still level; zero at rest."""
    base_flow = setup.base_flow
    gravity = float(abs(setup.scene.gravity_vector[base_flow.domain.up]))
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

"""Load of an accelerating flow on a grain at rest: added mass and pressure gradient."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import brentq

from ..arrays import Floats
from ..contact import Load
from ..contact.friction import Law
from ..contact.safety import safety_factor
from ..parallel import Comm
from ..setup.driving_force import DisplacedFluid
from ..setup.setup import Setup
from ..simulation.build import prepared
from .outcome import Threshold

FARTHEST = 20.0  # range of the search: factor on the critical strength, and its inverse
LARGEST_LOGARITHM = 5.0  # of a safety factor in a root search
APART = 1.03  # ratio of growths between which critical strengths are interpolated


def load_of_growth(setup: Setup, comm: Comm) -> Floats:
    """Force and torque (6,) about the centroid for growth by the scene's flow in unit time. Collective.

    Inviscid: pressure gradient on the displaced fluid, and potential disturbance.
    """
    from ..coupled.added_mass import load_of_disturbance

    scene, base_flow = setup.scene, setup.base_flow
    assert scene.grain is not None
    with prepared(scene, comm) as run:
        placement = run.layout.placement
        assert placement is not None
        bottom, outlet = setup.sides.around[:2]
        walls = ["body", *([bottom] if scene.bed is not None else [])]
        disturbance = load_of_disturbance(
            run.domain, lambda x: base_flow.velocity(x, 0.0), walls, outlet, placement.centre
        )
    return np.ravel(disturbance + DisplacedFluid(scene.grain, base_flow).load(placement))


@dataclass(frozen=True, eq=False)
class CriticalStrength:
    """Critical strength of a growing or fading flow. Near the critical flow the load is a power of the strength.

    of_growth: (6,) load at growth of the strength by one in unit time
    """

    threshold: Threshold
    of_growth: Floats
    law: Law
    _known: dict[tuple[float, bool], float] = field(default_factory=dict)

    def near(self, growth: float, relative: bool) -> float:
        """As `at`, interpolated between neighbours for an absolute growth, which differs between mean flows."""
        if relative or not growth:
            return self.at(growth, relative)
        below = APART ** math.floor(math.log(abs(growth)) / math.log(APART))
        ends = [below, APART * below]
        known = [self.at(math.copysign(end, growth), False) for end in ends]
        return float(np.interp(abs(growth), ends, known))

    def at(self, growth: float, relative: bool) -> float:
        """Critical strength at growth in unit time by `growth` times the scene's flow, or its own if `relative`."""
        key = (float(f"{growth:.8g}"), relative)
        if key not in self._known:
            self._known[key] = self._solved(*key)
        return self._known[key]

    def _solved(self, growth: float, relative: bool) -> float:
        factor = self.threshold.factor
        low, high = factor / FARTHEST, factor * FARTHEST
        if self._logarithm(low, growth, relative) <= 0.0:
            return low
        if self._logarithm(high, growth, relative) >= 0.0:
            return high
        return float(brentq(self._logarithm, low, high, args=(growth, relative), xtol=1e-8 * low))

    def _logarithm(self, strength: float, growth: float, relative: bool) -> float:
        threshold = self.threshold
        assert threshold.steepness is not None
        steady, ratio = threshold.load, (strength / threshold.factor) ** threshold.steepness
        added = growth * (strength if relative else 1.0) * self.of_growth
        force, torque = ratio * steady.flow_force, ratio * steady.flow_couple
        load = Load(force + added[:3], torque + added[3:], steady.weight, steady.centre)
        value = safety_factor(load, threshold.contacts, self.law).value
        bound = math.exp(LARGEST_LOGARITHM)
        return math.log(min(max(value, 1.0 / bound), bound))

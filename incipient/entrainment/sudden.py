"""What a flow that grows exerts on a grain at rest besides the load of its strength: added mass, pressure gradient."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from ..arrays import Floats
from ..contact import Contacts, Load
from ..contact.safety import safety_factor
from ..critical.outcome import Threshold
from ..parallel import Comm
from ..planning.driving_force import DisplacedFluid
from ..planning.flow_setup import Setup
from ..simulation.build import prepared

FARTHEST = 20.0  # times the critical strength, or its inverse, where it is looked for
LARGEST_LOGARITHM = 5.0  # of a safety factor while a root is looked for


def load_of_growth(setup: Setup, comm: Comm) -> Floats:
    """Force and couple (6,) on the grain where the scene's flow grows by itself in unit time. Collective.

    The couple is about the centroid. It is that of the pressure gradient that makes the base flow grow, on the fluid
    displaced, and of the disturbance, as far as viscosity has not acted yet.
    """
    from ..fluid.acceleration import load_of_disturbance

    scene, base_flow = setup.scene, setup.base_flow
    assert scene.grain is not None
    with prepared(scene, comm) as run:
        placement = run.layout.placement
        assert placement is not None
        bottom, outlet = setup.sides.around[:2]
        walls = ["body", *([bottom] if scene.bed is not None else [])]
        found = load_of_disturbance(
            run.domain, lambda x: base_flow.velocity(x, 0.0), walls, outlet, placement.centre
        )
    return np.ravel(found + DisplacedFluid(scene.grain, base_flow).load(placement))


@dataclass(frozen=True, eq=False)
class CriticalStrength:
    """The strength at which a grain begins to move where the flow grows or fades at the same time.

    Near the critical flow the load goes as a power of the strength.

    factor, load, power: of the critical steady flow
    of_growth: (6,) load where the strength grows by one in unit time
    """

    factor: float
    load: Load
    power: float
    of_growth: Floats
    contacts: Contacts
    friction: float

    @classmethod
    def of(cls, threshold: Threshold, of_growth: Floats, friction: float) -> CriticalStrength:
        """The critical strengths of a grain about its threshold."""
        assert threshold.steepness is not None
        held = (of_growth, threshold.contacts, friction)
        return cls(threshold.factor, threshold.load, threshold.steepness, *held)

    def at(self, growth: float, relative: bool) -> float:
        """The critical strength where the flow grows in unit time by `growth` times the scene's, or its own: relative.

        Not collective.
        """
        low, high = self.factor / FARTHEST, self.factor * FARTHEST
        if self._logarithm(low, growth, relative) <= 0.0:
            return low
        if self._logarithm(high, growth, relative) >= 0.0:
            return high
        return float(brentq(self._logarithm, low, high, args=(growth, relative), xtol=1e-8 * low))

    def _logarithm(self, strength: float, growth: float, relative: bool) -> float:
        """Logarithm of the safety factor, within bounds."""
        share = (strength / self.factor) ** self.power
        more = growth * (strength if relative else 1.0) * self.of_growth
        load = Load(
            share * self.load.flow_force + more[:3],
            share * self.load.flow_couple + more[3:],
            self.load.weight,
            self.load.centre,
        )
        value = safety_factor(load, self.contacts, self.friction).value
        return float(
            np.clip(
                math.log(value) if value > 0.0 else -math.inf, -LARGEST_LOGARITHM, LARGEST_LOGARITHM
            )
        )

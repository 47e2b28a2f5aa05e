"""The effective height of a bed with forms: that of the level plane that it acts as on the flow far above."""

import math
from dataclasses import dataclass
from typing import Any

from ..geometry.plane.beds import effective_level
from ..scene import Domain, OpenChannel, Poiseuille, Shear

# What inertia leaves of the depth of the effective height below the crests, (1 + R/INERTIAL)^-POWER with R = shear rate
# times period times that depth over the viscosity: measured over periods of half-discs and ripples
# (docs/explanation/flow.md).
INERTIAL, POWER = 10.0, 0.2
FEWEST_PERIODS = (
    2.0  # in the domain: along longer forms the flow is as over a bed that rises and falls
)
UNSURE = 0.5  # of what inertia changes; those measurements are within it where R is above 1


@dataclass(frozen=True)
class EffectiveHeight:
    """The height above the base line of the level plane that a bed with forms acts as on the flow far above."""

    height: float  # in the base flow at its speed
    uncertainty: float  # how far it may be off
    creeping: float  # without inertia


def repeats(flow: Any, domain: Domain, bed: Any) -> bool:
    """Whether a base flow of known shear at the bed passes several forms in 2-D that repeat. Not collective."""
    if (
        domain.width is not None
        or bed is None
        or not isinstance(flow, Shear | Poiseuille | OpenChannel)
    ):
        return False
    return bool(bed.period and domain.length >= FEWEST_PERIODS * bed.period)


def effective_height(
    flow: Any, domain: Domain, bed: Any, viscosity: float, speed: float
) -> EffectiveHeight:
    """The effective height of a 2-D bed below a base flow faster by `speed`. Not collective.

    viscosity: kinematic; inf without inertia
    """
    if not math.isfinite(bed.feature):
        return EffectiveHeight(0.0, 0.0, 0.0)
    level = effective_level(bed)
    depth = max(bed.crest - domain.bottom - level, 0.0)
    reynolds = (
        _shear_rate(flow, domain.ceiling - bed.crest) * (bed.period or 0.0) * depth / viscosity
    )
    lost = depth * (1.0 - (1.0 + speed * reynolds / INERTIAL) ** -POWER) if reynolds else 0.0
    return EffectiveHeight(level + lost, UNSURE * lost, level)


def _shear_rate(flow: Any, depth: float) -> float:
    """Shear rate at the bed below a depth of fluid; zero where it is not known."""
    if isinstance(flow, Shear):
        return flow.rate
    if isinstance(flow, Poiseuille | OpenChannel):
        return (6.0 if isinstance(flow, Poiseuille) else 3.0) * flow.velocity / depth
    return 0.0

"""The datum of the undisturbed flow: the height of the bed at which its profile starts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from .flows import OpenChannel, Poiseuille, Shear
from .model import SceneSections

# What inertia leaves of the depth of the effective height below the crests, (1 + R/INERTIAL)^-POWER with R = shear rate
# times period times that depth over the viscosity: measured over periods of half-discs and ripples (docs/numerics.md).
INERTIAL, POWER = 10.0, 0.2
FEWEST_PERIODS = 2.0  # in the domain: along longer forms a stream goes as over a bed that rises and falls
UNSURE = 0.5  # of what inertia changes; those measurements are within it where R is above 1


@dataclass(frozen=True)
class EffectiveHeight:
    """The height above the base line of the level plane that a bed with forms acts as on the stream far above.

    height:    in the stream at its speed; uncertainty: how far it may be off
    creeping:  without inertia
    """

    height: float
    uncertainty: float
    creeping: float


def height_of_datum(scene: SceneSections, speed: float = 1.0) -> float:
    """The height in the scene at which the profile starts; without a bed the domain's bottom. Not collective.

    `speed`: of the stream over the scene's, on which inertia makes a computed height depend.
    """
    domain, bed = scene.domain, scene.bed_shape
    if bed is None:
        return domain.bottom
    level = getattr(scene.flow, "datum", "crest")
    within: tuple[Any, ...] = (domain.left, domain.right)
    if scene.gdim == 3:
        within = within, domain.across
    if level == "effective" or (level == "auto" and starts_at_effective_height(scene)):
        return domain.bottom + effective_height(scene, speed).height
    if level in ("auto", "crest"):
        return float(bed.crest_level(*within))
    return float(bed.mean(*within)) if level == "mean" else domain.bottom + float(level)


def starts_at_effective_height(scene: SceneSections) -> bool:
    """Whether a stream of known shear at the bed goes over several forms in the plane that repeat. Not collective."""
    if (
        scene.gdim == 3
        or scene.bed_shape is None
        or not isinstance(scene.flow, Shear | Poiseuille | OpenChannel)
    ):
        return False
    period = scene.bed_shape.period
    return bool(period and scene.domain.length >= FEWEST_PERIODS * period)


def effective_height(scene: SceneSections, speed: float = 1.0) -> EffectiveHeight:
    """The effective height of a scene's bed in the plane, in its stream or one faster by a factor. Not collective."""
    from ..geometry.plane.effective_level import effective_level

    domain, bed = scene.domain, scene.bed_shape
    if not math.isfinite(bed.feature):
        return EffectiveHeight(0.0, 0.0, 0.0)
    level = effective_level(bed, domain.left, domain.right)
    depth = max(bed.crest - domain.bottom - level, 0.0)
    reynolds = _reynolds(scene, depth)
    lost = depth * (1.0 - (1.0 + speed * reynolds / INERTIAL) ** -POWER) if reynolds else 0.0
    return EffectiveHeight(level + lost, UNSURE * lost, level)


def _reynolds(scene: SceneSections, depth: float) -> float:
    """Of what the stream does between the forms: shear rate at the bed x period x depth over the viscosity."""
    period, flow = scene.bed_shape.period, scene.flow
    if period is None or not scene.fluid.inertia or scene.effects.inertia is False:
        return 0.0
    above = scene.domain.ceiling - scene.bed_shape.crest
    if isinstance(flow, Shear):
        rate = flow.rate
    elif isinstance(flow, Poiseuille | OpenChannel):
        rate = (6.0 if isinstance(flow, Poiseuille) else 3.0) * flow.velocity / above
    else:
        return 0.0
    return float(rate * period * depth / scene.viscosity)

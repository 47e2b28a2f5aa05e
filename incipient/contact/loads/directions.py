"""The safety factor over the direction of the flow: a bed is seldom as firm one way as another."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from incipient.arrays import Floats
from incipient.contact.exact.safety import SafetyFactor, safety_factor
from incipient.contact.model import Load
from incipient.errors import SceneError
from incipient.geometry.contacts import Contacts

SAMPLES = 36  # directions tried before the best is refined
RESOLUTION = 1e-5  # of the interval around the best, to which the best direction is found


@dataclass(frozen=True, eq=False)
class Directed:
    """The safety factor with the flow's load turned by `angle` radians about the axis."""

    angle: float
    load: Load
    safety: SafetyFactor

    @property
    def value(self) -> float:
        """The safety factor."""
        return self.safety.value


@dataclass(frozen=True, eq=False)
class SafetyOverDirection:
    """The directions of the flow that move the grain most easily and least easily."""

    smallest: Directed
    largest: Directed


def safety_over_direction(
    load: Load, contacts: Contacts, friction: float, axis: Floats | None = None
) -> SafetyOverDirection:
    """The smallest and the largest safety factor with the flow's force and couple turned about an axis.

    `axis` (3,): up, against the weight, if None. Cases with third components of zero know two directions, the
    given one and its mirror image. In space 36 directions are tried and the neighbourhood of the best and of
    the worst is searched by the method of Brent; an extreme that lies between two of them unnoticed is missed.

    Raises SceneError if there is neither weight nor axis, or the axis is zero.
    """
    about = -load.weight if axis is None else np.array(axis, dtype=float)
    length = float(np.linalg.norm(about))
    if about.shape != (3,) or not (np.isfinite(length) and length > 0.0):
        raise SceneError(
            "direction: no axis to turn the flow about; give three components, not all zero"
        )

    def at(angle: float) -> Directed:
        """The safety factor of the flow turned by an angle."""
        turned = _turned(load, about / length, angle)
        return Directed(angle, turned, safety_factor(turned, contacts, friction))

    if _in_the_plane(load, contacts, about):
        tried = [at(0.0), at(math.pi)]
        return SafetyOverDirection(min(tried, key=_share), max(tried, key=_share))
    return _searched(at)


def _searched(at: Callable[[float], Directed]) -> SafetyOverDirection:
    """The extremes over the full turn."""
    step = 2.0 * math.pi / SAMPLES
    tried = [at(k * step) for k in range(SAMPLES)]
    low, high = min(tried, key=_share), max(tried, key=_share)
    return SafetyOverDirection(
        min(low, _minimum(at, _share, low.angle - step, low.angle + step), key=_share),
        max(
            high,
            _minimum(at, lambda one: -_share(one), high.angle - step, high.angle + step),
            key=_share,
        ),
    )


def _minimum(
    at: Callable[[float], Directed], cost: Callable[[Directed], float], low: float, high: float
) -> Directed:
    """The least cost found in an interval, which is right if the cost falls and then rises in it."""
    from scipy.optimize import minimize_scalar  # which takes time to import

    width = {"xatol": RESOLUTION * (high - low)}
    found = minimize_scalar(
        lambda angle: cost(at(angle)), bounds=(low, high), method="bounded", options=width
    )
    return at(float(found.x))


def _share(directed: Directed) -> float:
    """A measure of safety that grows with it and is finite where the safety factor is not."""
    return directed.value / (1.0 + directed.value) if math.isfinite(directed.value) else 1.0


def _turned(load: Load, axis: Floats, angle: float) -> Load:
    """The load with the flow's force and couple turned about an axis of length one (Rodrigues)."""

    def turn(vector: Floats) -> Floats:
        """A vector (3,), turned."""
        along = vector @ axis * axis
        turned = (
            along + math.cos(angle) * (vector - along) + math.sin(angle) * np.cross(axis, vector)
        )
        return np.asarray(turned)

    return Load(turn(load.flow_force), turn(load.flow_couple), load.weight, load.centre)


def _in_the_plane(load: Load, contacts: Contacts, axis: Floats) -> bool:
    """Whether all third components are zero, and the couple is along the third axis: a case of the plane."""
    third = [contacts.points[:, 2], contacts.normals[:, 2], load.flow_couple[:2]]
    single = [load.flow_force[2], load.weight[2], load.centre[2], axis[2]]
    return not (any(part.any() for part in third) or any(single))

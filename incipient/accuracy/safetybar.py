"""What errors of force and couple mean for the verdict: the range of safety factors, and if one mode is certain."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..contact import Contacts, Load
from ..contact.exact import MassAndInertia, judged
from ..judgement import load_of, mass_and_inertia

if TYPE_CHECKING:
    from ..result import Couples, Forces
    from ..scene import Scene

Floats = NDArray[np.float64]
# Errors (6,) of force and couple by the name of what they come from.
Errors = Mapping[str, Floats]


@dataclass(frozen=True)
class SafetyBar:
    """The safety factor over all loads within the error bars, whether they all give one mode, and what to improve.

    decisive: the term without which the range of safety factors would shrink most
    unknown:  terms that should be there but could not be computed
    """

    value: float
    low: float
    high: float
    certain: bool
    modes: tuple[str, ...]
    decisive: str
    unknown: tuple[str, ...] = ()

    def sentence(self) -> str:
        """What the error bars mean for the verdict."""
        between = f"safety factor {self.value:.4g}, between {self.low:.4g} and {self.high:.4g}"
        if not self.certain:
            return f"NOT certain: {between}; to decide, reduce the error of the {self.decisive}"
        if self.unknown:
            return f"certain but for the error of the {' and '.join(self.unknown)}, which is not known: {between}"
        return f"certain within the error bars: {between}"


def bar_of_scene(
    scene: Scene, contacts: Contacts, force: Forces, couple: Couples, errors: Errors
) -> SafetyBar | None:
    """The bar of a scene's grain under the loads computed; None where there is nothing to judge. Not collective."""
    if scene.contact is None or scene.body is None or scene.mass is None:
        return None
    inert = mass_and_inertia(scene.body)
    return bar_of_safety(load_of(scene, force, couple), contacts, scene.contact.friction, inert, errors)


def bar_of_safety(
    load: Load, contacts: Contacts, friction: float, inert: MassAndInertia | None, errors: Errors
) -> SafetyBar:
    """The exact judge's answers at all corners of the error bars, and at the load itself. Not collective."""
    judge = _Judge(load, contacts, friction, inert)
    factors, modes = zip(*judge.answers(errors), strict=True)
    widths = {}
    for name in errors:
        others = {other: error for other, error in errors.items() if other != name}
        widths[name] = _width([factor for factor, _ in judge.answers(others)])
    return SafetyBar(
        value=factors[0],
        low=min(factors),
        high=max(factors),
        certain=len(set(modes)) == 1,
        modes=tuple(dict.fromkeys(modes)),
        decisive=min(widths, key=lambda name: widths[name], default=""),
    )


def shifted(load: Load, change: Floats) -> Load:
    """The load with force and couple of the flow changed, by (6,). Not collective."""
    return Load(load.flow_force + change[:3], load.flow_couple + change[3:], load.weight, load.centre)


@dataclass(frozen=True, eq=False)
class _Judge:
    """The exact judge of one grain."""

    load: Load
    contacts: Contacts
    friction: float
    inert: MassAndInertia | None

    def answers(self, errors: Errors) -> list[tuple[float, str]]:
        """Safety factors and modes: of the load itself, then of those at the corners of the errors' sum."""
        found = [
            judged(corner, self.contacts, self.friction, self.inert) for corner in _corners(self.load, errors)
        ]
        return [(one.safety.value, one.label) for one in found]


def _corners(load: Load, errors: Errors) -> Iterator[Load]:
    """The load itself and the loads at the corners of the errors' sum."""
    yield load
    together = sum(errors.values(), np.zeros(6))
    which = np.flatnonzero(together > 0.0)
    if len(which) == 0:
        return
    for signs in itertools.product((-1.0, 1.0), repeat=len(which)):
        change = np.zeros(6)
        change[which] = np.array(signs) * together[which]
        yield shifted(load, change)


def _width(factors: list[float]) -> float:
    """Of a range of safety factors, on the scale of 1/(1 + factor), where infinity is a number, too."""
    shares = [1.0 / (1.0 + factor) for factor in factors]
    return max(shares) - min(shares)

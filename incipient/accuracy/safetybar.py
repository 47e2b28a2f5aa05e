"""What errors of force and couple mean for the verdict: the range of safety factors, and what is certain within it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..contact import Contacts, Load
from ..contact.error_box import ErrorBox, Interval, SafetyRange, held_words, safety_range
from ..contact.exact import Exact, MassAndInertia, judged
from ..contact.planar_modes import modes_within
from ..results.verdict import load_of, mass_and_inertia

if TYPE_CHECKING:
    from ..results.result import Couples, Forces
    from ..scene import Scene

Floats = NDArray[np.float64]
# Errors (6,) of force and couple by the name of what they come from.
Errors = Mapping[str, Floats]


@dataclass(frozen=True)
class SafetyBar:
    """The safety factor over all loads within the error bars, what is certain of them, and what to improve.

    low, high: the smallest and the largest safety factor of a load within the bars
    certain:   whether it is proved that all of these loads are held, or that none is: rest, or motion
    modes:     what loads within the bars do, with `complete`; otherwise what those that were asked do
    complete:  whether it is proved that no load within the bars does anything else; one mode is then certain
    decisive:  the term without which the range of safety factors would shrink most
    some, every: the smallest and largest multiple of the flow's load with which some load within the bars is held,
               and with which all are; None where there is none
    unknown:   terms that should be there but could not be computed
    """

    value: float
    low: float
    high: float
    certain: bool
    modes: tuple[str, ...]
    complete: bool
    decisive: str
    some: Interval | None
    every: Interval | None
    unknown: tuple[str, ...] = ()

    @property
    def relative(self) -> float:
        """The width of the range over the safety factor, infinite where only one of its ends is.

        Where the weight alone is not held, so that all safety factors are zero: by how much the ends of `every` differ
        from those of `some`, relative.
        """
        if self.high > 0.0 or self.some is None:
            return _ratio(self.low, self.high, self.value)
        if self.every is None:
            return _ratio(*self.some, self.some[1])
        lower = _ratio(self.some[0], self.every[0], self.every[0])
        return lower + _ratio(self.every[1], self.some[1], self.some[1])

    def sentence(self) -> str:
        """What the error bars mean for the verdict."""
        between = f"safety factor {self.value:.4g}, between {self.low:.4g} and {self.high:.4g}"
        if self.high == 0.0:
            between = f"safety factor 0, {held_words(self.some, self.every)}"
        if not self.certain:
            return f"NOT certain: {between}; to decide, reduce the error of the {self.decisive}"
        if self.unknown:
            names = " and ".join(self.unknown)
            return (
                f"certain but for the error of the {names}, which is not known: {self._outcome()}; {between}"
            )
        return f"certain within the error bars: {self._outcome()}; {between}"

    def _outcome(self) -> str:
        """Rest or motion, and the mode where that is proved as well."""
        if self.modes == ("rest",):
            return "it rests"
        modes = [mode for mode in self.modes if mode != "moves"]
        if not modes:
            return "it moves"
        if not self.complete:
            return f"it moves, but how ({' or '.join(modes)}) is not certain"
        return f"it moves ({modes[0]})" if len(modes) == 1 else f"it moves, by {' or '.join(modes)}"


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
    """What is proved of all loads within the sum of the errors, by `safety_range`. Not collective."""

    def within(names: set[str]) -> tuple[ErrorBox, SafetyRange]:
        """The box of the terms named, and what the loads in it have in common."""
        box = ErrorBox.of(sum((errors[name] for name in sorted(names)), np.zeros(6)))
        return box, safety_range(load, contacts, friction, box)

    box, found = within(set(errors))
    widths = {name: within(set(errors) - {name})[1].width for name in errors}
    exact = judged(load, contacts, friction, inert)
    modes, complete = _modes(_Case(load, contacts, friction, inert), box, found, exact)
    value = exact.safety.value
    return SafetyBar(
        value=value,
        low=min(found.low, value),
        high=max(found.high, value),
        certain=found.rests or found.moves,
        modes=modes,
        complete=complete,
        decisive=min(widths, key=lambda name: widths[name], default=""),
        some=found.some,
        every=found.every,
    )


@dataclass(frozen=True, eq=False)
class _Case:
    """What the exact judge is asked about."""

    load: Load
    contacts: Contacts
    friction: float
    inert: MassAndInertia | None


def _modes(case: _Case, box: ErrorBox, found: SafetyRange, exact: Exact) -> tuple[tuple[str, ...], bool]:
    """What loads of the box do, and whether that is all they can do."""
    if found.rests:
        return ("rest",), True
    if found.moves and case.inert is not None:
        proved = modes_within(case.load, case.contacts, case.friction, box.ways, *case.inert)
        if proved:
            return tuple(mode.label for mode in proved), True
    worst = judged(found.worst, case.contacts, case.friction, case.inert)
    labels = [exact.label, worst.label] + ([] if found.moves else ["rest"])
    return tuple(dict.fromkeys(labels)), False


def _ratio(low: float, high: float, scale: float) -> float:
    """(high - low) / scale, with zero for equal ends and infinity where only one end is infinite."""
    if low >= high:
        return 0.0
    return math.inf if math.isinf(high) or scale == 0.0 else (high - low) / scale

"""The range of safety factors over all loads within the error bars, and what is certain of them, as data."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..contact.robustness import Interval


@dataclass(frozen=True)
class SafetyBar:
    """The safety factor over all loads within the error bars, what is certain of them, and what to improve."""

    value: float
    # low, high: the smallest and the largest safety factor of a load within the bars
    low: float
    high: float
    # Whether it is proved that all of these loads are held, or that none is: rest, or motion; with wall layers only
    # where the law of the wall holds
    certain: bool
    # What loads within the bars do, with `complete`; otherwise what those that were asked do
    modes: tuple[str, ...]
    # Whether it is proved that no load within the bars does anything else; one mode is then certain
    complete: bool
    decisive: str  # the term without which the range of safety factors would shrink most
    # some, every: the smallest and largest multiple of the flow's load with which some load within the bars is held,
    # and with which all are; None where there is none
    some: Interval | None
    every: Interval | None
    # Terms that should be there but could not be computed, and the model of the mean flow
    unknown: tuple[str, ...] = ()
    # How much the load of the flow may change, relative, as the grain rocks: low and high are about so far away, and
    # nothing is proved. None: the grain does not rock
    frozen: float | None = None

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

    def to_dict(self) -> dict[str, Any]:
        """Plain data for result.json."""
        return asdict(self) | {"sentence": self.sentence()}

    def sentence(self) -> str:
        """What the error bars mean for the verdict."""
        between = f"safety factor {self.value:.4g}, between {self.low:.4g} and {self.high:.4g}"
        if self.high == 0.0:
            from ..contact.robustness import held_words

            between = f"safety factor 0, {held_words(self.some, self.every)}"
        if self.frozen is not None:
            between = f"safety factor {self.value:.4g}, about {self.low:.4g} to {self.high:.4g}"
            said = "likely, but not proved" if self.low > 1.0 or self.high < 1.0 else "NOT certain"
            return f"{said}: {between}, the flow's load being that in the first pose, off by about {self.frozen:.0%}"
        if not self.certain:
            return f"NOT certain: {between}; to decide, reduce the error of the {self.decisive}"
        if self.unknown:
            names = " and ".join(self.unknown)
            return f"certain but for the error of the {names}, which is not known: {self._outcome()}; {between}"
        return f"certain within the error bars: {self._outcome()}; {between}"

    def _outcome(self) -> str:
        """Rest or motion, and the mode where that is proved as well."""
        if self.modes == ("rest",):
            return "it rests"
        modes = [mode for mode in self.modes if mode != "moves"]
        if not modes:
            return "it moves"
        if not self.complete:
            return f"it moves ({' or '.join(modes)}, at this load and at the worst within the bars)"
        return f"it moves ({modes[0]})" if len(modes) == 1 else f"it moves, by {' or '.join(modes)}"


def _ratio(low: float, high: float, scale: float) -> float:
    """(high - low) / scale, with zero for equal ends and infinity where only one end is infinite."""
    if low >= high:
        return 0.0
    return math.inf if math.isinf(high) or scale == 0.0 else (high - low) / scale

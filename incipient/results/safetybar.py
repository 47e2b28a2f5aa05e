"""The range of safety factors over all loads within the error bars, and its certainty, as data."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..contact.robustness import Interval


@dataclass(frozen=True)
class SafetyBar:
    """The safety factor over all loads within the error bars, its certainty, and the decisive error."""

    value: float
    # low, high: smallest and largest safety factor of a load within the bars
    low: float
    high: float
    # Whether rest under all of these loads, or motion under all, is proved; with wall layers only within the range of
    # the law of the wall
    certain: bool
    # Modes of the loads within the bars if `complete`, otherwise of the loads examined
    modes: tuple[str, ...]
    # Whether other modes within the bars are excluded; a single mode is then certain
    complete: bool
    decisive: str  # the term whose removal shrinks the range of safety factors most
    # some, every: smallest and largest multiple of the flow's load that the contacts balance for some load within the
    # bars, and for all of them; None without one
    some: Interval | None
    every: Interval | None
    # Terms whose estimate failed, and the model of the mean flow
    unknown: tuple[str, ...] = ()
    # Relative change of the load of the flow as the grain rocks, which sets low and high; nothing is then proved.
    # None: the grain does not rock
    frozen: float | None = None

    @property
    def relative(self) -> float:
        """The width of the range over the safety factor, infinite for one infinite end.

        If the contacts do not balance the weight alone, and all safety factors are zero: the relative difference
        between the ends of `every` and `some`.
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
        """The consequence of the error bars for the verdict, as a sentence."""
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
        """Rest or motion, and the mode if proved."""
        if self.modes == ("rest",):
            return "it rests"
        modes = [mode for mode in self.modes if mode != "moves"]
        if not modes:
            return "it moves"
        if not self.complete:
            return f"it moves ({' or '.join(modes)}, at this load and at the worst within the bars)"
        return f"it moves ({modes[0]})" if len(modes) == 1 else f"it moves, by {' or '.join(modes)}"


def _ratio(low: float, high: float, scale: float) -> float:
    """(high - low) / scale; zero for equal ends, infinite for one infinite end."""
    if low >= high:
        return 0.0
    return math.inf if math.isinf(high) or scale == 0.0 else (high - low) / scale

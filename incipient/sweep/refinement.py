"""Cases that a sweep adds between those given: where the mode changes along a key, and where a quantity bends.

One key, or several that vary together, is refined; the values of the others make families. An interval is halved

- where the modes of its ends differ, until it is no longer than the tolerance;
- where the quantity is not straight: of three neighbours of one mode, f[a, b, c] h^2/4 estimates how far f is from the
  straight line on an interval of length h (f[a, b, c]: second divided difference).

Lengths are fractions of the range of the key, misses fractions of the range of the quantity. All cases of a round are
known before the next one is chosen, so that a sweep that was killed resumes with the same cases.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from ..arrays import Floats
from ..errors import SceneError
from .axes import Settings, VariedKey, rounded
from .cases import Source, SweepCase

Resolve = Callable[[Source, Settings], SweepCase]

LEAST, USUAL, MOST = 1e-6, 0.02, 1000
_ROUND_OFF = 1e-9  # by which an interval may be longer than the tolerance
_CONSTANT = 1e-6  # of the largest value: a quantity with a smaller range is straight
# What is to be straight; otherwise the safety factor.
_USUAL = {"threshold": "shields", "gust": "strength", "entrainment": "probability"}


@dataclass(frozen=True)
class Aim:
    """Aim of a refinement: the tolerance, the number of cases in all, and the column that is to be straight."""

    tolerance: float = USUAL
    most: int = MOST
    quantity: str | None = None

    def __post_init__(self) -> None:
        if not LEAST <= self.tolerance <= 1.0:
            remedy = f"give a number from {LEAST:g} to 1"
            raise SceneError(
                f"--refine {self.tolerance:g}: is not a fraction of the range; {remedy}"
            )
        if self.most < 1:
            raise SceneError(f"--most {self.most}: is not a number of cases; give 1 or more")

    def of_case(self, task: str, columns: Mapping[str, Any]) -> tuple[str, float | None]:
        """Mode, and quantity where it is finite, of a case."""
        name = self.quantity or _USUAL.get(task, "safety_factor")
        value, mode = columns.get(name), str(columns.get("mode", "no verdict"))
        if not isinstance(value, int | float):
            return mode, None
        if name == "safety_factor":  # from 0 to 1, and straight where the flow is weak
            return mode, 1.0 if math.isinf(value) else value / (1.0 + value)
        return (mode, float(value)) if math.isfinite(value) else (f"{mode}, without bound", None)


class Direction:
    """Keys that are refined together: positions 0, 1, 2 ... are the values given, between them it interpolates.

    Between two values of a key are equal ratios or equal differences, whichever the values given are nearer to.
    """

    def __init__(self, axes: Sequence[VariedKey]):
        self.keys = [axis.key for axis in axes]
        tables = [_numbers(axis) for axis in axes]
        self._texts, self._values = zip(*tables, strict=True)
        self._logarithmic = [_has_equal_ratios(values) for values in self._values]
        first = np.log(self._values[0]) if self._logarithmic[0] else self._values[0]
        is_single = len(axes) == 1 and first.shape[1] == 1
        scale = first[:, 0] if is_single else np.arange(float(len(first)))
        self._along = (scale - scale[0]) / (scale[-1] - scale[0])

    def __len__(self) -> int:
        return len(self._along)

    def at(self, position: float) -> float:
        """Distance of a position from the first value, as a fraction of the range."""
        return float(np.interp(position, np.arange(len(self)), self._along))

    def settings(self, position: float) -> Settings:
        """The overrides at a position."""
        return tuple(f"{key}={self._text(n, position)}" for n, key in enumerate(self.keys))

    def _text(self, key: int, position: float) -> str:
        number = int(position)
        if number == position:
            return self._texts[key][number]
        values = self._values[key][number : number + 2]
        scaled = np.log(values) if self._logarithmic[key] else values
        between = scaled[0] + (position - number) * (scaled[1] - scaled[0])
        parts = [rounded(x) for x in (np.exp(between) if self._logarithmic[key] else between)]
        return f"[{', '.join(parts)}]" if self._texts[key][0].startswith("[") else parts[0]


def direction(axes: Sequence[VariedKey], together: bool) -> tuple[Direction, list[VariedKey]]:
    """The first key with distinct numbers, or all keys that vary together, and the other keys. Raises SceneError."""
    if together and len(axes) > 1:
        for axis in axes:
            if not _is_numeric(axis):
                why = "is varied with other keys and takes no distinct numbers"
                raise SceneError(f"--refine: {axis.key} {why}; give it by --cases")
        return Direction(axes), []
    first = next((axis for axis in axes if _is_numeric(axis)), None)
    if first is None:
        raise SceneError("--refine: no key is varied over numbers; give --over KEY=FIRST,LAST")
    values = {_parsed(text): text for text in reversed(first.values)}
    texts = [values[value] for value in sorted(values, key=lambda value: value or ())]
    is_list = first.values[0].startswith("[")
    ordered = list(dict.fromkeys(values[_parsed(text)] for text in first.values))
    sorted_axis = VariedKey(first.key, tuple(ordered if is_list else texts))
    return Direction([sorted_axis]), [axis for axis in axes if axis is not first]


@dataclass(eq=False)
class Family:
    """Cases that differ along the direction only: by position, None where the scene is refused, and what is known."""

    source: Source
    fixed: Settings
    along: Direction
    cases: dict[float, SweepCase | None] = field(default_factory=dict)
    known: dict[float, tuple[str, float | None]] = field(default_factory=dict)

    def intervals(self) -> Iterator[tuple[float, float]]:
        """Neighbouring positions between which both results are known."""
        for low, high in pairwise(sorted(self.cases)):
            if low in self.known and high in self.known:
                yield low, high

    def length(self, low: float, high: float) -> float:
        """Length of an interval as a fraction of the range."""
        return self.along.at(high) - self.along.at(low)

    def changes(self, low: float, high: float) -> bool:
        """Whether the mode changes in an interval."""
        return self.known[low][0] != self.known[high][0]

    def bend(self, low: float, high: float) -> float:
        """Largest miss of the straight line on an interval; infinite where two neighbours alone are known."""
        if self.known[low][1] is None or self.known[high][1] is None:
            return 0.0
        line = [place for place in sorted(self.cases) if place in self.known]
        first = line.index(low)
        triples = [line[n : n + 3] for n in (first - 1, first) if 0 <= n < len(line) - 2]
        misses = [
            abs(curvature) * self.length(low, high) ** 2 / 4.0
            for triple in triples
            if (curvature := self._second_difference(triple)) is not None
        ]
        return max(misses, default=math.inf)

    def _second_difference(self, triple: Sequence[float]) -> float | None:
        (one, f), (two, g), (three, h) = (self.known[place] for place in triple)
        if len({one, two, three}) > 1 or f is None or g is None or h is None:
            return None
        a, b, c = map(self.along.at, triple)
        return ((h - g) / (c - b) - (g - f) / (b - a)) / (c - a)


class SweepRefinement:
    """The refinement of a sweep's families.

    `resolve` gives the case that settings make of a source; it raises SceneError.
    """

    def __init__(
        self, families: Sequence[Family], aim: Aim, resolve: Resolve, cases: Iterable[SweepCase]
    ):
        self._families, self.aim, self._resolve = families, aim, resolve
        self._identities = {case.identity for case in cases}
        self._refused: list[str] = []
        self._is_spent = False
        for family in families:
            for position in range(len(family.along)):
                self._put(family, float(position))

    def identities(self) -> list[str]:
        """The identities of all cases so far."""
        return list(self._identities)

    def following(self, results: Mapping[str, Mapping[str, Any]]) -> list[SweepCase]:
        """The next cases, by the columns of those that are done; none where the aim or the budget is reached.

        Raises SceneError: no case has the quantity.
        """
        self._require_quantity(results)
        for family in self._families:
            for position, case in family.cases.items():
                if case is not None and case.identity in results:
                    family.known[position] = self.aim.of_case(case.task, results[case.identity])
        new: list[SweepCase] = []
        while not new and (wanted := self._wanted()):
            for _, number, position in wanted:
                if len(self._identities) >= self.aim.most:
                    self._is_spent = True
                    return new
                case = self._put(self._families[number], position)
                new += [] if case is None else [case]
        return new

    def _put(self, family: Family, position: float) -> SweepCase | None:
        """Take a position into a family; its case if that is a new one."""
        settings = (*family.fixed, *family.along.settings(position))
        try:
            case = self._resolve(family.source, settings)
        except SceneError as error:
            self._refused.append(f"{', '.join(settings)}: {error}")
            family.cases[position] = None
            return None
        family.cases[position] = case
        is_new = case.identity not in self._identities
        self._identities.add(case.identity)
        return case if is_new else None

    def _require_quantity(self, results: Mapping[str, Mapping[str, Any]]) -> None:
        names = list(dict.fromkeys(name for columns in results.values() for name in columns))
        task = next((c.task for f in self._families for c in f.cases.values() if c), "run")
        quantity = self.aim.quantity or _USUAL.get(task, "safety_factor")
        known = {quantity} if self.aim.quantity else {quantity, "mode"}
        if results and not known & set(names):
            which = f"--quantity {quantity}: no case has this column"
            if not self.aim.quantity:
                which = f"no case has a mode or {quantity}; give --quantity"
            raise SceneError(f"{which}, available: {', '.join(names)}")

    def _wanted(self) -> list[tuple[tuple[bool, float], int, float]]:
        """Urgency, family and position of the cases that the aim still needs: modes first, then the largest bend."""
        values = [
            value
            for family in self._families
            for _, value in family.known.values()
            if value is not None
        ] or [0.0]
        span = max(max(values) - min(values), _CONSTANT * max(map(abs, values)))
        wanted = []
        for number, family in enumerate(self._families):
            for low, high in family.intervals():
                length = family.length(low, high)
                if length <= self.aim.tolerance * (1.0 + _ROUND_OFF):
                    continue
                changes, bend = family.changes(low, high), family.bend(low, high)
                if changes or bend > self.aim.tolerance * span:
                    urgency = (not changes, -(length if changes else bend))
                    wanted.append((urgency, number, 0.5 * (low + high)))
        return sorted(wanted)

    def lines(self) -> list[str]:
        """Lines for a reader on the intervals in which the mode changes, and on what was not computed."""
        found = [
            (family, low, high)
            for family in self._families
            for low, high in family.intervals()
            if family.changes(low, high)
        ]
        worst = max((family.length(low, high) for family, low, high in found), default=0.0)
        within = f"to {worst:.2g} of the range, in {len(found)} intervals" if found else "none"
        lines = [f"{'changes of mode':<20}{within}"]
        for family, low, high in found:
            ends = [
                f"{family.known[end][0]} at {', '.join(family.along.settings(end))}"
                for end in (low, high)
            ]
            fixed = f" ({', '.join(family.fixed)})" if family.fixed else ""
            lines.append(f"  {ends[0]}, {ends[1]}{fixed}")
        if self._is_spent:
            why = f"{self.aim.most} cases are spent before the tolerance is reached"
            lines.append(f"{'':<20}{why}; raise --most")
        if self._refused:
            count = f"{len(self._refused)} cases between; the first: {self._refused[0]}"
            lines.append(f"{'left out':<20}{count}")
        return lines


def _parsed(text: str) -> tuple[float, ...] | None:
    """A number or a list of numbers; None if it is neither."""
    try:
        value = tomllib.loads(f"value = {text}")["value"]
        parts = np.array(value if isinstance(value, list) and value else [value])
    except (ValueError, RecursionError):
        return None
    is_number = parts.dtype.kind in "if" and parts.ndim == 1 and bool(np.isfinite(parts).all())
    return tuple(parts.astype(float).tolist()) if is_number else None


def _is_numeric(axis: VariedKey) -> bool:
    """Whether values are numbers, or lists of as many numbers each, that are not all the same."""
    values = [_parsed(text) for text in axis.values]
    return None not in values and len({len(v or ()) for v in values}) == 1 and len(set(values)) > 1


def _numbers(axis: VariedKey) -> tuple[tuple[str, ...], Floats]:
    return axis.values, np.array([_parsed(text) for text in axis.values], dtype=float)


def _has_equal_ratios(values: Floats) -> bool:
    """Whether single numbers are nearer to equal ratios than to equal differences; two, if a decade apart."""
    if values.shape[1] > 1 or values.min() <= 0.0:
        return False
    if len(values) == 2:
        return bool(values.max() >= 10.0 * values.min())
    uneven = []
    for scaled in (values[:, 0], np.log(values[:, 0])):
        gaps = np.abs(np.diff(scaled))
        uneven.append(gaps.max() / gaps.min() if gaps.min() > 0.0 else np.inf)
    return bool(uneven[1] < uneven[0])

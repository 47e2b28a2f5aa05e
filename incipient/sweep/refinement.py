"""Cases that a sweep adds: where the mode changes along a key, and where a quantity bends.

One key is refined; the others make families. An interval of length h is halved while longer than the tolerance if the
modes of its ends differ, or f[a, b, c] h^2/4, the estimated deviation from a line, is too large (f[a, b, c]: second
divided difference of three neighbours of one mode). Lengths and deviations are fractions of the ranges. A round is
complete before the next one begins, so that a killed sweep resumes with the same cases.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from ..arrays import Floats, decimal
from ..errors import SceneError, refuse_broken
from .cases import Axes, Settings, Source, SweepCase, rounded

Columns = Mapping[str, Any]
Resolve = Callable[[Source, Settings], SweepCase]

LEAST, USUAL, MOST = 1e-6, 0.02, 1000
_ROUND_OFF = 1e-9  # by which an interval may be longer than the tolerance
_CONSTANT = 1e-6  # of the largest value: a quantity with a smaller range is straight
# Columns that are straight after a refinement unless it names another.
QUANTITIES = {"threshold": "shields", "gust": "strength", "entrainment": "probability"}


@dataclass(frozen=True)
class Aim:
    """Aim of a refinement: the column, the tolerance, and the number of cases in all."""

    quantity: str
    tolerance: float = USUAL
    most: int = MOST

    def __post_init__(self) -> None:
        refuse_broken(
            (
                not LEAST <= self.tolerance <= 1.0,
                f"--refine {self.tolerance:g}: is not a fraction of the range; give a number from {LEAST:g} to 1",
            ),
            (
                self.most < 1,
                f"--most {self.most}: is not a number of cases; give 1 or more",
            ),
        )

    def of_case(self, columns: Columns) -> tuple[str, float | None]:
        value, mode = columns.get(self.quantity), str(columns.get("mode", "no verdict"))
        if not isinstance(value, int | float):
            return mode, None
        if self.quantity == "safety_factor":  # from 0 to 1, and straight where the flow is weak
            return mode, 1.0 if math.isinf(value) else value / (1.0 + value)
        return (mode, float(value)) if math.isfinite(value) else (f"{mode}, without bound", None)


@dataclass(frozen=True, eq=False)
class RefinedKey:
    """The refined key, with its values as text by position from 0 to 1, and the numbers at both ends.

    Between them are equal ratios where the values have equal ratios, otherwise equal differences.
    """

    key: str
    texts: Mapping[float, str]
    ends: tuple[float, float]
    is_logarithmic: bool

    @classmethod
    def of(cls, key: str, texts: Iterable[str]) -> RefinedKey | None:
        """None if the values are not numbers, or all are equal."""
        numbers = _numbers(texts)
        if len(numbers) < 2:
            return None
        values = np.array(list(numbers))
        is_logarithmic = _has_equal_ratios(values)
        scaled = np.log(values) if is_logarithmic else values
        positions = ((scaled - scaled[0]) / (scaled[-1] - scaled[0])).tolist()
        by_position = dict(zip(positions, numbers.values(), strict=True))
        return cls(key, by_position, (scaled[0], scaled[-1]), is_logarithmic)

    def setting(self, position: float) -> str:
        first, last = self.ends
        between = first + position * (last - first)
        number = math.exp(between) if self.is_logarithmic else between
        return f"{self.key}={self.texts.get(position) or rounded(number)}"


def refined_key(axes: Axes) -> tuple[RefinedKey, Axes]:
    """The first key with distinct numbers, and the other keys. Raises SceneError without one."""
    for key, values in axes.items():
        if refined := RefinedKey.of(key, values):
            return refined, {name: texts for name, texts in axes.items() if name != key}
    raise SceneError("--refine: no key is varied over numbers; give --over KEY=FIRST,LAST")


@dataclass(eq=False)
class Family:
    """Cases that differ in the refined key only.

    cases: by position, None for a refused scene; known: mode and quantity of finished cases
    """

    source: Source
    fixed: Settings
    cases: dict[float, SweepCase | None] = field(default_factory=dict)
    known: dict[float, tuple[str, float | None]] = field(default_factory=dict)

    def changes(self) -> list[tuple[float, float]]:
        return [
            (low, high)
            for low, high in pairwise(sorted(self.known))
            if self.known[low][0] != self.known[high][0]
        ]

    def wanted(self, tolerance: float, span: float) -> Iterator[tuple[tuple[int, float], float]]:
        """Urgency and position of the cases that the tolerance needs: modes first, then the largest bend."""
        positions, changes = sorted(self.known), self.changes()
        bends = [self._curvature(positions[n : n + 3]) for n in range(len(positions) - 2)]
        for n, (low, high) in enumerate(pairwise(positions)):
            length, middle = high - low, 0.5 * (low + high)
            if length <= tolerance * (1.0 + _ROUND_OFF) or middle in self.cases:
                continue
            if (low, high) in changes:
                yield (0, -length), middle
            elif None not in (self.known[low][1], self.known[high][1]):
                near = [bend for bend in bends[max(n - 1, 0) : n + 1] if bend is not None]
                miss = max(near, default=math.inf) * length**2 / 4.0
                if miss > tolerance * span:
                    yield (1, -miss), middle

    def _curvature(self, three: Sequence[float]) -> float | None:
        a, b, c = three
        (first, f), (second, g), (last, h) = (self.known[position] for position in three)
        if len({first, second, last}) > 1 or f is None or g is None or h is None:
            return None
        return abs(((h - g) / (c - b) - (g - f) / (b - a)) / (c - a))


@dataclass(eq=False)
class SweepRefinement:
    """The refinement of a sweep's families along a key.

    resolve: makes the case of a source with settings; raises SceneError
    identities: of all cases
    """

    along: RefinedKey
    families: Sequence[Family]
    aim: Aim
    resolve: Resolve
    identities: set[str]
    refused: list[str] = field(default_factory=list, init=False)
    is_spent: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        for family in self.families:
            for position in self.along.texts:
                self._put(family, position)

    def following(self, results: Mapping[str, Columns]) -> list[SweepCase]:
        """The next cases, from the columns of finished ones; none if the aim or the budget is reached.

        Raises SceneError if no case has the quantity.
        """
        names = list(dict.fromkeys(name for columns in results.values() for name in columns))
        if results and self.aim.quantity not in names:
            why = f"no case has this column; available: {', '.join(names) or 'none'}"
            raise SceneError(f"--quantity {self.aim.quantity}: {why}")
        for family in self.families:
            for position, case in family.cases.items():
                if case is not None and case.identity in results:
                    family.known[position] = self.aim.of_case(results[case.identity])
        new: list[SweepCase] = []
        while not new and (wanted := self._wanted()):
            for _, number, position in wanted:
                if len(self.identities) >= self.aim.most:
                    self.is_spent = True
                    return new
                new += self._put(self.families[number], position)
        return new

    def _put(self, family: Family, position: float) -> list[SweepCase]:
        settings = (*family.fixed, self.along.setting(position))
        family.cases[position] = None
        try:
            case = self.resolve(family.source, settings)
        except SceneError as error:
            self.refused.append(f"{', '.join(settings)}: {error}")
            return []
        family.cases[position] = case
        new = [] if case.identity in self.identities else [case]
        self.identities.add(case.identity)
        return new

    def _wanted(self) -> list[tuple[tuple[int, float], int, float]]:
        known = (value for family in self.families for _, value in family.known.values())
        values = [value for value in known if value is not None] or [0.0]
        span = max(max(values) - min(values), _CONSTANT * max(map(abs, values)))
        return sorted(
            (urgency, number, position)
            for number, family in enumerate(self.families)
            for urgency, position in family.wanted(self.aim.tolerance, span)
        )

    def lines(self) -> list[str]:
        changes = [(family, ends) for family in self.families for ends in family.changes()]
        worst = max((ends[1] - ends[0] for family, ends in changes), default=0.0)
        within = f"to {worst:.2g} of the range, in {len(changes)} intervals" if changes else "none"
        lines = [f"{'changes of mode':<20}{within}"]
        for family, ends in changes:
            fixed = f" ({', '.join(family.fixed)})" if family.fixed else ""
            sides = (f"{family.known[x][0]} at {self.along.setting(x)}" for x in ends)
            lines.append(f"  {', '.join(sides)}{fixed}")
        if self.is_spent:
            why = f"{self.aim.most} cases are spent before the tolerance is reached"
            lines.append(f"{'':<20}{why}; raise --most")
        if self.refused:
            count = f"{len(self.refused)} cases between; the first: {self.refused[0]}"
            lines.append(f"{'left out':<20}{count}")
        return lines


def _numbers(texts: Iterable[str]) -> dict[float, str]:
    """Distinct finite numbers, ascending, with their texts; none if one of them is not a finite number."""
    numbers: dict[float, str] = {}
    for text in texts:
        try:
            numbers.setdefault(decimal(text), text)
        except ValueError:
            return {}
    return dict(sorted(numbers.items())) if all(map(math.isfinite, numbers)) else {}


def _has_equal_ratios(values: Floats) -> bool:
    if values[0] <= 0.0:
        return False
    if len(values) == 2:
        return bool(values[1] >= 10.0 * values[0])
    differences, ratios = np.diff(values), np.diff(np.log(values))
    return bool(np.ptp(ratios) / ratios.max() < np.ptp(differences) / differences.max())

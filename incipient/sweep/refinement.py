"""Cases that a sweep adds: where the mode changes along a key, and where a quantity bends.

One key, or several that vary together, is refined; the others make families. An interval of length h is halved while
longer than the tolerance if the modes of its ends differ, or f[a, b, c] h^2/4, the estimated deviation from a line, is
too large (f[a, b, c]: second divided difference of three neighbours of one mode). Lengths and deviations are fractions
of the ranges. A round is complete before the next one begins, so that a killed sweep resumes with the same cases.
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
        if not LEAST <= self.tolerance <= 1.0:
            why = f"is not a fraction of the range; give a number from {LEAST:g} to 1"
            raise SceneError(f"--refine {self.tolerance:g}: {why}")
        if self.most < 1:
            raise SceneError(f"--most {self.most}: is not a number of cases; give 1 or more")

    def of_case(self, columns: Columns) -> tuple[str, float | None]:
        value, mode = columns.get(self.quantity), str(columns.get("mode", "no verdict"))
        if not isinstance(value, int | float):
            return mode, None
        if self.quantity == "safety_factor":  # from 0 to 1, and straight where the flow is weak
            return mode, 1.0 if math.isinf(value) else value / (1.0 + value)
        return (mode, float(value)) if math.isfinite(value) else (f"{mode}, without bound", None)


class _Numbers:
    def __init__(self, axis: VariedKey, numbers: Mapping[tuple[float, ...], str]):
        self.key, self.texts, values = axis.key, list(numbers.values()), np.array(list(numbers))
        self.is_single = values.shape[1] == 1
        self.is_logarithmic = self.is_single and _has_equal_ratios(values[:, 0])
        self.scaled = np.log(values) if self.is_logarithmic else values

    def setting(self, position: float) -> str:
        if position == int(position):
            return f"{self.key}={self.texts[int(position)]}"
        places = np.arange(len(self.texts))
        between = np.array([np.interp(position, places, column) for column in self.scaled.T])
        parts = [rounded(x) for x in (np.exp(between) if self.is_logarithmic else between)]
        return f"{self.key}={parts[0] if self.is_single else '[' + ', '.join(parts) + ']'}"


@dataclass(frozen=True, eq=False)
class Direction:
    """Keys refined together; `along` (n,): positions of the given numbers, from 0 to 1."""

    keys: Sequence[_Numbers]
    along: Floats

    def at(self, position: float) -> float:
        return float(np.interp(position, np.arange(len(self.along)), self.along))

    def settings(self, position: float) -> Settings:
        return tuple(key.setting(position) for key in self.keys)


def direction(axes: Sequence[VariedKey], together: bool) -> tuple[Direction, list[VariedKey]]:
    """The first key with distinct numbers, or all keys that vary together, and the other keys. Raises SceneError."""
    numbers = {axis: _numbers(axis) for axis in axes}
    if together and len(axes) > 1:
        for axis in axes:
            if len(numbers[axis]) < len(axis.values):
                why = "is varied with other keys and takes no distinct numbers"
                raise SceneError(f"--refine: {axis.key} {why}; give it by --cases")
        keys = [_Numbers(axis, numbers[axis]) for axis in axes]
        return Direction(keys, np.linspace(0.0, 1.0, len(axes[0].values))), []
    first = next((axis for axis in axes if len(numbers[axis]) > 1), None)
    if first is None:
        raise SceneError("--refine: no key is varied over numbers; give --over KEY=FIRST,LAST")
    key = _Numbers(first, numbers[first])
    if key.is_single:
        key = _Numbers(first, dict(sorted(numbers[first].items())))
    scale = key.scaled[:, 0] if key.is_single else np.arange(float(len(key.texts)))
    others = [axis for axis in axes if axis is not first]
    return Direction([key], (scale - scale[0]) / (scale[-1] - scale[0])), others


@dataclass(eq=False)
class Family:
    """Cases that differ along the direction only.

    cases: by position, None for a refused scene; known: mode and quantity of finished cases
    """

    source: Source
    fixed: Settings
    along: Direction
    cases: dict[float, SweepCase | None] = field(default_factory=dict)
    known: dict[float, tuple[str, float | None]] = field(default_factory=dict)

    def changes(self) -> list[tuple[float, float]]:
        return [
            (low, high)
            for low, high in pairwise(sorted(self.known))
            if self.known[low][0] != self.known[high][0]
        ]

    def length(self, low: float, high: float) -> float:
        return self.along.at(high) - self.along.at(low)

    def wanted(self, tolerance: float, span: float) -> Iterator[tuple[tuple[int, float], float]]:
        """Urgency and position of the cases that the tolerance needs: modes first, then the largest bend."""
        positions, changes = sorted(self.known), self.changes()
        bends = [self._curvature(positions[n : n + 3]) for n in range(len(positions) - 2)]
        for n, (low, high) in enumerate(pairwise(positions)):
            length, middle = self.length(low, high), 0.5 * (low + high)
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
        (first, f), (second, g), (last, h) = (self.known[position] for position in three)
        if len({first, second, last}) > 1 or f is None or g is None or h is None:
            return None
        a, b, c = map(self.along.at, three)
        return abs(((h - g) / (c - b) - (g - f) / (b - a)) / (c - a))


class SweepRefinement:
    """The refinement of a sweep's families, between `cases`.

    resolve: makes the case of a source with settings; raises SceneError
    """

    def __init__(
        self, families: Sequence[Family], aim: Aim, resolve: Resolve, cases: Iterable[SweepCase]
    ):
        self._families, self._aim, self._resolve = families, aim, resolve
        self.identities = {case.identity for case in cases}
        self._refused: list[str] = []
        self._is_spent = False
        for family in families:
            for position in range(len(family.along.along)):
                self._put(family, float(position))

    def following(self, results: Mapping[str, Columns]) -> list[SweepCase]:
        """The next cases, from the columns of finished ones; none if the aim or the budget is reached.

        Raises SceneError if no case has the quantity.
        """
        names = list(dict.fromkeys(name for columns in results.values() for name in columns))
        if results and self._aim.quantity not in names:
            why = f"no case has this column; available: {', '.join(names) or 'none'}"
            raise SceneError(f"--quantity {self._aim.quantity}: {why}")
        for family in self._families:
            for position, case in family.cases.items():
                if case is not None and case.identity in results:
                    family.known[position] = self._aim.of_case(results[case.identity])
        new: list[SweepCase] = []
        while not new and (wanted := self._wanted()):
            for _, number, position in wanted:
                if len(self.identities) >= self._aim.most:
                    self._is_spent = True
                    return new
                new += self._put(self._families[number], position)
        return new

    def _put(self, family: Family, position: float) -> list[SweepCase]:
        settings = (*family.fixed, *family.along.settings(position))
        family.cases[position] = None
        try:
            case = self._resolve(family.source, settings)
        except SceneError as error:
            self._refused.append(f"{', '.join(settings)}: {error}")
            return []
        family.cases[position] = case
        new = [] if case.identity in self.identities else [case]
        self.identities.add(case.identity)
        return new

    def _wanted(self) -> list[tuple[tuple[int, float], int, float]]:
        known = (value for family in self._families for _, value in family.known.values())
        values = [value for value in known if value is not None] or [0.0]
        span = max(max(values) - min(values), _CONSTANT * max(map(abs, values)))
        return sorted(
            (urgency, number, position)
            for number, family in enumerate(self._families)
            for urgency, position in family.wanted(self._aim.tolerance, span)
        )

    def lines(self) -> list[str]:
        changes = [(family, ends) for family in self._families for ends in family.changes()]
        worst = max((family.length(*ends) for family, ends in changes), default=0.0)
        within = f"to {worst:.2g} of the range, in {len(changes)} intervals" if changes else "none"
        lines = [f"{'changes of mode':<20}{within}"]
        for family, ends in changes:
            fixed = f" ({', '.join(family.fixed)})" if family.fixed else ""
            sides = (f"{family.known[x][0]} at {', '.join(family.along.settings(x))}" for x in ends)
            lines.append(f"  {', '.join(sides)}{fixed}")
        if self._is_spent:
            why = f"{self._aim.most} cases are spent before the tolerance is reached"
            lines.append(f"{'':<20}{why}; raise --most")
        if self._refused:
            count = f"{len(self._refused)} cases between; the first: {self._refused[0]}"
            lines.append(f"{'left out':<20}{count}")
        return lines


def _numbers(axis: VariedKey) -> dict[tuple[float, ...], str]:
    numbers: dict[tuple[float, ...], str] = {}
    for text in axis.values:
        try:
            value = tomllib.loads(f"value = {text}")["value"]
            parts = np.array(value if isinstance(value, list) and value else [value])
        except (ValueError, RecursionError):
            return {}
        if parts.dtype.kind not in "if" or parts.ndim > 1 or not np.isfinite(parts).all():
            return {}
        numbers.setdefault(tuple(parts.astype(float).tolist()), text)
    return numbers if len({len(row) for row in numbers}) == 1 else {}


def _has_equal_ratios(values: Floats) -> bool:
    values = np.sort(values)
    if values[0] <= 0.0:
        return False
    if len(values) == 2:
        return bool(values[1] >= 10.0 * values[0])
    differences, ratios = np.diff(values), np.diff(np.log(values))
    return bool(np.ptp(ratios) / ratios.max() < np.ptp(differences) / differences.max())

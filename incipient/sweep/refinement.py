"""Cases that a sweep adds: where the mode changes along a key, and where a quantity bends.

One key is refined; the others make families. An interval of length h is halved while longer than the tolerance if the
modes of its ends differ, or f[a, b, c] h^2/4, the estimated deviation from a line, is too large (f[a, b, c]: second
divided difference of three neighbours of one mode). Lengths and deviations are fractions of the ranges. A round is
complete before the next one begins, so that a killed sweep resumes with the same cases.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from ..arrays import Floats, decimal
from ..errors import SceneError
from .cases import Axes, Settings, Source, SweepCase, to_digits

Columns = Mapping[str, Any]
Resolve = Callable[[Source, Settings], SweepCase]


def refined_key(axes: Axes) -> tuple[str, list[float]]:
    """The first key with distinct numbers, and these, ascending. Raises SceneError without one."""
    for key, texts in axes.items():
        with suppress(ValueError):
            values = sorted({decimal(text) for text in texts})
            if len(values) > 1 and np.isfinite(values).all():
                return key, values
    raise SceneError("--refine: no key is varied over numbers; give --over KEY=FIRST,LAST")


@dataclass(eq=False)
class SweepRefinement:
    """The refinement along a key of families of cases, which differ in that key only.

    values: those given, ascending; between them are equal ratios where they have equal ratios, otherwise equal
        differences
    families: source and other settings of each; resolve: makes the case of a source with settings, or raises SceneError
    quantity: column; tolerance: fraction of the ranges; most: number of cases in all
    identities: of all cases
    """

    key: str
    values: Sequence[float]
    families: Sequence[tuple[Source, Settings]]
    resolve: Resolve
    identities: set[str]
    quantity: str
    tolerance: float
    most: int
    # By family and value; None: a refused scene.
    _cases: dict[tuple[int, float], SweepCase | None] = field(default_factory=dict, init=False)
    # Value of the key, mode and quantity of the finished cases of each family.
    _curves: list[list[tuple[float, str, float]]] = field(default_factory=list, init=False)
    _refused: list[str] = field(default_factory=list, init=False)
    _is_spent: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        logarithmic = _has_equal_ratios(np.array(self.values))
        self._scaled: Callable[[Sequence[float]], Floats] = np.log if logarithmic else np.array
        self._value: Callable[[float], float] = np.exp if logarithmic else float
        for family in range(len(self.families)):
            for value in self.values:
                self._put(family, value)

    def following(self, results: Mapping[str, Columns]) -> list[SweepCase]:
        """The next cases, from the columns of finished ones; none if the aim or the budget is reached.

        Raises SceneError if no case has the quantity.
        """
        names = list(dict.fromkeys(name for columns in results.values() for name in columns))
        if results and self.quantity not in names:
            raise SceneError(
                f"--quantity {self.quantity}: no case has this column; "
                f"available: {', '.join(names) or 'none'}"
            )
        self._curves = [[] for _ in self.families]
        for family, value in sorted(self._cases):
            case = self._cases[family, value]
            if case is not None and case.identity in results:
                self._curves[family].append((value, *self._point(results[case.identity])))
        new: list[SweepCase] = []
        for family, value in self._wanted():
            if len(self.identities) >= self.most:
                self._is_spent = True
                break
            new += self._put(family, value)
        return new

    def _point(self, columns: Columns) -> tuple[str, float]:
        """Mode and quantity of a case, NaN without one."""
        value, mode = columns.get(self.quantity), str(columns.get("mode", "no verdict"))
        if not isinstance(value, int | float):
            return mode, math.nan
        if self.quantity == "safety_factor":  # from 0 to 1, and straight where the flow is weak
            return mode, 1.0 if math.isinf(value) else value / (1.0 + value)
        return (
            (mode, float(value)) if math.isfinite(value) else (f"{mode}, without bound", math.nan)
        )

    def _put(self, family: int, value: float) -> list[SweepCase]:
        source, fixed = self.families[family]
        settings = (*fixed, self.setting(value))
        try:
            case = self.resolve(source, settings)
        except SceneError as error:
            self._cases[family, value] = None
            self._refused.append(f"{', '.join(settings)}: {error}")
            return []
        self._cases[family, value] = case
        new = [] if case.identity in self.identities else [case]
        self.identities.add(case.identity)
        return new

    def setting(self, value: float) -> str:
        text = to_digits(value)
        return f"{self.key}={text if float(text) == value else repr(value)}"

    def middle(self, low: float, high: float) -> float:
        return float(to_digits(float(self._value(self._scaled([low, high]).mean()))))

    def _lengths(self, values: Sequence[float]) -> Floats:
        """Intervals of ascending values, over the range."""
        return np.diff(self._scaled(values)) / np.ptp(self._scaled(self.values))

    def _wanted(self) -> list[tuple[int, float]]:
        """Family and value of the cases that the tolerance needs: where a mode changes or the bend is unknown first."""
        values = [value for curve in self._curves for *_, value in curve if not math.isnan(value)]
        # A quantity with a range of less than a millionth of its largest value is straight.
        span = max(float(np.ptp(values or [0.0])), 1e-6 * max(map(abs, values), default=0.0))
        wanted = []
        for family, curve in enumerate(self._curves):
            lengths = self._lengths([value for value, *_ in curve])
            misses = _misses(lengths, curve)
            long = lengths > self.tolerance * (1.0 + 1e-9)
            for place in np.flatnonzero(long & (misses > self.tolerance * span)).tolist():
                middle = self.middle(curve[place][0], curve[place + 1][0])
                if (family, middle) not in self._cases:
                    wanted.append((-misses[place], family, middle))
        return [(family, value) for _, family, value in sorted(wanted)]

    def lines(self) -> list[str]:
        lines, lengths = [], []
        for (_, settings), curve in zip(self.families, self._curves, strict=True):
            fixed = f" ({', '.join(settings)})" if settings else ""
            for ends in pairwise(curve):
                if ends[0][1] != ends[1][1]:
                    lengths += self._lengths([value for value, *_ in ends]).tolist()
                    sides = (f"{mode} at {self.setting(value)}" for value, mode, _ in ends)
                    lines.append(f"  {', '.join(sides)}{fixed}")
        worst = f"to {max(lengths, default=0.0):.2g} of the range, in {len(lengths)} intervals"
        lines.insert(0, f"{'changes of mode':<20}{worst if lengths else 'none'}")
        if self._is_spent:
            lines.append(
                f"{'':<20}{self.most} cases are spent before the tolerance is reached; raise --most"
            )
        if self._refused:
            lines.append(
                f"{'left out':<20}{len(self._refused)} cases between; the first: {self._refused[0]}"
            )
        return lines


def _misses(lengths: Floats, curve: Sequence[tuple[float, str, float]]) -> Floats:
    """Estimated deviation of a curve from a line in each interval; infinite: not known, or the mode changes."""
    modes = np.array([mode for _, mode, _ in curve])
    values = np.array([value for *_, value in curve])
    alike = modes[1:] == modes[:-1]
    slopes = np.where(alike, np.diff(values) / lengths, np.nan)
    bends = np.abs(np.diff(slopes) / (lengths[1:] + lengths[:-1]))
    near = np.fmax(np.append(np.nan, bends), np.append(bends, np.nan))[: len(lengths)]
    unknown = ~alike | (np.isnan(near) & np.isfinite(slopes))
    return np.where(unknown, np.inf, near * lengths**2 / 4.0)


def _has_equal_ratios(values: Floats) -> bool:
    if values[0] <= 0.0:
        return False
    if len(values) == 2:
        return bool(values[1] >= 10.0 * values[0])
    differences, ratios = np.diff(values), np.diff(np.log(values))
    return bool(np.ptp(ratios) / ratios.max() < np.ptp(differences) / differences.max())

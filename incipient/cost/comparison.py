"""Solver options beside the scene's own, on the same variants: what they change in error, time and memory."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .frontier import FLATTEST, LEAST_SPAN, WORTH

if TYPE_CHECKING:
    from .measurement import JudgedRun
    from .quantities import ErrorNorm

FEWEST_SECONDS = 0.01  # of processor time beyond the start: what the clock resolves


@dataclass(frozen=True)
class Compared:
    """A solver option relative to the scene's own: geometric means over the variants that both were run on.

    variants:    their names, without the solver option
    change:   largest relative difference between the leading numbers of both
    error:    relative to the own one's; None where neither can be told apart from the reference's
    time:     processor time beyond starting the program
    time_at_error: the same at equal errors, by how error and time go together on the variants; None where not known
    steadily: whether it took less time at equal errors on every variant
    newton, factorisations: how many there are of them, None where one of both has none
    on_front: how many of the runs are on the front
    """

    solver: str
    variants: tuple[str, ...]
    change: float
    error: float | None
    time: float
    time_at_error: float | None
    steadily: bool
    memory: float
    newton: float | None
    factorisations: float | None
    on_front: int

    @property
    def cheaper(self) -> bool:
        """Whether it takes less time at equal errors: by a tenth on the whole, and on every variant."""
        return self.time_at_error is not None and self.steadily and self.time_at_error < 1.0 / WORTH


def compared(
    judged: Sequence[JudgedRun], front: Sequence[int], goals: Sequence[ErrorNorm]
) -> tuple[Compared, ...]:
    """The solver options that a study's runs have tried, the quickest first."""
    leading = [goal for goal in goals if goal.leading]
    own = {_plain(one): one for one in judged if not one.run.variant.solver}
    found = []
    for solver in dict.fromkeys(one.run.variant.solver for one in judged if one.run.variant.solver):
        pairs = [
            (one, own[_plain(one)])
            for one in judged
            if one.run.variant.solver == solver and _plain(one) in own
        ]
        best = sum(judged[index].run.variant.solver == solver for index in front)
        if pairs:
            found.append(_compared(solver, pairs, best, leading))
    return tuple(sorted(found, key=lambda one: one.time))


def _plain(one: JudgedRun) -> tuple[str, ...]:
    """What tells variants apart whatever the solver option."""
    return tuple(map(str, one.run.variant.key[:-1]))


def _compared(
    solver: str, pairs: Sequence[tuple[JudgedRun, JudgedRun]], on_front: int, leading: Sequence[ErrorNorm]
) -> Compared:
    def mean(
        number: Callable[[JudgedRun], float], among: Iterable[tuple[JudgedRun, JudgedRun]] = pairs
    ) -> float | None:
        """The mean ratio of a number of both."""
        return _mean([(number(one), number(own)) for one, own in among])

    clear = [pair for pair in pairs if any(one.told_apart for one in pair) and all(one.error for one in pair)]
    ratios = _at_equal_errors(clear)
    return Compared(
        solver,
        tuple(own.run.variant.name for _, own in pairs),
        max(goal.error(one.run.found, own.run.found) for one, own in pairs for goal in leading),
        mean(lambda one: one.error, clear),
        mean(_time) or 1.0,
        math.exp(float(np.mean(np.log(ratios)))) if ratios else None,
        bool(ratios) and max(ratios) < 1.0,
        mean(lambda one: one.run.peak_mib) or 1.0,
        mean(lambda one: one.run.counts.newton),
        mean(lambda one: one.run.counts.factorisations),
        on_front,
    )


def _time(one: JudgedRun) -> float:
    """Processor time beyond starting the program [s]."""
    return max(one.run.cpu - one.run.start, FEWEST_SECONDS)


def _at_equal_errors(pairs: Sequence[tuple[JudgedRun, JudgedRun]]) -> list[float]:
    """Ratios of times variant by variant, had both ways the same error; none where that is not known.

    The time for an error goes like error^-slope, with the slope of a line through the variants of one order and way,
    the same for all of them. Without one, the errors themselves must be alike.
    """
    groups: dict[tuple[int, str], list[tuple[float, float]]] = {}
    for one in (one for pair in pairs for one in pair):
        variant = one.run.variant
        groups.setdefault((variant.order, variant.solver), []).append(
            (math.log(one.error), math.log(_time(one)))
        )
    apart = [np.array(group) - np.mean(group, axis=0) for group in groups.values()]
    errors, times = np.concatenate(apart).T if apart else np.zeros((2, 1))
    slope = 0.0
    if np.ptp(errors) > math.log(LEAST_SPAN):
        slope = float(np.clip(-(errors @ times) / (errors @ errors), 0.0, 1.0 / FLATTEST))
    elif any(not 1.0 / WORTH < one.error / own.error < WORTH for one, own in pairs):
        return []
    return [_time(one) / _time(own) * (one.error / own.error) ** slope for one, own in pairs]


def _mean(pairs: Sequence[tuple[float, float]]) -> float | None:
    """Geometric mean of ratios; None without any, or where one is not positive."""
    if not pairs or any(min(pair) <= 0.0 for pair in pairs):
        return None
    return math.exp(sum(math.log(one / own) for one, own in pairs) / len(pairs))

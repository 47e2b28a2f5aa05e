"""Solver options compared with the scene's own on the same variants: change of error, time and memory."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .frontier import FLATTEST, LEAST_SPAN, WORTH
from .laws import geometric_mean
from .measurement import JudgedRun
from .quantities import ErrorNorm

Pair = tuple[
    JudgedRun, JudgedRun
]  # of one variant: with another solver option, and with the scene's own
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
    """Compares the solver options that a study's runs have tried, the quickest first."""
    leading, found = [goal for goal in goals if goal.leading], []
    own = {one.run.variant.key[:-1]: one for one in judged if not one.run.variant.solver}
    for solver in dict.fromkeys(one.run.variant.solver for one in judged if one.run.variant.solver):
        tried = [one for one in judged if one.run.variant.solver == solver]
        pairs = [(one, own[key]) for one in tried if (key := one.run.variant.key[:-1]) in own]
        on_front = sum(judged[index].run.variant.solver == solver for index in front)
        if pairs:
            found.append(_compared(solver, pairs, on_front, leading))
    return tuple(sorted(found, key=lambda one: one.time))


def _compared(
    solver: str, pairs: Sequence[Pair], on_front: int, leading: Sequence[ErrorNorm]
) -> Compared:
    clear = [
        pair
        for pair in pairs
        if any(one.told_apart for one in pair) and all(one.error for one in pair)
    ]
    ratios = _at_equal_errors(clear)
    return Compared(
        solver,
        tuple(own.run.variant.name for _, own in pairs),
        max(goal.error(one.run.found, own.run.found) for one, own in pairs for goal in leading),
        _mean_ratio(clear, lambda one: one.error),
        _mean_ratio(pairs, _time) or 1.0,
        geometric_mean(ratios) if ratios else None,
        bool(ratios) and max(ratios) < 1.0,
        _mean_ratio(pairs, lambda one: one.run.peak_mib) or 1.0,
        _mean_ratio(pairs, lambda one: one.run.counts.newton),
        _mean_ratio(pairs, lambda one: one.run.counts.factorisations),
        on_front,
    )


def _mean_ratio(pairs: Sequence[Pair], number: Callable[[JudgedRun], float]) -> float | None:
    """Geometric mean of the ratios of a number of both; None without any, or where one is not positive."""
    numbers = [(number(one), number(own)) for one, own in pairs]
    if not pairs or min(map(min, numbers)) <= 0.0:
        return None
    return geometric_mean([one / own for one, own in numbers])


def _time(one: JudgedRun) -> float:
    """Processor time beyond starting the program [s]."""
    return max(one.run.cpu - one.run.start, FEWEST_SECONDS)


def _at_equal_errors(pairs: Sequence[Pair]) -> list[float]:
    """Ratios of times variant by variant, had both ways the same error; none where that is not known.

    The time for an error goes like error^-slope, with the slope of a line through the variants of one order and way,
    the same for all of them. Without one, the errors themselves must be alike.
    """
    groups: dict[tuple[int, str], list[tuple[float, float]]] = {}
    for one in itertools.chain.from_iterable(pairs):
        key = one.run.variant.order, one.run.variant.solver
        groups.setdefault(key, []).append((math.log(one.error), math.log(_time(one))))
    apart = [np.array(group) - np.mean(group, axis=0) for group in groups.values()]
    errors, times = np.concatenate(apart).T if apart else np.zeros((2, 1))
    slope = 0.0
    if np.ptp(errors) > math.log(LEAST_SPAN):
        slope = float(np.clip(-(errors @ times) / (errors @ errors), 0.0, 1.0 / FLATTEST))
    elif any(not 1.0 / WORTH < one.error / own.error < WORTH for one, own in pairs):
        return []
    return [_time(one) / _time(own) * (one.error / own.error) ** slope for one, own in pairs]

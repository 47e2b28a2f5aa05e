"""Frontier of error against time, the power law along it, and wording."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

WORTH = 1.1  # least gain in error of a costlier run on the frontier


def extrapolated(three: Sequence[float], ratio: float) -> float | None:
    """Richardson extrapolation of three values, finest last, at the observed order; None if they diverge."""
    coarse, fine, finest = three
    before, last = fine - coarse, finest - fine
    if last == 0.0 or before / last <= 0.0:
        return None
    # Orders from 0.5 to 8 are plausible.
    order = min(math.log(before / last) / math.log(ratio), 8.0)
    return finest + last / (ratio**order - 1.0) if order >= 0.5 else None


def front(costs: Sequence[float], errors: Sequence[float], gain: float = 1.0) -> list[int]:
    """Indices of Pareto-optimal runs, cheapest first, each better by a factor `gain` than all cheaper ones."""
    best, indices = math.inf, []
    for index in sorted(range(len(costs)), key=lambda i: (costs[i], errors[i])):
        if gain * errors[index] < best:
            best = errors[index]
            indices.append(index)
    return indices


@dataclass(frozen=True)
class CostLaw:
    """Time for an error: start + (constant/error)^(1/power)."""

    constant: float
    power: float
    start: float

    def time(self, error: float) -> float:
        return self.start + (self.constant / error) ** (1.0 / self.power)


def overhead(times: Sequence[float], unknowns: Sequence[float], solves: Sequence[float]) -> float:
    """Fixed cost of a run, independent of unknowns and solves."""
    from scipy.optimize import nnls

    t, n, s = (np.asarray(values, dtype=float) for values in (times, unknowns, solves))
    parts = np.stack([np.ones_like(t), n / n.max(), n * s / (n * s).max()], axis=1)
    fitted, _ = nnls(parts / t[:, None], np.ones_like(t))
    return float(fitted[0])


def fitted(runs: Sequence[tuple[float, float]], start: float) -> CostLaw | None:
    """Least-squares fit of error = constant (time - start)^-power in logarithms; None for too few runs.

    runs: times and errors
    """
    usable = [(t - start, e) for t, e in runs if t > 1.02 * start and e > 0.0]
    x, y = np.log(np.reshape(usable, (-1, 2))).T
    if len(x) < 2 or np.ptp(x) < 1e-3 or np.ptp(y) < math.log(2.0):
        return None
    slope, level = np.polyfit(x, y, 1)
    is_law = 0.25 <= -slope <= 20.0
    return CostLaw(math.exp(level), float(-slope), start) if is_law else None


def percent(error: float) -> str:
    """A fraction in per cent, such as "0.1%"."""
    return f"{100.0 * error:.2g}%"


def seconds(time: float) -> str:
    """A time in a suitable unit, with two digits."""
    units = ((86400.0, "days"), (3600.0, "h"), (60.0, "min"))
    unit, name = next((each for each in units if time >= 2.0 * each[0]), (1.0, "s"))
    value = time / unit
    return f"{value:.0f} {name}" if value >= 10.0 else f"{value:.2g} {name}"

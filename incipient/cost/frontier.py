"""What accuracy costs, in numbers: a better reference, the runs worth making, the law behind them, and words for it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

TOLD_APART = 3.0  # factor between the bounds of an error, by the reference's own, above which it says nothing
ORDERS = (2.0, 8.0)  # between which an observed order of convergence is believed
UNKNOWN_SHARE = 0.25  # of the smallest difference: the reference's error where nothing tells it
FIRST_DIGIT, LAST_DIGIT = 2, 8  # accuracies with a price: 1%, 0.1% and so on, at the least two
LEAST_GAIN = 1.02  # a time must exceed the start by so much to enter a law
FLATTEST, STEEPEST = 0.25, 20.0  # powers that a fit believes
WORTH = 1.1  # by what a dearer run must be better to be on the front
LEAST_SPAN = 2.0  # of the errors that a law is fitted to
ROUND_OFF = 1e-12  # errors below it are none


@dataclass(frozen=True)
class Reference:
    """The numbers errors are measured against, how far each may be off, and how they were found."""

    values: dict[str, float]
    uncertainty: dict[str, float]
    how: str


def reference(
    line: Sequence[Mapping[str, float]], ratio: float, others: Sequence[Mapping[str, float]]
) -> Reference:
    """The finest of a line of ever finer runs, extrapolated by the last three where they converge.

    Args:
        line: numbers of runs of one order, the finest last, each finer than the one before by `ratio`.
        others: numbers of all other runs, which judge the finest where the line is too short.
    """
    values, uncertainty = dict(line[-1]), {}
    for name in values:
        three = [numbers[name] for numbers in line[-3:]]
        if len(three) == 3 and (limit := extrapolated(three, ratio)) is not None:
            values[name] = limit
        uncertainty[name] = _doubt(three, values[name], [numbers[name] for numbers in others])
    improved = sum(values[name] != line[-1][name] for name in values)
    how = (
        f"Richardson's extrapolation for {improved} of {len(values)} numbers"
        if improved
        else "as computed"
    )
    return Reference(values, uncertainty, how)


def extrapolated(three: Sequence[float], ratio: float) -> float | None:
    """Richardson's limit of three numbers, the finest last, that converge with an order in `ORDERS`, else None."""
    coarse, fine, finest = three
    before, last = fine - coarse, finest - fine
    if last == 0.0 or before / last <= 0.0:
        return None
    order = math.log(before / last) / math.log(ratio)
    return finest + last / (ratio**order - 1.0) if ORDERS[0] <= order <= ORDERS[1] else None


def _doubt(three: Sequence[float], value: float, others: Sequence[float]) -> float:
    """Uncertainty of a number of the reference."""
    if value != three[-1]:
        return abs(value - three[-1])
    if len(three) > 1:
        return abs(three[-1] - three[-2])
    differences = [abs(value - other) for other in others if np.isfinite(other)]
    return UNKNOWN_SHARE * min(differences, default=math.nan)


def front(costs: Sequence[float], errors: Sequence[float], gain: float = 1.0) -> list[int]:
    """Indices of runs that no cheaper one equals in error to a factor `gain`; the cheapest first."""
    best, found = math.inf, []
    for index in sorted(range(len(costs)), key=lambda i: (costs[i], errors[i])):
        if gain * errors[index] < best:
            best = errors[index]
            found.append(index)
    return found


@dataclass(frozen=True)
class CostLaw:
    """Time for an error: start + (constant/error)^(1/power); the error falls with the time beyond the start.

    scatter: the factor by which errors typically lie beside the law
    """

    constant: float
    power: float
    start: float
    scatter: float = 1.0

    def time(self, error: float) -> float:
        """Time of a run with this error, in the units of the start."""
        return self.start + (self.constant / error) ** (1.0 / self.power)

    @property
    def digit(self) -> float:
        """The factor by which the time beyond the start grows for an error ten times smaller."""
        return 10.0 ** (1.0 / self.power)


def overhead(times: Sequence[float], unknowns: Sequence[float], solves: Sequence[float]) -> float:
    """Time of a run without unknowns: the part of times that does not grow with unknowns and solves."""
    from scipy.optimize import nnls

    t, n, s = (np.asarray(values, dtype=float) for values in (times, unknowns, solves))
    parts = np.stack([np.ones_like(t), n / n.max(), n * s / (n * s).max()], axis=1)
    found, _ = nnls(parts / t[:, None], np.ones_like(t))
    return float(found[0])


def fitted(costs: Sequence[float], errors: Sequence[float], start: float) -> CostLaw | None:
    """error = constant (cost - start)^-power by least squares in the logarithms; None if runs do not suffice."""
    runs = zip(costs, errors, strict=True)
    usable = [(t - start, e) for t, e in runs if t > LEAST_GAIN * start and e > 0.0]
    if len({round(math.log(t), 3) for t, _ in usable}) < 2:
        return None
    x, y = np.log(np.array(usable)).T
    if np.ptp(y) < math.log(LEAST_SPAN):
        return None
    slope, level = np.polyfit(x, y, 1)
    if not FLATTEST <= -slope <= STEEPEST:
        return None
    scatter = math.exp(float(np.sqrt(np.mean((y - level - slope * x) ** 2))))
    return CostLaw(math.exp(level), float(-slope), start, scatter)


def words(law: CostLaw, errors: Sequence[float], costs: Sequence[float]) -> str:
    """Words of a law, such as "1%: 1.4 s, 0.1%: about 6 s; each further digit x 2.1, beyond the 1.1 s of starting"."""
    priced: dict[str, list[str]] = {}
    for error in accuracies(min(errors)):
        priced.setdefault(cost(law, error, errors, costs), []).append(percent(error))
    ends = {
        time: " to ".join(dict.fromkeys((names[0], names[-1]))) for time, names in priced.items()
    }
    prices = [f"{names}: {time}" for time, names in ends.items()]
    digit = f"each further digit x {law.digit:.2g}"
    start = f", beyond the {law.start:.2g} s of starting" if law.start else ""
    return f"{', '.join(prices)}; {digit}{start}"


def accuracies(best: float) -> list[float]:
    """1%, 0.1% and so on to the first that is finer than the best error reached."""
    digits = range(FIRST_DIGIT, LAST_DIGIT + 1)
    last = next((digit for digit in digits if 10.0**-digit < best), LAST_DIGIT)
    return [10.0**-digit for digit in range(FIRST_DIGIT, max(last, FIRST_DIGIT + 1) + 1)]


def cost(law: CostLaw, error: float, errors: Sequence[float], costs: Sequence[float]) -> str:
    """The time for an error; the cheapest run where it does better, "about" where the law goes beyond the runs."""
    cheapest = min(range(len(costs)), key=lambda i: costs[i])
    if errors[cheapest] <= error:
        return f"at most {seconds(costs[cheapest])}"
    return ("" if error >= min(errors) else "about ") + seconds(law.time(error))


def percent(error: float) -> str:
    """A share in per cent, such as "0.1%" for 0.001."""
    share = 100.0 * error
    if share == 0.0 or 1e-4 <= share < 1000.0:
        return f"{share:.2g}%"
    digits, power = f"{error:.1e}".split("e")
    return f"{digits.removesuffix('.0')}e{int(power)}"


def seconds(time: float) -> str:
    """A time in the unit that suits it, two digits."""
    for unit, name in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if time >= 2.0 * unit:
            return f"{_two_digits(time / unit)} {name}"
    return f"{_two_digits(time)} s"


def _two_digits(value: float) -> str:
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"

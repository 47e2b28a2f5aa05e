"""Laws of time and of error, fitted to the runs of a study.

Time: t = start + fixed + n^p (a + c m) for n unknowns and m time steps. Error: E = C h^q + D dt^r for cells that are
h times as large as the usual ones, and steps dt in units of the flow's time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from pydantic import ConfigDict

from ..arrays import Floats

KNOWN_KEYS = ConfigDict(
    extra="forbid"
)  # of laws in files: those of another version are not taken for these
USUAL_POWER, POWERS = 1.1, (1.0, 1.1, 1.2, 1.3, 1.4, 1.5)  # of the unknowns; those that a fit tries
WIDE = 10.0  # factor between the fewest and the most unknowns from which on runs tell the power
AGAIN = 0.3  # of what is fixed is paid again by a further run in one process: measured
RATES = tuple(np.arange(1.0, 8.5, 0.5).tolist())  # powers of the cell size that a fit tries
# What is not known more of an error whose order was not measured: cell sizes make orders alike.
OTHER_ORDER = 3.0


def geometric_mean(values: Sequence[float]) -> float:
    """Geometric mean of positive values, of which there is one at least."""
    return math.exp(float(np.mean(np.log(values))))


@dataclass(frozen=True)
class TimeLaw:
    """Processor time [s]: start + fixed + unknowns^power (solution + step steps).

    start: until everything is imported; fixed: what no number of unknowns changes besides, such as loading forms
    """

    __pydantic_config__: ClassVar = KNOWN_KEYS

    start: float
    fixed: float
    solution: float
    step: float
    power: float

    def seconds(self, runs: Sequence[tuple[int, float]], duals: Sequence[int]) -> float:
        """Runs of so many unknowns and steps, one after the other in one process, and dual solutions in between."""
        fixed = self.start + self.fixed * (1.0 + AGAIN * (len(runs) - 1))
        every = [*runs, *((n, 0.0) for n in duals)]
        return fixed + sum(n**self.power * (self.solution + self.step * m) for n, m in every)


def fitted_time(unknowns: Floats, steps: Floats, cpu: Floats, start: float) -> TimeLaw:
    """The law that fits runs best, none of its parts negative, errors taken relative to the times `cpu` [s]."""
    powers = POWERS if unknowns.max() >= WIDE * unknowns.min() else (USUAL_POWER,)

    def with_power(power: float) -> tuple[float, TimeLaw]:
        """Residual and law of a fit with a power of the unknowns."""
        n = unknowns**power
        parts = np.stack([np.ones_like(n), n, n * steps], axis=1)
        (fixed, solution, step), missed = _positive(parts, cpu - start, cpu)
        return missed, TimeLaw(start, fixed, solution, step, power)

    return min((with_power(power) for power in powers), key=lambda found: found[0])[1]


@dataclass(frozen=True)
class ErrorLaw:
    """error = mesh h^power + time dt^rate for one order; errors lie beside it by a factor `scatter`."""

    __pydantic_config__: ClassVar = KNOWN_KEYS

    mesh: float
    power: float
    time: float
    rate: float
    scatter: float

    def error(self, mesh_size: float, step: float) -> float:
        """The error at a cell size and a step (0: steady flow)."""
        return self.mesh * mesh_size**self.power + (self.time * step**self.rate if step else 0.0)


def fitted_errors(seen: Floats, rate: float) -> dict[int, ErrorLaw]:
    """The laws that fit errors best, by order of the velocity.

    Args:
        seen: a row for each run: order, cell size, step (0: steady flow), error, which is not zero.
        rate: order of the time steps; where the first steps err most, it is one less.
    """
    found = {}
    for order in np.unique(seen[:, 0]).astype(int).tolist():
        _, sizes, steps, errors = seen[(seen[:, 0] == order)].T
        # One cell size alone does not tell the power: that of the energy norm then.
        powers = RATES if np.ptp(sizes) > 0.0 else (float(order),)
        rates = sorted({rate, 1.0}, reverse=True) if steps.any() else [rate]
        tried = (_with_powers(sizes, steps, errors, power, r) for r in rates for power in powers)
        found[order] = min(tried, key=lambda law: law.scatter)
    return found


def _with_powers(
    sizes: Floats, steps: Floats, errors: Floats, power: float, rate: float
) -> ErrorLaw:
    parts = np.stack([sizes**power, steps**rate], axis=1)
    (mesh, time), _ = _positive(parts, errors, errors)
    # Relative squares favour the small ones of errors that scatter: the middle is that of the logarithms.
    beside = np.log(errors / np.maximum(parts @ [mesh, time], 1e-300))
    middle = float(np.exp(beside.mean()))
    return ErrorLaw(middle * mesh, power, middle * time, rate, float(np.exp(beside.std())))


def _positive(parts: Floats, values: Floats, scale: Floats) -> tuple[list[float], float]:
    """Least squares with coefficients that are not negative, relative to a scale; and the norm of what is left."""
    from scipy.optimize import nnls

    relative = parts / scale[:, None]
    size = np.maximum(np.abs(relative).max(axis=0), 1e-300)
    found, left = nnls(relative / size, values / scale)
    return (found / size).tolist(), float(left)


def error_at(
    laws: Mapping[int, ErrorLaw], order: int, mesh_size: float, step: float
) -> tuple[float, float]:
    """The error by the law of an order, or of the nearest one, and the factor by which it may be off."""
    nearest = min(laws, key=lambda known: abs(known - order))
    law = laws[nearest]
    return law.error(mesh_size, step), law.scatter * (1.0 if nearest == order else OTHER_ORDER)

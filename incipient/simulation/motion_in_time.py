"""How much of the time, and how often, loads in time move a grain; and in which flow, by a law of its loads."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Booleans, Floats
from ..contact.batch import Batch
from ..errors import SceneError

LAWS = {"U": 1.0, "U2": 2.0}  # powers of the velocity with which loads may grow
BATCHES, FEWEST = (
    20,
    40,
)  # parts of the time whose means tell the error of a mean; samples that they take
NONE_FOUND = 3.0  # events that may have been expected where none came, with a probability of 5%
PROBABILITIES = (0.001, 0.01, 0.05, 0.5)


@dataclass(frozen=True)
class MotionInTime:
    """Motion in a part of a series.

    probability: share of the time in which the load is not held; error: its standard error by the means of batches,
    None where samples are too few, or all alike
    rate: how often that begins in unit time; low, high: by the number that was counted, one standard error
    """

    since: float
    duration: float
    samples: int
    probability: float
    error: float | None
    rate: float
    low: float
    high: float

    @classmethod
    def of(cls, times: Floats, held: Booleans, since: float) -> MotionInTime:
        """The motion from a time on, by samples (n,); raises SceneError where none are left."""
        kept = samples_from(times, since)
        times, moves = times[kept], ~held[kept]
        steps, duration = steps_of(times), float(times[-1] - times[0]) or 1.0
        begins = float((moves[1:] & ~moves[:-1]).sum())
        least = max(begins - math.sqrt(begins), 0.0)
        most = begins + math.sqrt(begins) if begins else NONE_FOUND
        share, error = _mean(moves.astype(float), steps)
        error = error or None
        rates = (one / duration for one in (begins, least, most))
        return cls(float(times[0]), duration, len(times), share, error, *rates)

    def text(self) -> str:
        """Probability and rate for a reader."""
        error = f", {self.samples} samples" if self.error is None else f" +- {self.error:.2g}"
        often = f"begins {self.rate:.3g} times in unit time ({self.low:.2g} to {self.high:.2g})"
        where = f"from time {self.since:.6g} on"
        return f"{'motion':<20}probability at an instant {self.probability:.3g}{error}, {often}; {where}"


@dataclass(frozen=True)
class VelocityQuantile:
    """The flow, over that of the series, in which the grain moves with a probability; low, high: by its error."""

    probability: float
    factor: float
    low: float
    high: float


@dataclass(frozen=True)
class FlowThreshold:
    """Flows that move the grain, over the velocity of the series, where loads grow as a power of it.

    mean: that of the mean load, with its range, if there is one; quantiles: those of probabilities at an instant
    """

    law: str
    mean: tuple[float, float, float] | None
    quantiles: tuple[VelocityQuantile, ...]

    @classmethod
    def of(
        cls,
        law: str,
        times: Floats,
        batch: Batch,
        since: float,
        mean: tuple[float, float, float] | None,
    ) -> FlowThreshold:
        """The flows of a law of `LAWS`; mean: safety factor of the mean load, and its range.

        Raises SceneError where no samples are left.
        """
        kept = samples_from(times, since)
        power, factors, steps = 1.0 / LAWS[law], batch.factors[kept], steps_of(times[kept])
        order = np.argsort(factors, kind="stable")
        share = np.cumsum(steps[order]) / steps.sum()

        def flow(probability: float) -> float:
            place = min(int(np.searchsorted(share, probability)), len(share) - 1)
            return float(factors[order[place]] ** power)

        found = []
        for probability in PROBABILITIES:
            if probability * len(share) < 1.0:
                continue
            level = flow(probability)
            error = _mean((factors**power < level).astype(float), steps)[1] or 0.0
            ends = (flow(min(max(probability + sign * error, 0.0), 1.0)) for sign in (-1.0, 1.0))
            found.append(VelocityQuantile(probability, level, *ends))
        scaled = None if mean is None else (mean[0] ** power, mean[1] ** power, mean[2] ** power)
        return cls(law, scaled, tuple(found))

    def text(self) -> str:
        """Flows for a reader."""
        power = "U^2" if self.law == "U2" else "U"
        lines = [f"{'threshold':<20}where loads grow as {power}, in velocities of this run"]
        if self.mean is not None:
            value, low, high = self.mean
            lines.append(f"  by the mean load  {value:.4g} ({low:.4g} to {high:.4g})")
        lines += [
            f"  probability {one.probability:<6g}{one.factor:.4g} ({one.low:.4g} to {one.high:.4g})"
            for one in self.quantiles
        ]
        return "\n".join(lines)


def samples_from(times: Floats, since: float) -> Booleans:
    """Which samples (n,) are from a time on; raises SceneError where none are."""
    kept = times >= since
    if not kept.any():
        last = f"{times.max():g}" if len(times) else "missing"
        raise SceneError(f"--since: nothing is there from {since:g} on; the last time is {last}")
    return np.asarray(kept)


def steps_of(times: Floats) -> Floats:
    """The time that each sample stands for, (n,): half of that to its neighbours."""
    if len(times) == 1:
        return np.ones(1)
    gaps = 0.5 * np.diff(times)
    return np.append(gaps, 0.0) + np.append(0.0, gaps)


def _mean(values: Floats, steps: Floats) -> tuple[float, float | None]:
    """The mean in time, and its standard error by batches, if there are enough samples."""
    mean = float(values @ steps / steps.sum())
    if len(values) < FEWEST:
        return mean, None
    parts = np.array_split(np.arange(len(values)), BATCHES)
    means = [float(values[part] @ steps[part] / steps[part].sum()) for part in parts]
    return mean, float(np.std(means, ddof=1) / math.sqrt(BATCHES))

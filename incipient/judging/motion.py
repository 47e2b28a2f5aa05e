"""Probability and rate of motion under unsteady loads, and critical flows by a law of the loads."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import NO_EVENT, Booleans, Floats
from ..contact.batch import Batch
from ..errors import SceneError

LAWS = {"U": 1.0, "U2": 2.0}  # powers of the velocity to which loads are proportional
BATCHES = 20  # parts of the time whose means give the error of a mean
FEWEST = 2 * BATCHES  # samples of a mean with an error
PROBABILITIES = (0.001, 0.01, 0.05, 0.5)


@dataclass(frozen=True)
class MotionInTime:
    """Motion in a part of a series.

    probability: fraction of time in motion; error: its standard error, None for too few samples, or if all agree
    rate: onsets of motion in unit time; low, high: for one standard error of the number of events
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
        kept = samples_from(times, since)
        times, moves = times[kept], ~held[kept]
        duration = float(times[-1] - times[0]) or 1.0
        begins = float((moves[1:] & ~moves[:-1]).sum())
        spread = math.sqrt(begins) or NO_EVENT
        rates = (count / duration for count in (begins, max(begins - spread, 0.0), begins + spread))
        mean, error = mean_in_time(moves.astype(float), times)
        spread_of_mean = float(error) if error > 0.0 else None
        return cls(float(times[0]), duration, len(times), float(mean), spread_of_mean, *rates)

    def text(self) -> str:
        error = f", {self.samples} samples" if self.error is None else f" +- {self.error:.2g}"
        often = f"begins {self.rate:.3g} times per unit of time ({self.low:.2g} to {self.high:.2g})"
        where = f"from time {self.since:.6g} on"
        return f"{'motion':<20}instantaneous probability {self.probability:.3g}{error}, {often}; {where}"


@dataclass(frozen=True)
class VelocityQuantile:
    """Velocity over that of the series at which the grain moves with a probability; low, high: by its error."""

    probability: float
    factor: float
    low: float
    high: float


@dataclass(frozen=True)
class FlowThreshold:
    """Velocities, relative to that of the series, at which the grain moves, for loads that are a power of it.

    mean: by the mean load, with its range, if there is one; quantiles: by fractions of time
    """

    law: str
    mean: tuple[float, ...] | None
    quantiles: tuple[VelocityQuantile, ...]

    @classmethod
    def of(
        cls, law: str, times: Floats, batch: Batch, since: float, mean: tuple[float, ...] | None
    ) -> FlowThreshold:
        """The velocities for a law of `LAWS`. Raises SceneError without samples.

        mean: safety factor of the mean load, and its range
        """
        kept = samples_from(times, since)
        power, times = 1.0 / LAWS[law], times[kept]
        factors = batch.factors[kept] ** power
        order = np.argsort(factors, kind="stable")
        reached = np.cumsum(steps_of(times)[order])

        def quantile(probability: float) -> float:
            place = np.searchsorted(reached, np.clip(probability, 0.0, 1.0) * reached[-1])
            return float(factors[order[min(place, len(order) - 1)]])

        quantiles = []
        for probability in PROBABILITIES:
            if probability * len(times) >= 1.0:
                level = quantile(probability)
                error = float(np.nan_to_num(mean_in_time((factors < level) * 1.0, times)[1]))
                ends = quantile(probability - error), quantile(probability + error)
                quantiles.append(VelocityQuantile(probability, level, *ends))
        scaled = None if mean is None else tuple(factor**power for factor in mean)
        return cls(law, scaled, tuple(quantiles))

    def text(self) -> str:
        power = "U^2" if self.law == "U2" else "U"
        lines = [f"{'threshold':<20}where loads grow as {power}, in velocities of this run"]
        if self.mean is not None:
            value, low, high = self.mean
            lines.append(f"  by the mean load  {value:.4g} ({low:.4g} to {high:.4g})")
        lines += [
            f"  probability {quantile.probability:<6g}{quantile.factor:.4g} ({quantile.low:.4g} to {quantile.high:.4g})"
            for quantile in self.quantiles
        ]
        return "\n".join(lines)


def samples_from(times: Floats, since: float) -> Booleans:
    """Mask (n,) of the samples from a time on. Raises SceneError without any."""
    kept = times >= since
    if not kept.any():
        last = f"{times.max():g}" if len(times) else "missing"
        raise SceneError(
            f"--since: there are no samples from {since:g} on; the last time is {last}"
        )
    return np.asarray(kept)


def steps_of(times: Floats) -> Floats:
    """Time (n,) that each sample represents: half of the gaps to its neighbours."""
    if len(times) == 1:
        return np.ones(1)
    gaps = 0.5 * np.diff(times)
    return np.append(gaps, 0.0) + np.append(0.0, gaps)


def mean_in_time(values: Floats, times: Floats) -> tuple[Floats, Floats]:
    """Means (...) of samples (n, ...), and their standard errors from means of batches; NaN for too few samples."""
    steps = steps_of(times)
    mean = np.asarray(steps @ values / steps.sum())
    if len(values) < FEWEST:
        return mean, np.full(mean.shape, np.nan)
    parts = np.array_split(np.arange(len(values)), BATCHES)
    means = [steps[part] @ values[part] / steps[part].sum() for part in parts]
    return mean, np.asarray(np.std(means, axis=0, ddof=1) / math.sqrt(BATCHES))

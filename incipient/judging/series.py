"""Unsteady loads on the grain of a case: events, probability and rate of motion, critical flows by a law."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import NO_EVENT, Booleans, Floats
from ..contact.batch import Batch, Cases, judge_many
from ..errors import SceneError, refuse_broken
from .case import Case
from .table import names_of, read_table, require_columns, vectors

LAWS = {"U": 1.0, "U2": 2.0}  # powers of the velocity to which loads are proportional
BATCHES = 20  # parts of the time whose means give the error of a mean
FEWEST = 2 * BATCHES  # samples of a mean with an error


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
        return (
            f"{'motion':<20}instantaneous probability {self.probability:.3g}{error}, "
            f"begins {self.rate:.3g} times per unit of time ({self.low:.2g} to {self.high:.2g}); "
            f"from time {self.since:.6g} on"
        )


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
    def of(cls, law: str, series: Series, mean: tuple[float, ...] | None = None) -> FlowThreshold:
        """The velocities for a law of `LAWS`.

        mean: safety factor of the mean load, and its range
        """
        kept = samples_from(series.times, series.motion.since)
        power, times = 1.0 / LAWS[law], series.times[kept]
        factors = series.batch.factors[kept] ** power
        order = np.argsort(factors, kind="stable")
        reached = np.cumsum(steps_of(times)[order])

        def quantile(probability: float) -> float:
            place = np.searchsorted(reached, np.clip(probability, 0.0, 1.0) * reached[-1])
            return float(factors[order[min(place, len(order) - 1)]])

        quantiles = []
        for probability in (0.001, 0.01, 0.05, 0.5):
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


@dataclass(frozen=True)
class UnheldTime:
    """An interval of motion.

    impulse: integral of the excess of the flow's force over the largest stable one; least: the smallest safety factor;
    mode: the one that lasts longest
    """

    start: float
    length: float
    impulse: float
    least: float
    mode: str


@dataclass(frozen=True, eq=False)
class Series:
    """Verdicts on a series: times (n,), the criterion's answers, fractions of time by mode, events, motion."""

    times: Floats
    batch: Batch
    shares: dict[str, float]
    events: tuple[UnheldTime, ...]
    motion: MotionInTime

    def to_dict(self) -> dict[str, Any]:
        return {
            "samples": len(self.times),
            "start": float(self.times[0]),
            "end": float(self.times[-1]),
            "least_safety_factor": float(self.batch.factors.min()),
            "shares": self.shares,
            "events": [asdict(event) for event in self.events],
            "judged_alone": self.batch.alone,
            "motion": asdict(self.motion),
        }

    def table(self) -> str:
        """CSV text of time, safety factor and mode of each sample."""
        factors = self.batch.factors.tolist()
        rows = zip(self.times.tolist(), factors, self.batch.mode_names, strict=True)
        lines = (f"{time!r},{factor!r},{mode}\n" for time, factor, mode in rows)
        return "".join(["time,safety_factor,mode\n", *lines])

    def text(self) -> str:
        lines = [f"{'samples':<20}{len(self.times)} from {self.times[0]:g} to {self.times[-1]:g}"]
        lines.append(f"{'safety factor':<20}{self.batch.factors.min():.4g} at the least")
        lines += [f"{mode:<19} {share:.3%} of the time" for mode, share in self.shares.items()]
        lines.append(self.motion.text())
        longest = sorted(self.events, key=lambda event: -event.length)[:10]
        lines.append(f"{'events':<20}{len(self.events)}{', the longest:' if longest else ''}")
        lines += [
            f"  at {event.start:<15.6g}for {event.length:.4g}, {event.mode}, impulse {event.impulse:.4g}, "
            f"safety factor down to {event.least:.4g}"
            for event in longest
        ]
        return "\n".join(lines)


def judge_series(case: Case, columns: Mapping[str, Floats], since: float | None = None) -> Series:
    """Judge the loads of a series, with all else from a case.

    Args:
        columns: arrays (n,) by name: time, force_x, force_y, couple (the torque), in 3-D force_z, couple_x, couple_y,
            couple_z; torques are about the case's point; weight_x ... and friction if they vary.
        since: start of the part whose probability of motion is given; None: the first time.

    Raises SceneError for missing or unknown columns, numbers that are not finite, or times that do not ascend.
    """
    cases, times = _cases(case, columns), columns["time"]
    batch = judge_many(cases).complete()
    steps = steps_of(times)
    shares = {
        batch.labels[mode]: float(steps[batch.modes == mode].sum() / steps.sum())
        for mode in np.unique(batch.modes)
    }
    motion = MotionInTime.of(times, batch.held, float(times[0]) if since is None else since)
    return Series(times, batch, shares, tuple(_events(times, cases, batch)), motion)


def read_series(path: Path, since: float | None = None) -> dict[str, Floats]:
    """Columns of a CSV or Parquet file, from a time on. Raises as `read_table`, and SceneError for a wrong row."""
    table = read_table(path)
    for place, why in table.faults.items():
        raise SceneError(f"{path}: row {place + 1}: {why}")
    if since is None or "time" not in table.columns:
        return table.columns
    kept = samples_from(table.columns["time"], since)
    return {name: values[kept] for name, values in table.columns.items()}


def _cases(case: Case, columns: Mapping[str, Floats]) -> Cases:
    gdim, weight = case.gdim, names_of("weight", case.gdim)
    needed = ["time", *names_of("force", gdim), *names_of("couple", gdim)]
    if varies := not columns.keys().isdisjoint(weight):
        needed += weight
    require_columns("series", columns, needed, [*weight, "friction"], f"give {', '.join(needed)}")
    _check(columns)
    acting, contacts, law = vectors(columns, "force", gdim), case.contacts.table, case.contacts.law
    # tau_c = tau_a + (a - c) ^ F
    torque = vectors(columns, "couple", gdim) + np.cross(
        case.load.reference(case.centre) - case.centre, acting
    )
    cases = Cases(
        contacts.points,
        contacts.normals,
        acting,
        torque,
        vectors(columns, "weight", gdim) if varies else case.to_load().weight,
        case.centre,
        replace(law, coefficient=columns.get("friction", law.coefficient)),
        *(case.mass_and_inertia() or ()),
    )
    return replace(cases, areas=contacts.areas)


def _check(columns: Mapping[str, Floats]) -> None:
    for name, values in columns.items():
        if len(bad := np.flatnonzero(~np.isfinite(values))):
            raise SceneError(
                f"series: {name} is not finite in sample {bad[0] + 1}; remove such samples"
            )
    times = columns["time"]
    refuse_broken(
        (not len(times), "series: there are no samples; give one in each line below the names"),
        (
            (np.diff(times) <= 0.0).any(),
            "series: time does not increase from sample to sample; sort the samples and remove duplicates",
        ),
        (
            np.min(columns.get("friction", 0.0), initial=0.0) < 0.0,
            "series: friction is negative; give numbers of at least 0",
        ),
    )


def _events(times: Floats, cases: Cases, batch: Batch) -> list[UnheldTime]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], ~batch.held, [False]]).astype(np.int8)))
    steps, factors = steps_of(times), batch.factors
    excess = np.linalg.norm(cases.force, axis=1) * (1.0 - np.minimum(factors, 1.0)) * steps
    events = []
    for rows in (slice(first, last) for first, last in edges.reshape(-1, 2)):
        mode = batch.labels[int(np.bincount(batch.modes[rows], steps[rows]).argmax())]
        length, impulse = float(steps[rows].sum()), float(excess[rows].sum())
        events.append(
            UnheldTime(float(times[rows.start]), length, impulse, float(factors[rows].min()), mode)
        )
    return events

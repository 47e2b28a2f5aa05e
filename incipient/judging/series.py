"""Unsteady loads on the grain of a case: events, probability and rate of motion, critical flows by a law."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import NO_EVENT, Booleans, Floats
from ..contact.batch import Batch, Cases, judge_many
from ..errors import SceneError, refuse_broken
from ..files import csv_text
from ..results.quantity import labelled
from .case import Case
from .table import names_of, read_table, require_columns, vectors

LAWS = {"U": 1.0, "U2": 2.0}  # powers of the velocity to which loads are proportional
BATCHES = 20  # parts of the time whose means give the error of a mean
FEWEST = 2 * BATCHES  # samples of a mean with an error


def motion_in_time(times: Floats, held: Booleans, since: float) -> dict[str, Any]:
    """Motion of a series from a time on, as plain data.

    probability: fraction of time in motion; error: its standard error, None for too few samples, or if all agree
    rate: onsets of motion in unit time; low, high: for one standard error of the number of events
    """
    kept = samples_from(times, since)
    times, moves = times[kept], ~held[kept]
    duration = float(times[-1] - times[0]) or 1.0
    begins = float((moves[1:] & ~moves[:-1]).sum())
    spread = math.sqrt(begins) or NO_EVENT
    mean, error = mean_in_time(moves.astype(float), times)
    return {
        "since": float(times[0]),
        "duration": duration,
        "samples": len(times),
        "probability": float(mean),
        "error": float(error) if error > 0.0 else None,
        "rate": begins / duration,
        "low": max(begins - spread, 0.0) / duration,
        "high": (begins + spread) / duration,
    }


def critical_velocities(
    law: str, series: Series, mean: tuple[float, ...] | None = None
) -> dict[str, Any]:
    """Velocities, relative to that of a series, at which the grain moves, for loads that are a power of it.

    They are by the mean load, if there is one, and by fractions of time in motion, each with its range.

    Args:
        law: of `LAWS`.
        mean: safety factor of the mean load, and its range.
    """
    kept = samples_from(series.times, series.record["motion"]["since"])
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
            low, high = quantile(probability - error), quantile(probability + error)
            quantiles.append(
                {"probability": probability, "factor": level, "low": low, "high": high}
            )
    scaled = None if mean is None else tuple(factor**power for factor in mean)
    return {"law": law, "mean": scaled, "quantiles": quantiles}


def velocities_text(velocities: Mapping[str, Any]) -> str:
    """`critical_velocities` as text."""
    power = "U^2" if velocities["law"] == "U2" else "U"
    lines = labelled("threshold", f"where loads grow as {power}, in velocities of this run")
    if velocities["mean"] is not None:
        lines.append("  by the mean load  {:.4g} ({:.4g} to {:.4g})".format(*velocities["mean"]))
    by_time = "  probability {probability:<6g}{factor:.4g} ({low:.4g} to {high:.4g})"
    lines += [by_time.format_map(quantile) for quantile in velocities["quantiles"]]
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


@dataclass(frozen=True, eq=False)
class Series:
    """Verdicts on a series: times (n,), the criterion's answers, and both as in series.json.

    record: fractions of time by mode; `motion_in_time`; events, intervals of motion, by start, length, least safety
        factor, the mode that lasts longest, and impulse: integral of the excess of the flow's force over the largest
        stable one
    """

    times: Floats
    batch: Batch
    record: dict[str, Any]

    def table(self) -> str:
        """CSV text of time, safety factor and mode of each sample."""
        columns = self.times.tolist(), self.batch.factors.tolist(), self.batch.mode_names
        names = ("time", "safety_factor", "mode")
        return csv_text(
            names, (dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True))
        )

    def text(self) -> str:
        record, motion, events = self.record, self.record["motion"], self.record["events"]
        error = f", {motion['samples']} samples"
        if motion["error"] is not None:
            error = f" +- {motion['error']:.2g}"
        moves = (
            f"instantaneous probability {motion['probability']:.3g}{error}, "
            f"begins {motion['rate']:.3g} times per unit of time ({motion['low']:.2g} to {motion['high']:.2g}); "
            f"from time {motion['since']:.6g} on"
        )
        event = "  at {start:<15.6g}for {length:.4g}, {mode}, impulse {impulse:.4g}, safety factor down to {least:.4g}"
        longest = sorted(events, key=itemgetter("length"), reverse=True)[:10]
        lines = [
            *labelled("samples", "{samples} from {start:g} to {end:g}".format_map(record)),
            *labelled("safety factor", f"{record['least_safety_factor']:.4g} at the least"),
            *(f"{mode:<19} {share:.3%} of the time" for mode, share in record["shares"].items()),
            *labelled("motion", moves),
            *labelled("events", f"{len(events)}{', the longest:' if longest else ''}"),
            *map(event.format_map, longest),
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
    record = {
        "samples": len(times),
        "start": float(times[0]),
        "end": float(times[-1]),
        "least_safety_factor": float(batch.factors.min()),
        "shares": shares,
        "events": list(_events(times, cases, batch)),
        "judged_alone": batch.alone,
        "motion": motion_in_time(times, batch.held, float(times[0]) if since is None else since),
    }
    return Series(times, batch, record)


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
    for name, values in columns.items():
        if len(bad := np.flatnonzero(~np.isfinite(values))):
            raise SceneError(
                f"series: {name} is not finite in sample {bad[0] + 1}; remove such samples"
            )
    refuse_broken(
        (
            not len(columns["time"]),
            "series: there are no samples; give one in each line below the names",
        ),
        (
            (np.diff(columns["time"]) <= 0.0).any(),
            "series: time does not increase from sample to sample; sort the samples and remove duplicates",
        ),
        (
            np.min(columns.get("friction", 0.0), initial=0.0) < 0.0,
            "series: friction is negative; give numbers of at least 0",
        ),
    )
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


def _events(times: Floats, cases: Cases, batch: Batch) -> Iterator[dict[str, Any]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], ~batch.held, [False]]).astype(np.int8)))
    steps, factors = steps_of(times), batch.factors
    excess = np.linalg.norm(cases.force, axis=1) * (1.0 - np.minimum(factors, 1.0)) * steps
    for rows in (slice(first, last) for first, last in edges.reshape(-1, 2)):
        yield {
            "start": float(times[rows.start]),
            "length": float(steps[rows].sum()),
            "impulse": float(excess[rows].sum()),
            "least": float(factors[rows].min()),
            "mode": batch.labels[int(np.bincount(batch.modes[rows], steps[rows]).argmax())],
        }

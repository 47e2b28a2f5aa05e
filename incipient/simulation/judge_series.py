"""A series of loads in time, measured or from another program, on the grain and contacts of a case."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Floats
from ..contact.batch import Batch, Loads, judge_batch
from ..errors import SceneError, shortened
from ..files import make_directory, write_json, write_text_atomically
from ..input_files import LARGEST_TABLE, reading
from ..parquet import file_of_numbers
from .judge_case import Case
from .motion_in_time import MotionInTime, samples_from, steps_of

AXES = "xyz"
SAMPLES, SUMMARY = "series.csv", "series.json"
LONGEST_HEAD = 10_000  # letters of the row of names
MOST_EVENTS = 10  # described in words, the longest first


@dataclass(frozen=True)
class UnheldTime:
    """A time in which the grain is not held.

    start, length: in the series' units of time; impulse: integral of the flow's force less what could be held of it
    least: the smallest safety factor; mode: that which takes most of the time
    """

    start: float
    length: float
    impulse: float
    least: float
    mode: str


@dataclass(frozen=True, eq=False)
class Series:
    """What comes of a series: times (n,), the judge's answers, shares of time by mode, events, how often it moves."""

    times: Floats
    batch: Batch
    shares: dict[str, float]
    events: tuple[UnheldTime, ...]
    motion: MotionInTime

    def to_dict(self) -> dict[str, Any]:
        """All but the samples as plain data."""
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

    def text(self) -> str:
        """The outcome in a few lines for a reader."""
        lines = [f"{'samples':<20}{len(self.times)} from {self.times[0]:g} to {self.times[-1]:g}"]
        lines.append(f"{'safety factor':<20}{self.batch.factors.min():.4g} at the least")
        lines += [f"{mode:<19} {share:.3%} of the time" for mode, share in self.shares.items()]
        lines.append(self.motion.text())
        longest = sorted(self.events, key=lambda event: -event.length)[:MOST_EVENTS]
        lines.append(f"{'events':<20}{len(self.events)}{', the longest:' if longest else ''}")
        lines += [
            f"  at {event.start:<15.6g}for {event.length:.4g}, {event.mode}, impulse {event.impulse:.4g}, "
            f"safety factor down to {event.least:.4g}"
            for event in longest
        ]
        return "\n".join(lines)


def judge_series(case: Case, columns: Mapping[str, Floats], since: float | None = None) -> Series:
    """Judge the loads of a series on a case, of which everything else is taken.

    Args:
        columns: arrays (n,) by name: time, force_x, force_y, couple, in space force_z and couple_x, couple_y, couple_z
            for couple; couples are about the case's point; weight_x ... and friction where they vary.
        since: time from which on the probability of motion is taken; None: the first.

    Raises:
        SceneError: a column is missing, not known, or has numbers that are not finite; time does not grow.
    """
    _check(case, columns)
    times = np.asarray(columns["time"], dtype=float)
    loads, friction = _loads(case, columns), columns.get("friction", case.contacts.friction)
    batch = judge_batch(loads, case.to_contacts(), friction, case.mass_and_inertia())
    steps, shares = steps_of(times), dict[str, float]()
    total = float(steps.sum())
    for number, label in enumerate(batch.labels):
        if (of_mode := batch.modes == number).any():
            shares[label] = float(steps[of_mode].sum() / total)
    motion = MotionInTime.of(times, batch.held, float(times[0]) if since is None else since)
    return Series(times, batch, shares, tuple(_events(times, steps, loads, batch)), motion)


def series_from(columns: Mapping[str, Floats], since: float | None) -> Mapping[str, Floats]:
    """The samples of a series from a time on, None: all; raises SceneError where there are none."""
    if since is None or "time" not in columns:
        return columns
    kept = samples_from(columns["time"], since)
    return {name: values[kept] for name, values in columns.items()}


def _names(case: Case) -> tuple[list[str], list[str], list[str]]:
    """The columns of force, couple and weight."""
    axes = AXES[: case.gdim]
    couple = ["couple"] if case.gdim == 2 else [f"couple_{axis}" for axis in axes]
    return [f"force_{axis}" for axis in axes], couple, [f"weight_{axis}" for axis in axes]


def _check(case: Case, columns: Mapping[str, Floats]) -> None:
    force, couple, weight = _names(case)
    needed = ["time", *force, *couple]
    known = [*needed, *weight, "friction"]
    for name in needed:
        if name not in columns:
            raise SceneError(f"series: has no column {name}; give {', '.join(needed)}")
    for name, values in columns.items():
        if name not in known:
            raise SceneError(
                f"series: column {shortened(name)} is not known; known are {', '.join(known)}"
            )
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise SceneError(
                f"series: {name} is not finite in sample {bad[0] + 1}; leave such samples out"
            )
    if 0 < sum(name in columns for name in weight) < len(weight):
        raise SceneError(
            f"series: some of the weight's columns are missing; give {', '.join(weight)}"
        )
    if not len(columns["time"]) or (np.diff(columns["time"]) <= 0.0).any():
        why = "time does not grow from sample to sample"
        raise SceneError(f"series: {why}; sort the samples and leave none twice")
    if "friction" in columns and np.min(columns["friction"]) < 0.0:
        raise SceneError("series: friction is negative; give numbers of at least 0")


def _loads(case: Case, columns: Mapping[str, Floats]) -> Loads:
    force, couple, weight = _names(case)
    count = len(columns["time"])
    vectors = np.zeros((3, count, 3))
    for number, names in enumerate((force, couple, weight)):
        first = 2 if names == ["couple"] else 0
        for axis, name in enumerate(names, first):
            if name in columns:
                vectors[number, :, axis] = columns[name]
    if weight[0] not in columns:
        vectors[2] = case.to_load().weight
    # tau_c = tau_a + (a - c) ^ F
    about = vectors[1] + np.cross(case.about - case.centre, vectors[0])
    return Loads(vectors[0], about, vectors[2], case.centre)


def _events(times: Floats, steps: Floats, loads: Loads, batch: Batch) -> list[UnheldTime]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], ~batch.held, [False]]).astype(np.int8)))
    excess = np.linalg.norm(loads.force, axis=1) * (1.0 - np.minimum(batch.factors, 1.0)) * steps
    found = []
    for first, last in edges.reshape(-1, 2):
        rows = slice(first, last)
        often = np.bincount(batch.modes[rows], steps[rows])
        mode, least = batch.labels[int(often.argmax())], float(batch.factors[rows].min())
        length = float(steps[rows].sum())
        found.append(
            UnheldTime(float(times[first]), length, float(excess[rows].sum()), least, mode)
        )
    return found


def read_columns(path: Path) -> dict[str, Floats]:
    """The columns of a CSV file with a row of names, or of a Parquet file.

    Raises:
        SceneError: it cannot be read or is not made of numbers.
        MissingError: it is a Parquet file, and pyarrow is not installed.
    """
    if path.suffix == ".parquet":
        return _parquet(path)
    remedy = "give the name of a CSV file of numbers with a row of names"
    with reading(path, remedy, LARGEST_TABLE), path.open(encoding="utf-8-sig") as stream:
        head = stream.readline(LONGEST_HEAD + 1)
        if len(head) > LONGEST_HEAD:
            raise ValueError(f"its first row has more than {LONGEST_HEAD} letters")
        names = [name.strip() for name in next(csv.reader([head]), [])]
        table = np.loadtxt(stream, delimiter=",", ndmin=2)
    if table.size == 0 or table.shape[1] != len(names):
        why = f"has {len(names)} names and {table.shape[1]} columns"
        raise SceneError(f"{path}: {why}; give a name to each column")
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise SceneError(f"{path}: has two columns {shortened(twice)}; leave one of them out")
    return dict(zip(names, table.T, strict=True))


def _parquet(path: Path) -> dict[str, Floats]:
    file = file_of_numbers(path)
    with reading(path, "give a Parquet file of numbers"):
        table = file.read()
        return {
            name: np.asarray(table[name].to_numpy(), dtype=float) for name in table.column_names
        }


def save_series(found: Series, directory: Path) -> None:
    """Write series.csv (time, safety factor, mode) and series.json into a directory; raises OutputError."""
    labels, columns = found.batch.labels, (found.times, found.batch.factors, found.batch.modes)
    rows = zip(*(column.tolist() for column in columns), strict=True)
    lines = (f"{time!r},{factor!r},{labels[mode]}\n" for time, factor, mode in rows)
    make_directory(directory)
    write_text_atomically(directory / SAMPLES, "".join(["time,safety_factor,mode\n", *lines]))
    write_json(directory / SUMMARY, found.to_dict())

"""Amplitudes, times and frequencies from the history of a time-dependent run."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from statistics import mean


@dataclass(frozen=True)
class Peak:
    """A local maximum between samples: its time and value."""

    time: float
    value: float


def columns(file: Path, *names: str) -> list[list[float]]:
    """Columns of a history.csv."""
    with file.open() as lines:
        rows = list(csv.DictReader(lines))
    return [[float(row[name]) for row in rows] for name in names]


def peaks(times: Sequence[float], values: Sequence[float], since: float = 0.0) -> list[Peak]:
    """Local maxima later than `since`, each from the parabola through the three samples around it."""
    found = []
    for i in range(1, len(values) - 1):
        if times[i] > since and values[i - 1] <= values[i] > values[i + 1]:
            found.append(_summit(times[i - 1 : i + 2], values[i - 1 : i + 2]))
    return found


def highest(times: Sequence[float], values: Sequence[float]) -> Peak:
    """The largest of all maxima."""
    return max(peaks(times, values), key=lambda peak: peak.value)


def frequency(found: Sequence[Peak]) -> float:
    """Peaks per unit of time."""
    return 1 / mean(b.time - a.time for a, b in pairwise(found))


def _summit(times: Sequence[float], values: Sequence[float]) -> Peak:
    """Newton's divided differences: v(t) = v0 + s (t - t0) + c (t - t0)(t - t1), of maximum where v' = 0."""
    (t0, t1, t2), (v0, v1, v2) = times, values
    slope = (v1 - v0) / (t1 - t0)
    curvature = ((v2 - v1) / (t2 - t1) - slope) / (t2 - t0)
    if curvature == 0.0:
        return Peak(t1, v1)
    top = 0.5 * (t0 + t1) - 0.5 * slope / curvature
    return Peak(top, v0 + slope * (top - t0) + curvature * (top - t0) * (top - t1))

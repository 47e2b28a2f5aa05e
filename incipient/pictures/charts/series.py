"""The picture of a judged series: the safety factor in time, the times of motion, fractions of the modes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...arrays import Floats
from ...errors import OutputError
from ...input_files import reading
from ...judging.series import SAMPLES, SUMMARY
from .. import style
from ..record import parsed_json

_BINS = 1500  # across the picture: of more samples the least and the largest of each are shown
_TALLEST = 20.0  # safety factors above it are not shown


def draw(directory: Path) -> list[Path]:
    """Draw series.png from the series.csv and series.json of a directory. Not collective.

    Raises:
        OutputError: when they are missing or damaged, or the picture cannot be written.
    """
    path, samples = directory / "series.png", directory / SAMPLES
    stored = parsed_json(directory / SUMMARY)
    with reading(samples, "judge the series again", error=OutputError):
        times, factors = np.loadtxt(samples, delimiter=",", skiprows=1, usecols=(0, 1), ndmin=2).T
    with style.applied():
        figure = Figure(figsize=(8.4, 4.6), layout="constrained")
        above, below = figure.subplots(2, 1, height_ratios=(3, 1))
        _factors(above, times, factors, stored["events"])
        shares = stored["shares"]
        below.barh(list(shares), list(shares.values()), color=style.FLOW, height=0.6)
        below.set(xlabel="share of the time", xlim=(0.0, 1.0))
        below.invert_yaxis()
        style.save(figure, path)
    return [path]


def _factors(axes: Axes, times: Floats, factors: Floats, events: list[dict[str, float]]) -> None:
    parts = np.array_split(np.arange(len(times)), min(_BINS, len(times)))
    at = np.array([times[part[0]] for part in parts])
    low, high = (
        np.array([reduced(factors[part]) for part in parts]) for reduced in (np.min, np.max)
    )
    axes.fill_between(at, low, np.minimum(high, _TALLEST), color=style.FLOW, lw=0.8, alpha=0.7)
    axes.axhline(1.0, color=style.PUSH, lw=1.0)
    starts = np.array([event["start"] for event in events])
    axes.plot(starts, np.zeros(len(starts)), "|", color=style.PUSH, ms=9.0, clip_on=False)
    axes.set_ylim(0.0, min(float(np.max(high[np.isfinite(high)], initial=2.0)), _TALLEST))
    words = (
        f"{len(events)} times it begins to move (red marks)"
        if len(events)
        else "it rests all the time"
    )
    axes.set(title=f"Safety factor in time: {words}", xlabel="time", ylabel="safety factor")

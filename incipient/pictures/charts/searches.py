"""Charts of critical gusts, entrainment, a grain in many poses, and a judged series."""

from __future__ import annotations

import math
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...errors import OutputError
from ...input_files import reading
from ...judging.series import SAMPLES
from ..style import FLOW, INK, MOTION, PUSH, Looks, number_plainly

_SIZE = (6.4, 4.6)  # inches
_BINS = 1500  # across the picture of a series: of more samples the least and the largest of each
_TALLEST = 20.0  # safety factors above it are not shown


def _columns(rows: list[dict[str, Any]], *names: str) -> np.ndarray:
    return np.array([[row[name] for row in rows] for name in names], dtype=float)


def gusts(stored: dict[str, Any], directory: Path) -> Figure:
    """Critical strength of gusts against duration, between the limits of long and short gusts."""
    figure = Figure(figsize=_SIZE, layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log")
    points = sorted(stored["points"], key=lambda point: point["duration"])
    duration, strength, errors = _columns(points, "duration", "strength", "error")
    looks: Looks = {"marker": "o", "color": FLOW, "capsize": 3, "label": "leaves its pocket above"}
    axes.errorbar(duration, strength, np.nan_to_num(errors), **looks)
    looks = {"color": INK, "linestyle": "--", "linewidth": 0.9}
    axes.axhline(stored["static"], label="a steady flow moves it above", **looks)
    shortest = 1.0 + (strength[0] - 1.0) * duration[0] / duration
    axes.plot(duration, shortest, ":", color=PUSH, label="impulse of the shortest gust")
    axes.set(xlabel="duration of the gust [time]", ylabel="strength [-]")
    axes.set_title(stored["title"] or "The weakest gusts that move the grain out of its pocket")
    axes.legend()
    return figure


def entrainment(stored: dict[str, Any], directory: Path) -> Figure:
    """Probability of motion at an instant against the Shields number, with error bars."""
    figure = Figure(figsize=_SIZE, layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log")
    curve, quantiles = stored["curve"], stored["quantiles"]
    shields, probability, low, high = _columns(curve, "shields", "probability", "low", "high")
    complete = all(point["error"] is not None for point in quantiles)
    errors = "all errors" if complete else "known errors, not the flow's"
    looks: Looks = {"color": FLOW, "alpha": 0.25, "linewidth": 0.0}
    axes.fill_between(shields, low, high, label=f"its range by {errors}", **looks)
    axes.plot(shields, probability, color=FLOW, label="probability of motion at an instant")
    places, heights = _columns(quantiles, "shields", "probability")
    looks = {"fmt": "o", "color": INK, "markersize": 4, "capsize": 3, "label": f"with {errors}"}
    # Errors without bound are ten times the number; none reaches below zero.
    terms = [[*point["terms"].values()] for point in quantiles]
    above = np.array(
        [
            sum(10.0 * x if term is None else term for term in row)
            for x, row in zip(places, terms, strict=True)
        ]
    )
    axes.errorbar(places, heights, xerr=[np.minimum(above, 0.99 * places), above], **looks)
    looks = {"color": PUSH, "linestyle": "--", "linewidth": 0.9}
    axes.axvline(stored["threshold"]["shields"], label="a steady flow moves it above", **looks)
    if stored["data"]:
        axes.plot(*np.array(stored["data"]).T, "x", color=MOTION, label="measured")
    axes.set(xlabel="Shields number of the mean flow [-]", ylabel="probability [-]")
    number_plainly(axes.xaxis)
    axes.set_ylim(0.5 * min(*probability, *heights), 1.5)
    title = textwrap.fill(stored["title"] or "Motion in a fluctuating flow", 80)
    figure.suptitle(title, fontsize="medium")
    axes.legend(loc="lower right")
    return figure


def poses(stored: dict[str, Any], directory: Path) -> Figure:
    """Fraction of the poses of a grain that move, against the Shields number."""
    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    shields = [math.inf if value is None else value for value in stored["shields"]]
    fractions = np.arange(1, len(shields) + 1) / max(len(shields), 1)
    axes.step(shields, fractions, where="post", color=FLOW)
    axes.set(xlabel="Shields number with the nominal diameter", ylabel="fraction of poses")
    axes.set_title(f"{len(shields)} thresholds of {stored['poses']} poses")
    return figure


def series(stored: dict[str, Any], directory: Path) -> Figure:
    """Safety factor of a judged series in time, times of motion, and fractions of the modes."""
    samples = directory / SAMPLES
    with reading(samples, "judge the series again", error=OutputError):
        times, factors = np.loadtxt(samples, delimiter=",", skiprows=1, usecols=(0, 1), ndmin=2).T
    figure = Figure(figsize=(8.4, 4.6), layout="constrained")
    above, below = figure.subplots(2, 1, height_ratios=(3, 1))
    parts = np.array_split(np.arange(len(times)), min(_BINS, len(times)))
    at, low, high = np.array(
        [(times[part[0]], factors[part].min(), factors[part].max()) for part in parts]
    ).T
    above.fill_between(at, low, np.minimum(high, _TALLEST), color=FLOW, lw=0.8, alpha=0.7)
    above.axhline(1.0, color=PUSH, lw=1.0)
    starts = [event["start"] for event in stored["events"]]
    above.plot(starts, np.zeros(len(starts)), "|", color=PUSH, ms=9.0, clip_on=False)
    above.set_ylim(0.0, min(float(np.max(high[np.isfinite(high)], initial=2.0)), _TALLEST))
    moves = f"{len(starts)} times it begins to move (red marks)"
    above.set_title(f"Safety factor in time: {moves if starts else 'it rests all the time'}")
    above.set(xlabel="time", ylabel="safety factor")
    shares = stored["shares"]
    below.barh(list(shares), list(shares.values()), color=FLOW, height=0.6)
    below.set(xlabel="share of the time", xlim=(0.0, 1.0))
    below.invert_yaxis()
    return figure

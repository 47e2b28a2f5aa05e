"""Charts of critical gusts, entrainment, a grain in many poses, a judged series, and a study of cost."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..cost.frontier import WORTH, CostLaw, front
from ..errors import OutputError
from ..input_files import reading
from ..results.kinds import SERIES
from .style import COLOURS, FLOW, INK, MARKERS, MOTION, PUSH, chart, explain, headline

_TALLEST = 20.0  # safety factors above it are not shown
Runs = Sequence[dict[str, Any]]


def _columns(rows: list[dict[str, Any]], *names: str) -> np.ndarray:
    return np.array([[row[name] for row in rows] for name in names], dtype=float)


def gusts(stored: dict[str, Any], directory: Path) -> Figure:
    """Critical strength of gusts against duration, between the limits of long and short gusts."""
    figure, axes = chart(
        stored["title"] or "The weakest gusts that move the grain out of its pocket",
        xscale="log", yscale="log", xlabel="duration of the gust [time]", ylabel="gust strength [-]",
    )  # fmt: skip
    points = sorted(stored["points"], key=lambda point: point["duration"])
    if not points:
        raise OutputError(
            f"{directory}: the search has no strength yet; repeat its command to continue it"
        )
    duration, strength, errors = _columns(points, "duration", "strength", "error")
    unknown = "" if np.isfinite(errors).all() else " (no bar: error not known)"
    axes.errorbar(
        duration, strength, errors, marker="o", color=FLOW, capsize=3,
        label=f"the grain leaves its pocket above{unknown}",
    )  # fmt: skip
    if stored["static"] is not None:
        axes.axhline(stored["static"], color=INK, ls="--", lw=0.9, label="threshold of steady flow")
    shortest = 1.0 + (strength[0] - 1.0) * duration[0] / duration
    axes.plot(duration, shortest, ":", color=PUSH, label="impulse of the shortest gust")
    axes.legend()
    return figure


def entrainment(stored: dict[str, Any], directory: Path) -> Figure:
    """Instantaneous probability of motion against the Shields number, with error bars."""
    figure, axes = chart(
        stored["title"] or "Motion in a fluctuating flow",
        xscale="log", yscale="log", xlabel="Shields number of the mean flow [-]",
        ylabel="instantaneous probability of motion [-]",
    )  # fmt: skip
    curve, quantiles = stored["curve"], stored["quantiles"]
    shields, probability, low, high = _columns(curve, "shields", "probability", "low", "high")
    complete = all(point["error"] is not None for point in quantiles)
    errors = "all errors" if complete else "known errors, without those of the flow"
    axes.fill_between(shields, low, high, color=FLOW, alpha=0.25, lw=0, label=f"band: {errors}")
    axes.plot(shields, probability, color=FLOW, label="probability")
    places, heights = _columns(quantiles, "shields", "probability")
    terms = np.array([[*point["terms"].values()] for point in quantiles], dtype=float)
    # Terms without bound are drawn as ten times the number; none reaches below zero.
    known = np.where(np.isnan(terms), 10.0 * places[:, None], terms).sum(axis=1)
    axes.errorbar(
        places, heights, xerr=[np.minimum(known, 0.99 * places), known], fmt="o", color=INK,
        markersize=4, capsize=3, label=f"bars: {errors}",
    )  # fmt: skip
    axes.axvline(
        stored["threshold"]["shields"], color=PUSH, ls="--", lw=0.9, label="threshold of steady flow"
    )  # fmt: skip
    if stored["data"]:
        axes.plot(*np.array(stored["data"]).T, "x", color=MOTION, label="measured")
    axes.set_ylim(0.5 * min(*probability, *heights), 1.5)
    axes.legend(loc="lower right")
    return figure


def poses(stored: dict[str, Any], directory: Path) -> Figure:
    """Fraction of the poses of a grain that move, against the Shields number."""
    shields = [math.inf if value is None else value for value in stored["shields"]]
    figure, axes = chart(
        f"{len(shields)} thresholds of {stored['poses']} poses", ylabel="fraction of poses",
        xlabel="Shields number with the nominal diameter",
    )  # fmt: skip
    fractions = np.arange(1, len(shields) + 1) / max(len(shields), 1)
    axes.step(shields, fractions, where="post", color=FLOW)
    return figure


def series(stored: dict[str, Any], directory: Path) -> Figure:
    """Safety factor of a judged series in time, times of motion, and fractions of the modes."""
    samples = directory / SERIES.tables[0]
    with reading(samples, "judge the series again", error=OutputError):
        times, factors = np.loadtxt(samples, delimiter=",", skiprows=1, usecols=(0, 1), ndmin=2).T
    figure = Figure(figsize=(8.4, 4.6), layout="constrained")
    above, below = figure.subplots(2, 1, height_ratios=(3, 1))
    # Of more samples than pixels across the picture, the least and the largest of each pixel.
    parts = np.array_split(np.arange(len(times)), min(1500, len(times)))
    low, high = np.array([(factors[part].min(), factors[part].max()) for part in parts]).T
    at = [times[part[0]] for part in parts]
    above.fill_between(at, low, np.minimum(high, _TALLEST), color=FLOW, lw=0.8, alpha=0.7)
    above.axhline(1.0, color=PUSH, lw=1.0)
    starts = [event["start"] for event in stored["events"]]
    above.plot(starts, np.zeros(len(starts)), "|", color=PUSH, ms=9.0, clip_on=False)
    above.set_ylim(0.0, min(float(np.max(high[np.isfinite(high)], initial=2.0)), _TALLEST))
    moves = f"{len(starts)} onsets of motion (red marks)" if starts else "at rest throughout"
    above.set(title=f"Safety factor against time: {moves}", xlabel="time", ylabel="safety factor")
    below.barh(list(stored["shares"]), list(stored["shares"].values()), color=FLOW, height=0.6)
    below.set(xlabel="fraction of time", xlim=(0.0, 1.0))
    below.invert_yaxis()
    return figure


def cost(stored: dict[str, Any], directory: Path) -> Figure:
    """Error against CPU time and memory, and the frontier."""
    sheet = Figure(figsize=(9.4, 5.2), layout="constrained")
    headline(sheet, f"{stored['title'] or 'What accuracy costs'}: {stored['sentence']}")
    panels = sheet.subplots(1, 2, sharey=True, width_ratios=(1.6, 1.0))
    labels = (("cpu", "CPU time [s]"), ("peak_mib", "peak memory [MiB]"))
    for axes, (key, label) in zip(panels, labels, strict=True):
        _show(axes, stored["judged"], key)
        if doubt := stored["reference"]["doubt"]:
            axes.axhspan(
                1e-300, doubt, color="#f1efe9", zorder=0, label="within the error of the reference"
            )
        axes.set_xlabel(label)
    for run in (run for run in stored["judged"] if run["on_frontier"]):
        step = "" if run["step"] is None else f", step {run['step']:.3g}"
        panels[0].annotate(
            f"{run['mesh_size']:.3g}{step}", (run["cpu"], run["error"]), (-5, -2), fontsize=7,
            textcoords="offset points", ha="right", va="top", color=COLOURS[run["order"] - 2],
        )  # fmt: skip
    if stored["law"]:
        law, across, (low, high) = (
            CostLaw(**stored["law"]),
            panels[0].get_xlim(),
            panels[0].get_ylim(),
        )
        errors = np.geomspace(low, high, 60)
        panels[0].plot(
            [law.time(error) for error in errors], errors, "--", color="#858585", lw=1.2, zorder=1,
            label="law along the frontier",
        )  # fmt: skip
        panels[0].set(xlim=across, ylim=(low, high))
    panels[0].set_ylabel("relative error")
    explain(sheet, loc="outside lower center", ncols=5)
    panels[0].set_title("labels: numerics.mesh_size", fontsize=7)
    return sheet


def _show(axes: Axes, runs: Runs, key: str) -> None:
    for run in runs:
        colour, name = COLOURS[run["order"] - 2], f"P{run['order']}-P{run['order'] - 1}"
        axes.plot(
            run[key], run["error"], MARKERS[run["order"] - 2], color=colour, ms=5.5, zorder=3,
            mfc=colour if run["resolved"] else "white",
            label=name if run["resolved"] else f"{name}, at most",
        )  # fmt: skip
    best = front([run[key] for run in runs], [run["error"] for run in runs], WORTH)
    shown = np.array([(runs[i][key], runs[i]["error"]) for i in best])
    axes.plot(*shown.T, color=INK, lw=1.0, alpha=0.7, label="frontier", zorder=2)
    own = [run for run in runs if run["own"]]
    for run in own:
        axes.plot(
            run[key], run["error"], "o", mfc="none", mec=INK, ms=12.0, mew=1.2, zorder=4,
            label="the scene's own",
        )  # fmt: skip
        axes.axhline(0.1 * run["error"], color=INK, lw=0.8, ls=":", label="one tenth of its error")
    lowest = min([run["error"] for run in runs] + [0.1 * run["error"] for run in own])
    axes.set(xscale="log", yscale="log")
    axes.set_ylim(0.5 * lowest, 2.0 * max(run["error"] for run in runs))
    axes.margins(x=0.2)
    axes.grid(color="#e2e2e2", lw=0.5)

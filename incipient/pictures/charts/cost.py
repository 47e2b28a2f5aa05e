"""The picture of what accuracy costs: errors against time, unknowns and memory, the front, and the law.

Colours and marks tell orders apart; runs solved in another way than the scene's own have a mark for that way.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullLocator

from ...cost.frontier import WORTH, CostLaw, front, percent
from ..record import drawn
from ..style import INK, Looks

_COLOURS = {2: "#2166ac", 3: "#d95f0e", 4: "#1b7837"}
_MARKERS = {2: "o", 3: "s", 4: "D"}
_OTHERS = ("^", "v", "P", "X", "*", "<", ">", "p", "d")  # by way to solve
_LAW, _GRID = "#858585", "#e2e2e2"
_PANELS = (
    ("cpu", "processor time [s]"),
    ("wall", "wall time [s]"),
    ("unknowns", "unknowns"),
    ("peak_mib", "peak memory [MiB]"),
)
_WIDE, _HIGH = 9.4, 7.2  # inches
_MOST_TICKS = 8
_MOST_NAMES = 5  # in a row of the legend


def draw(directory: Path) -> list[Path]:
    """Draw cost.png from the cost.json of a directory; raises as `record.drawn`. Not collective."""
    return drawn(directory / "cost.json", _figure, "make the study again")


def _figure(stored: dict[str, Any]) -> Figure:
    figure = Figure(figsize=(_WIDE, _HIGH))
    figure.text(
        0.07,
        0.975,
        stored["title"] or "What accuracy costs",
        fontsize=11.5,
        weight="bold",
        va="top",
    )
    words = textwrap.wrap(f"{stored['words'][0].upper()}{stored['words'][1:]}", 118)
    figure.text(0.07, 0.935, "\n".join(words), fontsize=9, va="top", linespacing=1.3)
    every = figure.subplots(2, 2, sharey=True)
    figure.subplots_adjust(left=0.09, right=0.98, top=0.85, bottom=0.13, wspace=0.08, hspace=0.3)
    for axes, (key, label) in zip(every.flat, _PANELS, strict=True):
        _show(axes, stored, key)
        axes.set_xlabel(label)
    for axes in every[:, 0]:
        axes.set_ylabel("relative error")
    handles, labels = every[0, 0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="lower center", ncols=min(len(labels), _MOST_NAMES), fontsize=8
    )
    return figure


def _show(axes: Axes, stored: dict[str, Any], key: str) -> None:
    """Runs, those on the front, and the law where it is one of this cost."""
    runs = [run for run in stored["runs"] if run["error"] > 0.0]
    own = [run for run in runs if not run.get("solver")]
    for order in sorted({run["order"] for run in own}):
        mine = [run for run in own if run["order"] == order]
        _mark(axes, [run for run in mine if run["told_apart"]], key, order, filled=True)
        _mark(axes, [run for run in mine if not run["told_apart"]], key, order, filled=False)
    _show_solvers(axes, [run for run in runs if run.get("solver")], key)
    clear = [run for run in runs if run["told_apart"]]
    best = front([run[key] for run in clear], [run["error"] for run in clear], WORTH)
    if best:
        shown = np.array([(clear[i][key], clear[i]["error"]) for i in best])
        axes.plot(*shown.T, color=INK, lw=1.0, alpha=0.7, label="front", zorder=2)
    law = stored["laws"].get(key)
    if law and best:
        _draw_law(axes, CostLaw(**law), [run["error"] for run in runs if run["on_front"]])
    axes.set(xscale="log", yscale="log")
    axes.grid(color=_GRID, lw=0.5)
    _label(axes.xaxis, axes.set_xlim, [run[key] for run in runs], "{:g}".format)
    _label(axes.yaxis, axes.set_ylim, [run["error"] for run in runs], percent)


def _mark(axes: Axes, runs: Sequence[dict[str, Any]], key: str, order: int, filled: bool) -> None:
    if not runs:
        return
    colour, name = _COLOURS[order], f"P{order}-P{order - 1}"
    name += "" if filled else ", as good as the reference"
    looks: Looks = {"color": colour, "mfc": colour if filled else "white", "ms": 5.5, "zorder": 3}
    places = [run[key] for run in runs], [run["error"] for run in runs]
    axes.plot(*places, _MARKERS[order], label=name, **looks)


def _show_solvers(axes: Axes, runs: Sequence[dict[str, Any]], key: str) -> None:
    """Runs solved in other ways: a mark for each way, in the colour of the order; named in grey."""
    for mark, solver in zip(cycle(_OTHERS), dict.fromkeys(run["solver"] for run in runs)):
        for run in (run for run in runs if run["solver"] == solver):
            colour = _COLOURS[run["order"]]
            face, edge = (colour, "white") if run["told_apart"] else ("white", colour)
            axes.plot(run[key], run["error"], mark, mfc=face, mec=edge, mew=0.7, ms=7.5, zorder=4)
        axes.plot([], [], mark, color=_LAW, ms=6.5, label=solver)


def _draw_law(axes: Axes, law: CostLaw, errors: Sequence[float]) -> None:
    """The fitted law, a digit beyond the runs on either side."""
    shown = np.geomspace(min(errors) / 4.0, max(errors) * 2.0, 60)
    name = f"error ~ (t − {law.start:.2g} s)^−{law.power:.2g}"
    axes.plot(
        [law.time(error) for error in shown], shown, "--", color=_LAW, lw=1.2, label=name, zorder=1
    )


def _label(axis: Any, limit: Any, values: Sequence[float], told: Callable[[float], str]) -> None:
    """Show the range of values and a little more, with round numbers at a few places."""
    if not values:
        return
    low, high = min(values), max(values)
    margin = (high / low) ** 0.06 * 1.02
    low, high = low / margin, high * margin
    ticks = _round_numbers(low, high)
    axis.set_ticks(ticks, [told(tick) for tick in ticks])
    limit(low, high)
    axis.set_minor_locator(NullLocator())


def _round_numbers(low: float, high: float) -> list[float]:
    """At most eight round numbers between two: of a logarithmic scale if it is long, else evenly spaced."""
    if high > 8.0 * low:
        powers = 10.0 ** np.arange(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        ticks: list[float] = []
        for digits in ((1.0, 2.0, 5.0), (1.0, 3.0), (1.0,)):
            ticks = [
                digit * power
                for power in powers
                for digit in digits
                if low <= digit * power <= high
            ]
            if len(ticks) <= _MOST_TICKS:
                break
        return ticks
    places = MaxNLocator(_MOST_TICKS - 2).tick_values(low, high)
    return [float(place) for place in places if low <= place <= high]

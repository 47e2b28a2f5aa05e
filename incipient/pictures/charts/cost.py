"""Chart of a study of cost."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

from ...cost.frontier import WORTH, CostLaw, front, percent
from ..style import INK, explain, headline

_COLOURS = {2: "#2166ac", 3: "#d95f0e", 4: "#1b7837"}
_MARKERS = {2: "o", 3: "s", 4: "D"}
_PANELS = (("cpu", "CPU time [s]"), ("peak_mib", "peak memory [MiB]"))
Runs = Sequence[dict[str, Any]]


def figure(stored: dict[str, Any], directory: Path) -> Figure:
    """Error against CPU time and memory, and the frontier."""
    sheet = Figure(figsize=(9.4, 5.2), layout="constrained")
    headline(sheet, f"{stored['title'] or 'What accuracy costs'}: {stored['sentence']}")
    panels = sheet.subplots(1, 2, sharey=True, width_ratios=(1.6, 1.0))
    for axes, (key, label) in zip(panels, _PANELS, strict=True):
        _show(axes, stored["judged"], key)
        if doubt := stored["reference"]["doubt"]:
            axes.axhspan(
                1e-300, doubt, color="#f1efe9", zorder=0, label="within the error of the reference"
            )
        axes.set_xlabel(label)
    _name_frontier(panels[0], stored["judged"])
    if stored["law"]:
        _draw_law(panels[0], CostLaw(**stored["law"]), stored["judged"])
    panels[0].set_ylabel("relative error")
    explain(sheet, loc="outside lower center", ncols=5)
    panels[0].set_title("labels: numerics.mesh_size", fontsize=7)
    return sheet


def _show(axes: Axes, runs: Runs, key: str) -> None:
    for run in runs:
        colour, name = _COLOURS[run["order"]], f"P{run['order']}-P{run['order'] - 1}"
        axes.plot(
            run[key], run["error"], _MARKERS[run["order"]], color=colour, ms=5.5, zorder=3,
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
        tenth = 0.1 * run["error"]
        axes.axhline(tenth, color=INK, lw=0.8, ls=":", label="one tenth of its error")
    errors = [run["error"] for run in runs]
    lowest = min(errors + [0.1 * run["error"] for run in own])
    axes.set(xscale="log", yscale="log", ylim=(0.5 * lowest, 2.0 * max(errors)))
    axes.margins(x=0.2)
    axes.grid(color="#e2e2e2", lw=0.5)
    many = max(errors) > 100.0 * lowest
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0,) if many else (1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda error, _: percent(error)))
    axes.minorticks_off()
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
    axes.xaxis.set_major_formatter("{x:g}")


def _name_frontier(axes: Axes, runs: Runs) -> None:
    for run in (run for run in runs if run["on_frontier"]):
        step = "" if run["step"] is None else f", step {run['step']:.3g}"
        axes.annotate(
            f"{run['mesh_size']:.3g}{step}", (run["cpu"], run["error"]), (-5, -2), fontsize=7,
            textcoords="offset points", ha="right", va="top", color=_COLOURS[run["order"]],
        )  # fmt: skip


def _draw_law(axes: Axes, law: CostLaw, runs: Runs) -> None:
    (low, high), limits = axes.get_xlim(), axes.get_ylim()
    errors = np.geomspace(*limits, 60)
    times = [law.time(error) for error in errors]
    axes.plot(
        times, errors, "--", color="#858585", lw=1.2, label="law along the frontier", zorder=1
    )
    axes.set(xlim=(low, high), ylim=limits)

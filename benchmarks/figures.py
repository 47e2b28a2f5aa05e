"""The figures of the benchmark page.

Run: python figures.py cavity PROFILES.json FIGURE.png, or vortex_street HISTORY.csv FIGURE.png.
"""

import csv
import json
import sys
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from references import VORTEX_STREET

COLOURS = {
    "100": "#1b7837",
    "400": "#4393c3",
    "1000": "#2166ac",
    "3200": "#b2182b",
    "4000": "#762a83",
}
MARKERS = {"100": "o", "400": "s", "1000": "^", "3200": "D", "4000": ""}
STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.linewidth": 0.7,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "legend.fontsize": 8,
    "lines.linewidth": 1.2,
}
DOTS_PER_INCH = 200
INTERVALS = (VORTEX_STREET["drag"], VORTEX_STREET["lift"])


def cavity(source: Path) -> Figure:
    """Both profiles for all Reynolds numbers: lines ours, markers Ghia's."""
    profiles = json.loads(source.read_text())
    figure = Figure(figsize=(9.0, 4.7), layout="constrained")
    left, right = figure.subplots(1, 2)
    for reynolds, profile in profiles.items():
        look = {"color": COLOURS[reynolds], "label": f"Re = {reynolds}"}
        # Without markers of its own and close to the one before.
        look["linestyle"] = "-" if profile["points"] else (0, (4, 1.5))
        left.plot(profile["lines"]["u"], profile["positions"], **look)
        right.plot(profile["positions"], profile["lines"]["v"], **look)
        points = {line: [p for p in profile["points"] if p["line"] == line] for line in ("u", "v")}
        mark = {"color": COLOURS[reynolds], "marker": MARKERS[reynolds], "linestyle": "none"}
        mark |= {"markersize": 3.8, "markerfacecolor": "white", "markeredgewidth": 0.9}
        left.plot([p["value"] for p in points["u"]], [p["position"] for p in points["u"]], **mark)
        right.plot([p["position"] for p in points["v"]], [p["value"] for p in points["v"]], **mark)
    left.set(
        xlabel="u / lid speed", ylabel="y", ylim=(0, 1), title="u on the upright centreline x = 0.5"
    )
    right.set(
        xlabel="x", ylabel="v / lid speed", xlim=(0, 1), title="v on the level centreline y = 0.5"
    )
    left.plot(
        [],
        [],
        "o",
        color="#555555",
        markersize=3.8,
        markerfacecolor="white",
        label="Ghia et al. (1982)",
    )
    left.legend(
        loc="lower right", title="lines: incipient, P4-P3", title_fontsize=8, alignment="left"
    )
    for axes in (left, right):
        _quiet(axes)
    return figure


def vortex_street(source: Path, periods: float = 4.0) -> Figure:
    """Drag and lift since the start, and over the last periods."""
    with source.open() as lines:
        rows = list(csv.DictReader(lines))
    times, drag, lift = (
        np.array([float(row[key]) for row in rows]) for key in ("time", "drag", "lift")
    )
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    grid = figure.subplots(2, 2, width_ratios=(1.4, 1))
    late = times > times[-1] - periods / 3.0  # a period of the lift is about a third of a time unit
    settled = times > 0.2
    for row, (name, values, colour) in enumerate(
        (("C_D", drag, "#b2182b"), ("C_L", lift, "#2166ac"))
    ):
        label = f"${name}$"
        grid[row, 0].plot(times[settled], values[settled], color=colour, linewidth=0.9)
        grid[row, 1].plot(times[late], values[late], color=colour)
        grid[row, 1].axhspan(
            *INTERVALS[row], color="#dddddd", label="maximum, Schäfer & Turek (1996)"
        )
        grid[row, 0].set_ylabel(label, rotation=0, labelpad=12)
        grid[row, 0].set_xlim(0, times[-1])
        grid[row, 1].set_xlim(times[late][0], times[-1])
    grid[0, 1].legend(loc="lower left")
    low, high = drag[late].min(), drag[late].max()
    grid[0, 1].set_ylim(low - 0.4 * (high - low), high + 0.15 * (high - low))
    grid[0, 0].set_title("From rest")
    grid[0, 1].set_title("The last periods")
    for axes in grid[1]:
        axes.set_xlabel("t [scene units]")
    for axes in grid.flat:
        _quiet(axes)
    return figure


def _quiet(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="#e4e4e4", linewidth=0.6)
    axes.set_axisbelow(True)


def main(name: str, source: str, target: str) -> None:
    draw = {"cavity": cavity, "vortex_street": vortex_street}[name]
    Path(target).parent.mkdir(parents=True, exist_ok=True)
    with rc_context(STYLE):
        draw(Path(source)).savefig(target, dpi=DOTS_PER_INCH)
    print(json.dumps({"figure": target}))


main(*sys.argv[1:4])

"""The map of where a body's step can be solved: exact coupling above, the naive iteration below.

Run:     make stress
Results: docs/figures/stress_map.png
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from hard import corrections
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure

RATIOS = (0.0, 1e-6, 1e-3, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e6)
# What goes upwards in each panel; in the others it is as usual.
PANELS: dict[str, tuple[float, ...]] = {
    "step": (1e-4, 1e-3, 1e-2, 1e-1, 1.0),
    "reynolds": (0.1, 1.0, 10.0, 100.0, 1000.0),
    "gap": (1e-4, 1e-3, 1e-2, 1e-1, 1.0),
}
STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.linewidth": 0.7,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
}
# Corrections up to each bound, and "more".
BOUNDS = (0, 3, 6, 12, 41)
COLOURS = ("#d1e5f0", "#92c5de", "#4393c3", "#2166ac")
FAILED = "#b2182b"
NAMES = {
    "step": "step [1/lid speed]",
    "reynolds": "Reynolds number",
    "gap": "gap to the wall [diameters]",
}
ROWS = {True: "exact added mass", False: "naive iteration"}
DOTS_PER_INCH = 200
FIGURE = Path(__file__).parents[1] / "docs/figures/stress_map.png"


@dataclass(frozen=True)
class Point:
    """A point of the map: most corrections in a step, None where a step does not converge."""

    panel: str
    exact: bool
    ratio: float
    value: float
    corrections: int | None


def points() -> Iterator[Point]:
    """All points."""
    for panel, values in PANELS.items():
        for value, ratio, exact in product(values, RATIOS, (True, False)):
            yield Point(panel, exact, ratio, value, corrections(panel, value, ratio, exact))


def draw(points: list[Point], target: Path) -> None:
    """Write the picture."""
    with rc_context(STYLE):
        figure = Figure(figsize=(10.0, 5.6), layout="constrained")
        grid = figure.subplots(2, len(PANELS), sharex=True)
        for row, exact in enumerate((True, False)):
            for column, panel in enumerate(PANELS):
                here = [p for p in points if p.panel == panel and p.exact is exact]
                shown = _panel(grid[row, column], here, PANELS[panel])
                grid[row, column].set_title(f"{ROWS[exact]}" if column == 0 else "")
                grid[row, column].set_ylabel(NAMES[panel])
            for axes in grid[1]:
                axes.set_xlabel("mass of the body over that of its fluid")
        bar = figure.colorbar(shown, ax=grid, shrink=0.6, ticks=[1.5, 4.5, 9.0, 26.5])
        bar.ax.set_yticklabels(["up to 3", "4 to 6", "7 to 12", "13 to 40"])
        bar.set_label("corrections in a step; crosses: does not converge")
        figure.savefig(target, dpi=DOTS_PER_INCH)


def _panel(axes: Axes, points: list[Point], values: tuple[float, ...]) -> object:
    table = np.full((len(values), len(RATIOS)), np.nan)
    for p in points:
        if p.corrections is not None:
            table[values.index(p.value), RATIOS.index(p.ratio)] = p.corrections + 0.5
    colours = ListedColormap(COLOURS)
    colours.set_bad("#f7e3e3")
    norm = BoundaryNorm([b + 0.75 * (b > 0) for b in BOUNDS], len(COLOURS))
    shown = axes.pcolormesh(
        np.ma.masked_invalid(table), cmap=colours, norm=norm, edgecolor="white", linewidth=1.2
    )
    rows, columns = np.nonzero(np.isnan(table))
    axes.plot(columns + 0.5, rows + 0.5, "x", color=FAILED, markersize=6, markeredgewidth=1.4)
    for i, j in zip(*np.nonzero(~np.isnan(table)), strict=True):
        tone = "white" if table[i, j] > 6 else "#333333"
        axes.text(
            j + 0.5,
            i + 0.5,
            f"{table[i, j] - 0.5:.0f}",
            ha="center",
            va="center",
            color=tone,
            fontsize=7,
        )
    axes.set_xticks(np.arange(len(RATIOS)) + 0.5, [_power(r) for r in RATIOS])
    axes.set_yticks(np.arange(len(values)) + 0.5, [_power(v) for v in values])
    axes.tick_params(length=0, labelsize=7)
    return shown


def _power(value: float) -> str:
    if value == 0.0:
        return "0"
    exponent = round(float(np.log10(value)))
    return f"{value:g}" if -1 <= exponent <= 1 else f"$10^{{{exponent}}}$"


if __name__ == "__main__":
    draw(list(points()), FIGURE)

"""The map of where a body's step can be solved: exact coupling above, the naive iteration below.

Run:     make stress
Results: docs/figures/stress_map.png
"""

from __future__ import annotations

import numpy as np
from hard import corrections
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from pictures import FIGURES, drawn

RATIOS = (0.0, 1e-6, 1e-3, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e6)
# What goes upwards in each panel; in the others it is as usual.
PANELS: dict[str, tuple[float, ...]] = {
    "step": (1e-4, 1e-3, 1e-2, 1e-1, 1.0),
    "reynolds": (0.1, 1.0, 10.0, 100.0, 1000.0),
    "gap": (1e-4, 1e-3, 1e-2, 1e-1, 1.0),
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


def most(panel: str, exact: bool) -> np.ndarray:
    """Most corrections in a step (values, ratios); NaN where a step does not converge."""
    counts = [
        [corrections(panel, value, ratio, exact) for ratio in RATIOS] for value in PANELS[panel]
    ]
    return np.array(counts, dtype=float)


def main() -> None:
    """Solve all steps and draw."""
    counts = {(exact, panel): most(panel, exact) for exact in ROWS for panel in PANELS}
    size, columns = (10.0, 5.6), len(PANELS)
    with drawn(FIGURES / "stress_map.png", size, 2, columns, sharex=True) as (figure, panels):
        for axes, ((exact, panel), table) in zip(panels.flat, counts.items(), strict=True):
            shown = _draw(axes, table, PANELS[panel])
            axes.set_ylabel(NAMES[panel])
            if axes in panels[:, 0]:
                axes.set_title(ROWS[exact])
        for axes in panels[1]:
            axes.set_xlabel("mass of the body over that of its fluid")
        bar = figure.colorbar(shown, ax=panels, shrink=0.6, ticks=[1.5, 4.5, 9.0, 26.5])
        bar.ax.set_yticklabels(["up to 3", "4 to 6", "7 to 12", "13 to 40"])
        bar.set_label("corrections in a step; crosses: does not converge")


def _draw(axes: Axes, counts: np.ndarray, values: tuple[float, ...]) -> ScalarMappable:
    colours = ListedColormap(COLOURS)
    colours.set_bad("#f7e3e3")
    norm = BoundaryNorm([b + 0.75 * (b > 0) for b in BOUNDS], len(COLOURS))
    shown = axes.pcolormesh(
        np.ma.masked_invalid(counts + 0.5), cmap=colours, norm=norm, edgecolor="white", lw=1.2
    )
    for (i, j), count in np.ndenumerate(counts):
        place = j + 0.5, i + 0.5
        if np.isnan(count):
            axes.plot(*place, "x", color=FAILED, markersize=6, markeredgewidth=1.4)
        else:
            tone = "white" if count > 5.5 else "#333333"
            axes.text(*place, f"{count:.0f}", ha="center", va="center", color=tone, fontsize=7)
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
    main()

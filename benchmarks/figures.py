"""The figures of the benchmark page."""

from __future__ import annotations

from typing import Any

import numpy as np
from pictures import FIGURES, drawn, plain
from references import VORTEX_STREET
from tables import Row

from incipient.pictures import style

COLOURS = {
    "100": "#1b7837",
    "400": "#4393c3",
    "1000": "#2166ac",
    "3200": "#b2182b",
    "4000": "#762a83",
}
MARKERS = {"100": "o", "400": "s", "1000": "^", "3200": "D", "4000": ""}
GHIAS: dict[str, Any] = {"linestyle": "none", "markersize": 3.8, "markerfacecolor": "white"}
PERIODS = 4.0  # of the lift, each about a third of a time unit


def cavity(profiles: dict[str, Row]) -> None:
    """Both profiles for all Reynolds numbers: lines ours, markers Ghia's."""
    with drawn(FIGURES / "cavity.png", (9.0, 4.7), columns=2) as (_, panels):
        left, right = panels[0]
        for reynolds, profile in profiles.items():
            positions, lines, points = profile["positions"], profile["lines"], profile["points"]
            # Without markers of its own and close to the one before.
            dashes: Any = "-" if points else (0, (4, 1.5))
            colour = COLOURS[reynolds]
            left.plot(lines["u"], positions, color=colour, ls=dashes, label=f"Re = {reynolds}")
            right.plot(positions, lines["v"], color=colour, ls=dashes)
            printed = {
                line: np.array(
                    [[p["position"], p["value"]] for p in points if p["line"] == line]
                ).reshape(-1, 2)
                for line in ("u", "v")
            }
            marks = {"color": colour, "marker": MARKERS[reynolds], **GHIAS}
            left.plot(*printed["u"].T[::-1], **marks)
            right.plot(*printed["v"].T, **marks)
        left.plot([], [], color="#555555", marker="o", label="Ghia et al. (1982)", **GHIAS)
        left.set(xlabel="u / lid speed", ylabel="y", title="u on the upright centreline x = 0.5")
        right.set(xlabel="x", ylabel="v / lid speed", title="v on the level centreline y = 0.5")
        left.set(ylim=(0, 1))
        right.set(xlim=(0, 1))
        left.legend(loc="lower right", title="lines: incipient, P4-P3", alignment="left")
        plain(panels)


def vortex_street(history: dict[str, list[float]]) -> None:
    """Drag and lift since the start, and over the last periods."""
    times = np.array(history["time"])
    late, settled = times > times[-1] - PERIODS / 3.0, times > 0.2
    target, widths = FIGURES / "vortex_street.png", (1.4, 1)
    with drawn(target, (9.0, 4.2), rows=2, columns=2, width_ratios=widths) as (_, panels):
        for (whole, last), name, symbol, colour in zip(
            panels, ("drag", "lift"), ("C_D", "C_L"), (style.PUSH, style.FLOW), strict=True
        ):
            values = np.array(history[name])
            whole.plot(times[settled], values[settled], color=colour, linewidth=0.9)
            last.plot(times[late], values[late], color=colour)
            last.axhspan(
                *VORTEX_STREET[name], color="#dddddd", label="maximum, Schäfer & Turek (1996)"
            )
            whole.set_ylabel(f"${symbol}$", rotation=0, labelpad=12)
            whole.set_xlim(0, times[-1])
            last.set_xlim(times[late][0], times[-1])
        drag = np.array(history["drag"])[late]
        panels[0, 1].set_ylim(drag.min() - 0.4 * np.ptp(drag), drag.max() + 0.15 * np.ptp(drag))
        panels[0, 1].legend(loc="lower left")
        panels[0, 0].set_title("From rest")
        panels[0, 1].set_title("The last periods")
        for axes in panels[1]:
            axes.set_xlabel("t [scene units]")
        plain(panels)

"""Axes of pictures of sweeps, their scales and names, and the curve of Soulsby and Whitehouse.

The curve (1997) stands beside the critical Shields numbers for comparison: it fits measurements of beds of many grains
in turbulent flow, the computed ones are of one grain in a steady flow (docs/validation/shields.md).
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...flumes.thresholds import soulsby_whitehouse

ONE_GRAIN_AND_BEDS = (
    "Points: one grain in a steady flow without gusts; incipient entrainment gives its number by probability. "
    "Dashed: a fit to what was seen of beds of many grains in turbulent flow, at no stated probability."
)
_NAMES = {
    "shields": "critical Shields number (largest diameter)",
    "shields_nominal": "critical Shields number (nominal diameter)",
    "reynolds": "critical Reynolds number",
}
MARKERS = ("o", "s", "D", "^", "v", "P", "X", "*")
COLOURS = ("#2166ac", "#d95f0e", "#1b7837", "#6a3d9a", "#b2182b", "#858585", "#c51b7d", "#7a5c2e")
_WIDE, _HIGH = 7.2, 5.0  # inches
_DECADE = 8.0  # ratio of largest to smallest value from which a scale is logarithmic
_DIMENSIONLESS = np.geomspace(1.0, 400.0, 200)  # diameters D* of the curve


def figure_of(sources: Iterable[str], title: str, note: str = "") -> tuple[Figure, Axes]:
    """Figure and axes with a title that names the sources of the cases, and a note below."""
    figure = Figure(figsize=(_WIDE, _HIGH), layout="constrained")
    axes = figure.subplots()
    axes.set_title(f"{title}  ({', '.join(dict.fromkeys(sources))})")
    axes.grid(color="#e2e2e2", lw=0.5)
    axes.set_axisbelow(True)
    if note:
        figure.supxlabel(textwrap.fill(note, 105), fontsize=8, x=0.02, ha="left")
    return figure, axes


def legend(axes: Axes, by: str | None, place: str = "best") -> None:
    """A legend where something has a label, headed by the column that the labels are of."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(
            title=by and name_of(by), fontsize=8, title_fontsize=8, loc=place, framealpha=0.9
        )


def beside_soulsby_whitehouse(axes: Axes) -> None:
    """Draw their curve, and name the axes."""
    shields = soulsby_whitehouse(_DIMENSIONLESS)
    reynolds = np.sqrt(shields * _DIMENSIONLESS**3)
    label = "Soulsby & Whitehouse (1997)"
    axes.plot(reynolds, shields, "--", color="#858585", lw=1.2, label=label, zorder=1)
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="grain Reynolds number  u* d/ν",
        ylabel=name_of("shields"),
    )


def choose_scale(set_scale: Callable[[str], object], values: Sequence[float]) -> None:
    """Choose a logarithmic scale for positive values that span much."""
    known = [value for value in values if math.isfinite(value)]
    if known and min(known) > 0.0 and max(known) > _DECADE * min(known):
        set_scale("log")


def name_of(column: str) -> str:
    """A column in words; a key of scenes is not changed."""
    return column if "." in column else _NAMES.get(column, column.replace("_", " "))

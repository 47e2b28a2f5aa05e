"""Common style of pictures: type, colours, panels."""

from __future__ import annotations

import textwrap
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure, SubFigure
from matplotlib.font_manager import FontProperties
from matplotlib.legend_handler import HandlerPatch
from matplotlib.patches import FancyArrowPatch
from matplotlib.textpath import text_to_path
from matplotlib.ticker import LogFormatterMathtext, LogLocator, NullFormatter

from ..files import part_of, replaced

DOTS_PER_INCH = 180
INK = "#22252a"
GROUND = "#b9b2a6"
GRAIN = "#e8e2d6"
FLOW = "#2166ac"
PUSH = "#b2182b"
PULL = "#2166ac"
WEIGHT = "#7a5c2e"
REACTION = "#c51b7d"
RESULTANT = "#111111"
MOTION = "#6a3d9a"
FORCES = {"flow": FLOW, "weight": WEIGHT, "resultant": RESULTANT}
_FREE, _HELD, _ROLLED, _EDGE = "#858585", "#1b7837", "#149077", "#d95f0e"
# Contact states of the exact criterion: those of forces in balance, then those of a grain that begins to move.
STATES = {
    "INSIDE": (_HELD, "held, inside its friction cone"),
    "EDGE": (_EDGE, "held, on the edge of its friction cone"),
    "UNLOADED": (_FREE, "carries no force"),
    "STICK": (_HELD, "sticks"),
    "ROLL": (_ROLLED, "rolls without slip"),
    "SLIDE": (_EDGE, "slides"),
    "LIFT": (_FREE, "lifts off"),
}
# Of curves and points, one after another.
MARKERS = ("o", "s", "D", "^", "v", "P", "X", "*")
COLOURS = ("#2166ac", "#d95f0e", "#1b7837", "#6a3d9a", "#b2182b", "#858585", "#c51b7d", "#7a5c2e")
PAPER = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.8}  # behind text
View = tuple[float, float, float, float]  # left, right, bottom, top

_SETTINGS = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "text.parse_math": False,  # a title may hold a $
    "axes.titlesize": 9.5,
    "axes.labelsize": 9,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.titlelocation": "left",
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "figure.facecolor": "white",
    "figure.constrained_layout.w_pad": 0.1,
    "figure.constrained_layout.h_pad": 0.08,
    "legend.edgecolor": "none",
    "legend.framealpha": 0.85,  # over lines of a chart
    "legend.fontsize": 8,
}


def applied() -> AbstractContextManager[None]:
    """Apply this style inside a block."""
    return rc_context(_SETTINGS)


def number_plainly(figure: Figure) -> None:
    """Label logarithmic axes without labels of their own without powers, short ones also at 2 and 5 of a decade."""
    for axis in figure.findobj(Axis):
        if isinstance(axis.get_major_formatter(), LogFormatterMathtext):
            axis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
            low, high = axis.get_view_interval()
            # Over more decades labels of up to six digits do not fit side by side.
            axis.set_minor_formatter("{x:g}" if high <= 1e3 * low else NullFormatter())
            axis.set_major_formatter("{x:g}")


def save(figure: Figure, path: Path) -> None:
    """Write a picture as PNG. Raises OutputError: not writable, or a foreign file has this name."""
    number_plainly(figure)
    with replaced(path, part_of(path)) as part:
        figure.savefig(part, format="png", dpi=DOTS_PER_INCH, pil_kwargs={"compress_level": 3})


def panels(views: list[View], title: str, up: str = "y") -> tuple[Figure, list[Axes]]:
    """A titled figure with axes true to scale for each view, wide views above each other.

    up: name of the vertical axis
    """
    aspects = np.array([(y1 - y0) / (x1 - x0) for x0, x1, y0, y1 in views])
    heights = np.minimum(4.6, 7.2 * aspects)  # inches
    size = (heights / aspects).max() + 1.8, (heights + 0.65).sum() + 0.35
    figure = Figure(figsize=size, layout="compressed")
    headline(figure, title)
    grid = figure.subplots(len(views), 1, squeeze=False, height_ratios=heights.tolist())
    all_axes: list[Axes] = grid.ravel().tolist()
    for axes, view in zip(all_axes, views, strict=True):
        axes.set(xlim=view[:2], ylim=view[2:], aspect="equal")
        axes.set(xlabel="x [scene units]", ylabel=f"{up} [scene units]")
    return figure, all_axes


def chart(title: str, size: tuple[float, float] = (6.4, 4.6), **looks: Any) -> tuple[Figure, Axes]:
    """A titled figure of a size [inches] with axes and a grid; `looks`: of `Axes.set`."""
    figure = Figure(figsize=size, layout="constrained")
    headline(figure, title)
    axes = figure.subplots()
    axes.grid(color="#e2e2e2", lw=0.5)
    axes.set(axisbelow=True, **looks)
    return figure, axes


def headline(figure: Figure, title: str, weight: str = "normal") -> None:
    """Write a title above a figure, wrapped to its width."""
    lines = wrapped(title, 0.96 * figure.get_figwidth(), 11, weight)
    figure.set_figheight(figure.get_figheight() + 0.2 * (len(lines) - 1))
    figure.suptitle("\n".join(lines), x=0.012, ha="left", fontsize=11, weight=weight)


def wrapped(text: str, width: float, size: float, weight: str = "normal") -> list[str]:
    """Lines of a text no wider than this [inches] in a font of this size [points], broken within words if need be."""
    measured, most = text_to_path.get_text_width_height_descent, max(len(text), 1)
    font, lines = FontProperties(size=size, weight=weight), textwrap.wrap(text, most)
    while any(measured(line, font, ismath=False)[0] > 72.0 * width for line in lines):
        most -= 1 + most // 50
        lines = textwrap.wrap(text, most)
    return lines


def explain(figure: Figure | SubFigure, **looks: Any) -> None:
    """Add a legend of all labelled artists of a figure, with each label once and arrows as arrows."""
    marks: dict[str, Artist] = {}
    for axes in figure.axes:
        artists, labels = axes.get_legend_handles_labels()
        marks |= dict(zip(labels, artists, strict=True))
    arrow = HandlerPatch(
        lambda width, height, **_: FancyArrowPatch(
            (0.0, height / 2), (width, height / 2), arrowstyle="-|>", mutation_scale=9
        )
    )
    figure.legend(marks.values(), marks, handler_map={FancyArrowPatch: arrow}, **looks)

"""The look that all pictures share: type, colours, and panels that fit what they show."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.text import Text

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
# Contact states of the exact judge: those of forces in balance, then those of a grain that begins to move.
STATES = {
    "INSIDE": (_HELD, "held, inside its friction cone"),
    "EDGE": (_EDGE, "held, on the edge of its friction cone"),
    "UNLOADED": (_FREE, "carries no force"),
    "STICK": (_HELD, "sticks"),
    "ROLL": (_ROLLED, "keeps its place while the grain turns"),
    "SLIDE": (_EDGE, "slides"),
    "LIFT": (_FREE, "lifts off"),
}
PAPER = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.8}  # behind text
View = tuple[float, float, float, float]  # left, right, bottom, top
Looks = dict[str, Any]  # of what is drawn, in matplotlib's words

_SETTINGS = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
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
    "legend.frameon": False,
    "legend.fontsize": 8,
}
_WIDTH, _LEFT, _RIGHT, _TOP, _BOTTOM, _GAP = 9.0, 0.65, 1.1, 0.75, 0.5, 0.75  # inches
_TALLEST = 4.6  # inches
_LETTER, _HEADLINE = 0.088, 0.2  # width and height of a letter of the title, inches


@contextmanager
def applied() -> Iterator[None]:
    """Draw in this style inside the block."""
    with rc_context(_SETTINGS):
        yield


def show_as_written(figure: Figure) -> None:
    """Let matplotlib take no text for mathematics but the labels of logarithmic axes: a title may hold a $."""
    powers: set[Text] = set()
    for axis in figure.findobj(Axis):
        labels = axis.get_ticklabels(which="both")  # those of all axes are made here
        powers.update(labels if axis.get_scale() == "log" else ())
    for text in figure.findobj(Text):
        text.set_parse_math(text in powers)


def save(figure: Figure, path: Path) -> None:
    """Write a picture as PNG. Raises OutputError: it cannot be written, or would replace a file of somebody else."""
    show_as_written(figure)
    with replaced(path, part_of(path)) as part:
        figure.savefig(part, format="png", dpi=DOTS_PER_INCH, pil_kwargs={"compress_level": 3})


def panels(views: list[View], title: str) -> tuple[Figure, list[tuple[Axes, Axes]]]:
    """A figure with, for each view, axes true to scale and axes for a colour bar on their right.

    Wide views stand one above the other, others side by side.
    """
    aspects = np.array([(y1 - y0) / (x1 - x0) for x0, x1, y0, y1 in views])
    stacked = len(views) == 1 or aspects[0] <= 0.6
    figure, places = _stack(aspects) if stacked else _row(aspects)
    lines = textwrap.wrap(title, int((figure.get_figwidth() - _LEFT) / _LETTER))
    figure.set_figheight(figure.get_figheight() + _HEADLINE * (len(lines) - 1))
    left, top = _LEFT / figure.get_figwidth(), 1 - 0.22 / figure.get_figheight()
    figure.text(left, top, "\n".join(lines), fontsize=11, va="top")
    made = []
    for view, (left, bottom, across, up) in zip(views, places, strict=True):
        axes = placed(figure, left, bottom, across, up)
        axes.set(xlim=view[:2], ylim=view[2:], xlabel="x [scene units]", ylabel="y [scene units]")
        made.append((axes, placed(figure, left + across + 0.12, bottom, 0.14, up)))
    return figure, made


def _stack(aspects: np.ndarray) -> tuple[Figure, list[tuple[float, float, float, float]]]:
    room = _WIDTH - _LEFT - _RIGHT
    widths = np.minimum(room, _TALLEST / aspects)
    heights = widths * aspects
    total = _TOP + heights.sum() + _GAP * (len(aspects) - 1) + _BOTTOM
    tops = total - _TOP - np.concatenate([[0.0], np.cumsum(heights + _GAP)[:-1]])
    places = [(_LEFT, top - h, w, h) for top, w, h in zip(tops, widths, heights, strict=True)]
    return Figure(figsize=(_LEFT + widths.max() + _RIGHT, total)), places


def _row(aspects: np.ndarray) -> tuple[Figure, list[tuple[float, float, float, float]]]:
    height = _TALLEST
    widths = height / aspects
    lefts = _LEFT + np.concatenate([[0.0], np.cumsum(widths + _RIGHT + _LEFT)[:-1]])
    places = [(left, _BOTTOM, width, height) for left, width in zip(lefts, widths, strict=True)]
    return Figure(figsize=(lefts[-1] + widths[-1] + _RIGHT, _TOP + height + _BOTTOM)), places


def placed(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Axes at a place given in inches."""
    across, up = figure.get_size_inches()
    return figure.add_axes((left / across, bottom / up, width / across, height / up))

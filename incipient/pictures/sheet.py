"""Sheet of a verdict: sentences above, drawing on the left, numbers on the right."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .style import FLOW, INK, MOTION, RESULTANT, WEIGHT, Looks

# Colours of numbers that the drawing shows.
_COLOURS = {
    "force of the flow": FLOW,
    "torque about the centre": FLOW,
    "submerged weight": WEIGHT,
    "resultant": RESULTANT,
    "acceleration": MOTION,
    "angular acceleration": MOTION,
}
_WIDTH = 9.4  # inches, as all below
_MARGIN, _EDGE = 0.78, 0.2
_ACROSS, UP = 5.3, 4.4  # the drawing; renderings of space have its proportions
_COLUMN = 6.36  # where the numbers begin
_BELOW = 1.3  # axis labels and the legend
_LINE, _ROW = 0.21, 0.172
_MOST = 43  # characters of a name and its value in one row


def sheet(first: str, second: str, subject: str, up: float = UP) -> tuple[Figure, Axes]:
    """Figure with a bold text, a plain text and a subject; axes of height `up` [inches]."""
    bold, plain = textwrap.wrap(first, 94), textwrap.wrap(second, 134)
    about = textwrap.wrap(subject, 76)
    top = 0.25 + _LINE * (len(bold) + 0.8 * len(plain)) + 0.33 + 0.15 * (len(about) - 1)
    height = top + up + _BELOW
    figure = Figure(figsize=(_WIDTH, height))
    left = _MARGIN / _WIDTH
    figure.text(left, 1 - 0.17 / height, "\n".join(bold), fontsize=11.5, weight="bold", va="top")
    below = 1 - (0.22 + _LINE * len(bold)) / height
    figure.text(left, below, "\n".join(plain), fontsize=9, va="top", linespacing=1.3)
    axes = figure.add_axes((left, _BELOW / height, _ACROSS / _WIDTH, up / height))
    axes.set_title("\n".join(about), fontsize=9, color="#555a61")
    return figure, axes


def write_numbers(axes: Axes, tables: Mapping[str, Mapping[str, Any]], below: float = 0.12) -> None:
    """Write tables of numbers by label beside the drawing, from a distance [inches] below its top."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    height = figure.get_figheight()
    row = height * axes.get_position().y1 - below
    for heading, table in tables.items():
        looks: Looks = {"fontsize": 8, "va": "center", "weight": "bold"}
        for name, value in {heading: "", **table}.items():
            words, colour = _words(value), _COLOURS.get(name, INK)
            figure.text(_COLUMN / _WIDTH, row / height, name, color=colour, **looks)
            looks["weight"] = "normal"
            if len(name) + len(words) > _MOST:
                row -= _ROW  # the value has a line of its own
            figure.text(1 - _EDGE / _WIDTH, row / height, words, ha="right", **looks)
            row -= _ROW
        row -= 0.5 * _ROW


def panel(axes: Axes, height: float) -> Axes:
    """Axes of a height [inches] at the top of the column of numbers."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    share, left = height / figure.get_figheight(), _COLUMN + 0.42
    width = (_WIDTH - _EDGE - left) / _WIDTH
    return figure.add_axes((left / _WIDTH, axes.get_position().y1 - share, width, share))


def _words(value: Any) -> str:
    """A word, a number, or a vector without round-off."""
    if isinstance(value, str):
        return value
    if np.ndim(value) == 0:
        return "∞" if value == np.inf else f"{value:.4g}".replace("-", "−")
    size = np.abs(value).max(initial=0.0)
    shown = (0.0 if abs(part) <= 1e-9 * size else part for part in value)
    return f"({', '.join(f'{part:.{6 - len(value)}g}' for part in shown)})".replace("-", "−")

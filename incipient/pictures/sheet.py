"""Sheet of a verdict: sentences above, drawing on the left, numbers on the right."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .judged import Judged, pressed
from .style import FLOW, FORCES, INK, MOTION, STATES, Looks

Row = tuple[str, str, str]  # name, value, colour of the name
Group = list[Row]  # the first row is a heading

_WIDTH = 9.4  # inches, as all below
_MARGIN, _EDGE = 0.78, 0.2
_ACROSS, UP = 5.3, 4.4  # the drawing; renderings of space have its proportions
_COLUMN = 6.36  # where the numbers begin
_BELOW = 1.3  # axis labels and the legend
_LINE, _ROW = 0.21, 0.172
_LETTERS, _MOST = 8, 43  # of the numbers: points; characters of a name and its value in one row
_MOST_CONTACTS = 4
_NAMES = {"flow": "Force of the flow", "weight": "Weight less buoyancy", "resultant": "Resultant"}


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


def explain(axes: Axes, marks: Sequence[tuple[Artist, str]]) -> None:
    """Write the legend below the drawing."""
    handles, labels = [mark for mark, _ in marks], [label for _, label in marks]
    _figure_of(axes).legend(
        handles, labels, loc="lower left", ncols=2, fontsize=8, columnspacing=2.5, handlelength=2.2,
        bbox_to_anchor=(_MARGIN / _WIDTH, 0.0), borderpad=0, borderaxespad=0.9, labelspacing=0.5,
    )  # fmt: skip


def write_numbers(axes: Axes, groups: Iterable[Group], below: float = 0.12) -> None:
    """Write groups of numbers beside the drawing, from a distance [inches] below its top."""
    figure = _figure_of(axes)
    height = figure.get_figheight()
    row = height * axes.get_position().y1 - below
    for group in filter(None, groups):
        for number, (name, value, colour) in enumerate(group):
            weight, value = "normal" if number else "bold", value.replace("-", "−")
            looks: Looks = {"fontsize": _LETTERS, "va": "center"}
            figure.text(_COLUMN / _WIDTH, row / height, name, color=colour, weight=weight, **looks)
            if len(name) + len(value) > _MOST:
                row -= _ROW  # the value has a line of its own
            figure.text(1 - _EDGE / _WIDTH, row / height, value, ha="right", **looks)
            row -= _ROW
        row -= 0.5 * _ROW


def panel(axes: Axes, height: float) -> Axes:
    """Axes of a height [inches] at the top of the column of numbers."""
    figure = _figure_of(axes)
    share, left = height / figure.get_figheight(), _COLUMN + 0.42
    width = (_WIDTH - _EDGE - left) / _WIDTH
    return figure.add_axes((left / _WIDTH, axes.get_position().y1 - share, width, share))


def _figure_of(axes: Axes) -> Figure:
    figure = axes.figure
    assert isinstance(figure, Figure)
    return figure


def load_rows(forces: dict[str, np.ndarray], torque: np.ndarray, unit: str, planar: bool) -> Group:
    """Forces by name (see `Judged.acting`) and the flow's torque about the centre."""
    rows = [(_NAMES[name], vector(force, planar), FORCES[name]) for name, force in forces.items()]
    about = ("Torque about the centre", turning(torque, planar), FLOW)
    return [("Load on the grain", unit, INK), *rows, about]


def judge_rows(case: Judged) -> list[Group]:
    """Outcome of the exact criterion, contact forces, outcome of the paper's criteria."""
    planar = case.planar
    exact: Group = [
        ("Exact criterion", case.mode, INK),
        ("Safety factor on the flow", number(case.safety_factor), INK),
        ("Coefficient of static friction", f"{case.friction:.4g}", INK),
    ]
    if case.motion is not None:
        exact.append(("Acceleration", vector(case.motion.acceleration, planar), MOTION))
        exact.append(("Angular acceleration", turning(case.motion.angular, planar), MOTION))
    force, torque = case.left or (np.zeros(3), np.zeros(3))
    paper: Group = [
        ("The paper's criteria", f"row {case.outcome.split(':')[0]} of its table", INK),
        ("Residual force", vector(force, planar), INK),
        ("Residual torque", turning(torque, planar), INK),
    ]
    return [exact, contact_rows(case), paper]


def contact_rows(case: Judged) -> Group:
    """Normal and tangential contact forces."""
    normal, tangential = pressed(case.forces, case.contacts.normals)
    normal[normal <= 1e-12 * normal.max(initial=0.0)] = 0.0
    rows: Group = [("Contact forces", "normal, tangential/normal", INK)]
    for index, state in enumerate(case.states[:_MOST_CONTACTS]):
        name = f"{index + 1}: {state.lower()}" + (
            ", significant" if index in case.significant else ""
        )
        ratio = f"{tangential[index] / normal[index]:.3f}" if normal[index] > 0 else "–"
        rows.append((name, f"{normal[index]:.4g},  {ratio}", STATES[state][0]))
    if len(case.states) > _MOST_CONTACTS:
        rows.append((f"and {len(case.states) - _MOST_CONTACTS} more", "", INK))
    return rows


def vector(components: np.ndarray, planar: bool) -> str:
    """Components in brackets, without round-off."""
    size = np.abs(components).max(initial=0.0)
    shown = [0.0 if abs(c) <= 1e-9 * size else c for c in components[: 2 if planar else 3]]
    return f"({', '.join(f'{c:.4g}' if planar else f'{c:.3g}' for c in shown)})"


def turning(torque: np.ndarray, planar: bool) -> str:
    """A torque, in 2-D its one component."""
    return f"{torque[2]:.4g}" if planar else vector(torque, planar)


def number(value: float) -> str:
    """A number, or the sign of infinity."""
    return "∞" if value == np.inf else f"{value:.4g}"

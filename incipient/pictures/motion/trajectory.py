"""The picture of a moving grain: its path through the domain, and place and velocities against time.

A grain in space is seen from the side, along the width: its path, its silhouette, and the bed below where it starts;
place and spin are shown against time.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.ticker import FuncFormatter, MaxNLocator

from ...errors import OutputError
from ...geometry.placement import Placement
from ...planning.flow_setup import Setup
from ...scene import Domain, Scene, load
from .. import style
from ..style import GRAIN, INK, View
from ..verdict.outlines import grain_outline, grain_silhouette
from ..verdict.plane import draw_bed
from .contact_forces import ContactForces, contact_forces
from .history import RATES, History, read_history

# Early to late; the palest part of the map would be lost on white.
_COLOURS = ListedColormap(colormaps["viridis_r"](np.linspace(0.12, 1.0, 256)), "moments")
_COARSE = 0.05  # of the size of a grain in space: distance of the points among which its axis ends
_SEGMENTS, _BED_PIECES = 3000, 800  # of the path, and of the bed; more cannot be told apart
_MOMENTS, _APART = (
    21,
    0.45,
)  # at which the grain may be drawn; least distance of two drawings [grain sizes]
_LEAST = 1e-3  # of its largest value: smaller changes of a quantity are shown as small
_FEW_TURNS = 3.0  # up to which the angle is shown in degrees
_NEAR = 0.5  # of the domain: a path of smaller extent is shown enlarged beside it
# Inches. A drawing in its axes, the axes of one quantity, and what is between and around them.
_UP, _ACROSS, _WIDEST = 4.3, 5.2, 7.6
_PANEL_ACROSS, _PANEL_UP, _BESIDE, _ABOVE = 2.0, 1.12, 0.62, 0.36
_LEFT, _TOP, _BOTTOM, _BAR, _AXIS = 0.65, 0.85, 0.75, 0.95, 0.62

Place = tuple[float, float, float, float]  # left, bottom, width, height in inches
Mark = tuple[Artist, str]  # in the legend
Shown = tuple[str, np.ndarray, float]  # title, values (n,), smallest range of the axis


def draw(directory: Path, title: str = "") -> list[Path]:
    """Draw trajectory.png from the history.csv and scene.toml of a directory. Not collective.

    Raises:
        OutputError: when one of them is missing or damaged, or the picture cannot be written.
    """
    path = directory / "trajectory.png"
    scene = load(directory / "scene.toml")
    first = Setup(scene).geometry.stance.placement
    if scene.grain is None or first is None:
        raise OutputError(f"{directory / 'scene.toml'}: has no grain; run the scene again")
    history = read_history(directory / "history.csv").started(first)
    with style.applied():
        contacts = contact_forces(directory, scene.contact)
        style.save(figure(scene, history, title or scene.title, contacts), path)
    return [path]


@dataclass(frozen=True)
class _Look:
    """How a grain is drawn."""

    edge: Any
    width: float
    order: float
    face: str = "none"
    dashes: Any = "solid"


def figure(
    scene: Scene, history: History, title: str, contacts: ContactForces | None = None
) -> Figure:
    """The path in the domain, enlarged if it is short, beside or above six quantities against time.

    In the larger drawing the grain has its forces of contact, in their friction cones.
    """
    grain, start, bed = scene.grain, scene.placement, scene.bed_shape
    assert grain is not None and start is not None
    ground = None if bed is None else _ground(scene.domain, bed, start)
    above = scene.domain.kind == "box" or scene.top == "wall"
    walls = above, above or scene.flow.kind == "open-channel"
    views = _views(scene.domain, ground, grain.size, history)
    made, maps, bar, panels = _laid_out(views)
    width, height = made.get_size_inches()
    heading = textwrap.wrap(title, int(width * 11))[:2]
    made.text(_LEFT / width, 1 - 0.2 / height, "\n".join(heading), fontsize=11, va="top")
    norm = Normalize(*_span(history))
    names = (
        ("Path of the grain",)
        if len(maps) == 1
        else ("Whole domain", "Path of the grain, enlarged")
    )
    for axes, view, name in zip(maps, views, names, strict=True):
        upwards = f"{'xyz'[scene.up]} [scene units]"
        axes.set(xlim=view[:2], ylim=view[2:], xlabel="x [scene units]", ylabel=upwards, title=name)
        _draw_domain(axes, scene.domain, walls, ground)
        marks = _draw_path(axes, grain, history, norm)
    if contacts is not None:
        marks += _draw_contacts(maps[-1], contacts, grain.size, history)
    made.colorbar(ScalarMappable(norm, _COLOURS), cax=bar).set_label("time [scene units]")
    new = _draw_quantities(
        panels, _quantities(history, grain.size, scene.reference_velocity), history
    )
    handles, labels = zip(*marks, *new, strict=True)
    made.legend(
        handles, labels, loc="lower left", ncols=6, fontsize=8, borderpad=0, borderaxespad=0,
        bbox_to_anchor=(_LEFT / width, 0.12 / height), columnspacing=1.4, handlelength=1.6,
    )  # fmt: skip
    return made


def _span(history: History) -> tuple[float, float]:
    """First and last time, not the same."""
    first, last = float(history.times[0]), float(history.times[-1])
    return first, last if last > first else first + 1.0


def _views(domain: Domain, ground: np.ndarray | None, size: float, history: History) -> list[View]:
    """The domain and, if a grain of a size stays in a small part of it, that part."""
    pad = 0.015 * max(domain.length, domain.height)
    floor = domain.bottom if ground is None else ground[:, 1].min()
    whole = (domain.left - pad, domain.right + pad, float(floor) - pad, domain.ceiling + pad)
    low, high = history.centres.min(axis=0) - 0.7 * size, history.centres.max(axis=0) + 0.7 * size
    across, up = high - low
    if max(across / domain.length, up / domain.height) >= _NEAR:
        return [whole]
    across, up = max(across, 0.8 * up), max(up, 0.6 * across)
    x, y = (low + high) / 2
    return [whole, (x - across / 2, x + across / 2, y - up / 2, y + up / 2)]


def _laid_out(views: Sequence[View]) -> tuple[Figure, list[Axes], Axes, list[Axes]]:
    """The sheet, axes for each view, for the colour bar, and for x, y, angle and their rates, in this order."""
    aspects = np.array([(y1 - y0) / (x1 - x0) for x0, x1, y0, y1 in views])
    beside = len(views) == 1 and aspects[0] > 0.55
    most = _ACROSS if beside else _UP if len(views) > 1 else _WIDEST
    widths = np.minimum(most, _UP * np.maximum(aspects / 2, 1) / aspects)
    heights = widths * aspects
    lefts = _LEFT + np.concatenate([[0.0], np.cumsum(widths + _AXIS + 0.1)[:-1]])
    end, up = float(lefts[-1] + widths[-1]), float(heights.max())
    size, panels = _panels_beside(end, up) if beside else _panels_below(end, up)
    made, top = Figure(figsize=size), size[1] - _TOP
    maps = [(x, top - h, w, h) for x, w, h in zip(lefts, widths, heights, strict=True)]
    bar = (end + 0.12, top - heights[-1], 0.14, heights[-1])
    axes = [style.placed(made, *place) for place in (*maps, bar, *panels)]
    return made, axes[: len(maps)], axes[len(maps)], axes[len(maps) + 1 :]


def _panels_beside(end: float, up: float) -> tuple[tuple[float, float], list[Place]]:
    """Size of the sheet and places of the quantities on the right of drawings: rates beside what they change."""
    panel_up = max(_PANEL_UP, (up - 2 * _ABOVE) / 3)
    high = 3 * panel_up + 2 * _ABOVE
    left, bottom = end + _BAR + 0.45, _BOTTOM + max(up - high, 0.0)
    columns = [left + column * (_PANEL_ACROSS + _BESIDE) for column in range(2)]
    rows = [bottom + row * (panel_up + _ABOVE) for row in (2, 1, 0)]
    places = [(x, y, _PANEL_ACROSS, panel_up) for x in columns for y in rows]
    return (left + 2 * _PANEL_ACROSS + _BESIDE + 0.25, _BOTTOM + max(up, high) + _TOP), places


def _panels_below(end: float, up: float) -> tuple[tuple[float, float], list[Place]]:
    """Size of the sheet and places of the quantities below drawings: rates below what they change."""
    width = max(end + _BAR, _WIDEST)
    across = (width - _LEFT - 0.25 - 2 * _BESIDE) / 3
    places = [
        (
            _LEFT + column * (across + _BESIDE),
            _BOTTOM + row * (_PANEL_UP + _ABOVE),
            across,
            _PANEL_UP,
        )
        for row in (1, 0)
        for column in range(3)
    ]
    return (width, _BOTTOM + 2 * _PANEL_UP + 2 * _ABOVE + _AXIS + up + _TOP), places


def _draw_domain(
    axes: Axes, domain: Domain, walls: tuple[bool, bool], ground: np.ndarray | None
) -> None:
    """Walls, which may be above and below, as full lines, open sides as broken ones, the bed with its ground."""
    left, right, low, high = domain.left, domain.right, domain.bottom, domain.ceiling
    closed = domain.kind == "box"
    sides = [
        ((left, left), (low, high), closed),
        ((right, right), (low, high), closed),
        ((left, right), (high, high), walls[0]),
    ]
    if ground is None:
        sides.append(((left, right), (low, low), walls[1]))
    else:
        draw_bed(axes, ground)
    for x, y, wall in sides:
        line = (
            Line2D(x, y, color=INK, lw=1.4)
            if wall
            else Line2D(x, y, color=INK, lw=0.7, ls=(0, (4, 3)))
        )
        line.set_zorder(3)
        axes.add_artist(line)


def _ground(domain: Domain, bed: Any, start: Placement) -> np.ndarray:
    """Points (n, 2) along the bed from left to right, in space below where the grain starts."""
    if domain.gdim == 3:
        x = np.linspace(domain.left, domain.right, _BED_PIECES)
        return np.column_stack(
            [x, bed.height(np.column_stack([x, np.full_like(x, start.centre[1])]))]
        )
    curves = bed.curves(domain.left, domain.right)
    counts = [max(8, int(_BED_PIECES * curve.length / domain.length)) for curve in curves]
    return np.vstack(
        [curve.point(np.linspace(0.0, 1.0, n)) for curve, n in zip(curves, counts, strict=True)]
    )


def _draw_path(axes: Axes, grain: Any, history: History, norm: Normalize) -> list[Mark]:
    """The centre's path and the grain at several moments, in the colour of their time; what the marks mean."""
    colour = ScalarMappable(norm, _COLOURS).to_rgba
    first, *between, last = _moments(grain.size, history)
    for time in between:
        _draw_grain(axes, grain, history.at(time), _Look(colour(np.array(time)), 0.8, 4.0))
    end = _draw_grain(axes, grain, history.at(last), _Look(INK, 1.7, 4.5, face=GRAIN))
    # Above the end and broken: both may be in one place.
    start = _draw_grain(
        axes, grain, history.at(first), _Look(INK, 1.3, 5.0, dashes=(0.0, (3.0, 1.5)))
    )
    axes.add_collection(_path(history, norm), autolim=False)
    middle = colour(np.array((history.times[0] + history.times[-1]) / 2))
    axis = Line2D([], [], color=INK, lw=1.2, marker="o", markevery=[0], ms=3)
    return [
        (start, f"grain at t = {first:.4g}"),
        (end, f"grain at t = {last:.4g}"),
        (Line2D([], [], color=middle, lw=1.6), "its centre's path"),
        (axis, "its first axis"),
    ]


def _draw_contacts(
    axes: Axes, contacts: ContactForces, size: float, history: History
) -> list[Mark]:
    """The forces of contact where the grain is drawn; what the marks mean."""
    step, drawn = float(np.diff(history.times).max(initial=0.0)), []
    for time in _moments(size, history):
        drawn += contacts.draw(axes, time, size, step if time < history.times[-1] else 0.0)
    return [(drawn[0], "contact force in its cone")] if drawn else []


def _path(history: History, norm: Normalize) -> LineCollection:
    """The way of the centre, in pieces coloured by their time."""
    stride = max(1, len(history.times) // _SEGMENTS)
    kept = np.unique(np.append(np.arange(0, len(history.times), stride), len(history.times) - 1))
    points, times = history.centres[kept], history.times[kept]
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    path = LineCollection(pieces, cmap=_COLOURS, norm=norm, lw=1.6, zorder=6, capstyle="round")
    path.set_array((times[:-1] + times[1:]) / 2)
    return path


def _moments(size: float, history: History) -> list[float]:
    """First and last time and, of evenly spaced ones between, those at which the grain is clear of other places."""
    first, last = float(history.times[0]), float(history.times[-1])
    kept = [first, last]
    for time in np.linspace(first, last, _MOMENTS)[1:-1]:
        here = np.array(history.at(time).centre)
        distances = [np.linalg.norm(here - np.array(history.at(other).centre)) for other in kept]
        if min(distances) > _APART * size:
            kept.append(float(time))
    return sorted(kept)


def _draw_grain(axes: Axes, grain: Any, placement: Placement, look: _Look) -> Artist:
    """The outline, the centre, and a spoke along the grain's first axis."""
    in_space = placement.gdim == 3
    outline = (grain_silhouette if in_space else grain_outline)(grain, placement)
    lines = {"ec": look.edge, "lw": look.width, "ls": look.dashes, "joinstyle": "round"}
    body = Polygon(outline, fc=look.face, zorder=look.order, **lines)
    axes.add_artist(body)
    width = 0.75 * look.width
    x, y = (_axis_seen(grain, placement) if in_space else spoke(outline, placement)).T
    line = Line2D(x, y, color=look.edge, lw=width, marker="o", markevery=[0], ms=2.5 * width)
    line.set_zorder(look.order)
    axes.add_artist(line)
    return body


def spoke(outline: np.ndarray, placement: Placement) -> np.ndarray:
    """(2, 2) from a grain's centre along its first axis to its outline, points (n, 2)."""
    local = placement.to_body(outline)
    tip = outline[np.argmin(np.abs(np.arctan2(local[:, 1], local[:, 0])))]
    return np.array([placement.centre, tip])


def _axis_seen(grain: Any, placement: Placement) -> np.ndarray:
    """(2, 2) from the centre of a grain in space along its first axis to its surface, as seen from the side."""
    arm = grain.surface(_COARSE * grain.size).points[:, 0].max()
    return placement.to_scene([[0.0, 0.0, 0.0], [arm, 0.0, 0.0]])[:, [0, 2]]


def _draw_quantities(
    panels: Sequence[Axes], shown: Sequence[Shown], history: History
) -> list[Mark]:
    """Place and rates; what the mark of a new mesh means, if there is one."""
    made = history.remeshings
    new = []
    for k, (axes, (title, values, least)) in enumerate(zip(panels, shown, strict=True)):
        new = [axes.axvline(time, color="#9a9a9a", lw=0.6, ls=":") for time in made]
        axes.plot(history.times, values, color=style.FLOW if k < 3 else style.MOTION, lw=1.2)
        axes.set_title(title, fontsize=8.5)
        axes.set_xlim(*_span(history))
        _widen(axes, values, least)
        axes.grid(color="#e2e2e2", lw=0.5)
        axes.tick_params(labelsize=7.5)
        axes.xaxis.set_major_locator(MaxNLocator(5))
        axes.yaxis.set_major_locator(MaxNLocator(4))
        axes.yaxis.set_major_formatter(
            FuncFormatter(lambda value, _: f"{value:.6g}".replace("-", "−"))
        )
    lowest = min(axes.get_position().y0 for axes in panels)
    for axes in panels:
        if axes.get_position().y0 < lowest + 1e-6:
            axes.set_xlabel("time [scene units]", fontsize=8)
        else:
            axes.tick_params(labelbottom=False)
    return [(mark, "new mesh") for mark in new[:1]]


def _quantities(history: History, size: float, velocity: float) -> list[Shown]:
    """Title, values and smallest range of axes, by a grain's size and a velocity: less is as good as constant."""
    if history.gdim == 3:
        places = [(f"{axis} [scene units]", history[axis], 1e-3 * size) for axis in "xyz"]
        least, unit = 1e-4 * velocity / size, "[radians per unit of time]"
        return places + [
            (f"spin about {name[-1]} {unit}", history[name], least) for name in RATES[3][3:]
        ]
    angle = history["angle"]
    turned = np.ptp(angle) > _FEW_TURNS * 2 * np.pi
    unit, scale = ("turns", 2 * np.pi) if turned else ("degrees", np.pi / 180)
    return [
        ("x [scene units]", history["x"], 1e-3 * size),
        ("y [scene units]", history["y"], 1e-3 * size),
        (f"angle [{unit}]", angle / scale, 1e-2 if turned else 1.0),
        ("velocity along x [scene units]", history["velocity_x"], 1e-4 * velocity),
        ("velocity along y [scene units]", history["velocity_y"], 1e-4 * velocity),
        ("spin [radians per unit of time]", history["spin"], 1e-4 * velocity / size),
    ]


def _widen(axes: Axes, values: np.ndarray, least: float) -> None:
    """Limits around the values, at least `least` apart, so that round-off is not blown up."""
    known = values[np.isfinite(values)]
    least = max(least, _LEAST * float(np.abs(known).max(initial=0.0)))
    low, high = (known.min(), known.max()) if len(known) else (0.0, 0.0)
    middle, half = (low + high) / 2, max(high - low, least) / 2
    axes.set_ylim(middle - 1.1 * half, middle + 1.1 * half)

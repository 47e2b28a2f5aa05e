"""Picture of a moving grain: its path, in 3-D from the side, and six quantities against time."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.ticker import MaxNLocator

from ..errors import OutputError
from ..geometry.placement import Placement
from ..scene import Domain, Scene
from ..setup.setup import Setup
from . import style
from .drawing import draw_bed
from .history import ContactForces, History, contact_forces, read_history
from .outlines import bed_line, seen_from_the_side
from .record import StoredRun
from .style import GRAIN, INK, View

# Early to late; the palest part of the map would be lost on white.
_COLOURS = ListedColormap(colormaps["viridis_r"](np.linspace(0.12, 1.0, 256)), "moments")
_BED_PIECES = 800  # more cannot be distinguished
_MOMENTS, _APART = 21, 0.45  # at which the grain may be drawn; their least distance [grain sizes]
_NEAR = 0.5  # of the domain: a path of smaller extent is also shown enlarged
_SHOWN = {
    2: ("x", "y", "angle", "velocity_x", "velocity_y", "spin"),
    3: ("x", "y", "z", "spin_x", "spin_y", "spin_z"),
}


def picture(run: StoredRun) -> Figure:
    """Path of the grain of a run; raises OutputError for a missing or damaged history."""
    scene = run.model
    first = Setup(scene).geometry.stance.placement
    if scene.grain is None or first is None:
        raise OutputError(f"{run.directory / 'scene.toml'}: has no grain; run the scene again")
    history = read_history(run.directory / "history.csv").started(first)
    return figure(scene, history, run.headline, contact_forces(run.directory, scene.contact))


def figure(
    scene: Scene, history: History, title: str, contacts: ContactForces | None = None
) -> Figure:
    """Path in the domain, if short enlarged with contact forces, beside six quantities against time."""
    grain, start, bed = scene.grain, scene.placement, scene.bed_shape
    assert grain is not None and start is not None
    ground = None if bed is None else _ground(scene.domain, bed, start)
    views = _views(scene.domain, ground, grain.size, history)
    sheet = Figure(figsize=(10.8, 5.8), layout="constrained")
    style.headline(sheet, textwrap.shorten(title, 200))
    near = "near" if len(views) > 1 else "map"
    rows, widths = [["map", *"03"], [near, *"14"], [near, *"25"]], (2, 1.4, 1.4)
    panels: dict[str, Axes] = sheet.subplot_mosaic(rows, width_ratios=widths)
    norm = Normalize(*history.times[[0, -1]])
    names = ("Whole domain", "Path of the grain, enlarged")
    maps = [panels[key] for key in dict.fromkeys(("map", near))]
    for view, name, axes in zip(views, names, maps, strict=False):
        axes.set(xlim=view[:2], ylim=view[2:], aspect="equal")
        axes.set_title(name if len(views) > 1 else "Path of the grain")
        axes.set(xlabel="x [scene units]", ylabel=f"{'xyz'[scene.up]} [scene units]")
        if ground is not None:
            draw_bed(axes, ground)
        _draw_path(axes, grain, history, norm)
    if contacts is not None:
        _draw_contacts(maps[-1], contacts, grain.size, history)
    bar = sheet.colorbar(ScalarMappable(norm, _COLOURS), ax=maps)
    bar.set_label("time along the path [scene units]")
    for place, name in enumerate(_SHOWN[history.gdim]):
        _draw_quantity(panels[f"{place}"], name, history, grain.size, scene.reference_velocity)
    for key in "25":
        panels[key].set_xlabel("time [scene units]", fontsize=8)
    style.explain(sheet, loc="outside lower left", ncols=6)
    return sheet


def _views(domain: Domain, ground: np.ndarray | None, size: float, history: History) -> list[View]:
    floor = domain.bottom if ground is None else float(ground[:, 1].min())
    whole = (domain.left, domain.right, floor, domain.ceiling)
    (x0, y0), (x1, y1) = (
        history.centres.min(axis=0) - 0.7 * size,
        history.centres.max(axis=0) + 0.7 * size,
    )
    short = max((x1 - x0) / domain.length, (y1 - y0) / domain.height) < _NEAR
    return [whole, (x0, x1, y0, y1)] if short else [whole]


def _ground(domain: Domain, bed: Any, start: Placement) -> np.ndarray:
    """Points (n, 2) along the bed from left to right, in 3-D below the grain's start."""
    if domain.gdim == 2:
        return bed_line(bed, domain.left, domain.right)
    x = np.linspace(domain.left, domain.right, _BED_PIECES)
    return np.column_stack([x, bed.height(np.column_stack([x, np.full_like(x, start.centre[1])]))])


def _draw_path(axes: Axes, grain: Any, history: History, norm: Normalize) -> None:
    first, *between, last = _moments(grain.size, history)
    for time in between:
        _draw_grain(axes, grain, history.at(time), 4.0, ec=_COLOURS(norm(time)), lw=0.8, fc="none")
    place, label = history.at(last), f"grain at t = {last:.4g}"
    _draw_grain(axes, grain, place, 4.5, ec=INK, lw=1.7, fc=GRAIN, label=label)
    # Above the end and dashed: both may be in one place.
    place, label = history.at(first), f"grain at t = {first:.4g}"
    _draw_grain(axes, grain, place, 5.0, ec=INK, lw=1.3, fc="none", ls=(0, (3, 1.5)), label=label)
    axes.lines[-1].set_label("first body axis")
    points, times = history.centres, history.times
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    path = LineCollection(
        pieces, array=(times[:-1] + times[1:]) / 2, cmap=_COLOURS, norm=norm, lw=1.6, zorder=6
    )
    axes.add_collection(path, autolim=False)


def _draw_contacts(axes: Axes, contacts: ContactForces, size: float, history: History) -> None:
    step, drawn = float(np.diff(history.times).max(initial=0.0)), []
    for time in _moments(size, history):
        drawn += contacts.draw(axes, time, size, step if time < history.times[-1] else 0.0)
    if drawn:
        drawn[0].set_label("contact force in its cone")


def _moments(size: float, history: History) -> list[float]:
    first, last = history.times[[0, -1]].tolist()
    kept = [first, last]
    for time in np.linspace(first, last, _MOMENTS)[1:-1].tolist():
        here = np.array(history.at(time).centre)
        distances = [np.linalg.norm(here - np.array(history.at(other).centre)) for other in kept]
        if min(distances) > _APART * size:
            kept.append(time)
    return sorted(kept)


def _draw_grain(axes: Axes, grain: Any, placement: Placement, order: float, **looks: Any) -> None:
    outline, spoke = seen_from_the_side(grain, placement)
    axes.add_artist(Polygon(outline, zorder=order, joinstyle="round", **looks))
    line: style.Looks = {"color": looks["ec"], "lw": 0.75 * looks["lw"], "ms": 1.9 * looks["lw"]}
    axes.add_artist(Line2D(*spoke.T, marker="o", markevery=[0], zorder=order, **line))


def _draw_quantity(axes: Axes, name: str, history: History, size: float, velocity: float) -> None:
    values = history[name]
    # Unit, and the smallest range of the axis: round-off is not blown up.
    unit, least = {
        "angle": ("degrees", 1.0),
        "velocity": ("scene units", 1e-4 * velocity),
        "spin": ("rad per unit of time", 1e-4 * velocity / size),
    }.get(name.partition("_")[0], ("scene units", 1e-3 * size))
    if name == "angle":
        values = np.degrees(values)
    for number, time in enumerate(history.remeshings):
        label = None if number else "new mesh"
        axes.axvline(time, color="#9a9a9a", lw=0.6, ls=":", label=label)
    axes.plot(history.times, values, color=style.FLOW, lw=1.2)
    axes.set_title(f"{name.replace('_', ' ')} [{unit}]", fontsize=8)
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    middle, half = (low + high) / 2, 0.55 * max(high - low, least)
    axes.set(xlim=history.times[[0, -1]], ylim=(middle - half, middle + half))
    axes.grid(color="#e2e2e2", lw=0.5)
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.yaxis.set_major_formatter("{x:.6g}")

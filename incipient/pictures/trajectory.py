"""Picture of a moving grain: its path, in 3-D from the side, and six quantities against time."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
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
from matplotlib.ticker import MaxNLocator

from ..errors import OutputError
from ..geometry.placement import Placement
from ..scene import Domain, Scene
from ..setup.setup import Setup
from . import style
from .drawing import draw_bed
from .history import RATES, ContactForces, History, contact_forces, read_history
from .outlines import bed_line, grain_outline, hull, placed_surface, spoke
from .record import StoredRun
from .style import GRAIN, INK, Looks, View

# Early to late; the palest part of the map would be lost on white.
_COLOURS = ListedColormap(colormaps["viridis_r"](np.linspace(0.12, 1.0, 256)), "moments")
_SEGMENTS, _BED_PIECES = 3000, 800  # of the path, and of the bed; more cannot be distinguished
_MOMENTS, _APART = 21, 0.45  # at which the grain may be drawn; their least distance [grain sizes]
_LEAST = 1e-3  # of its largest value: smaller changes of a quantity are shown as small
_FEW_TURNS = 3.0  # up to which the angle is shown in degrees
_NEAR = 0.5  # of the domain: a path of smaller extent is shown enlarged beside it
_TALL = 0.55  # height over width of a drawing that has the quantities beside it
_DASHES = (0.0, (3.0, 1.5))

Mark = tuple[Artist, str]  # in the legend
Shown = tuple[str, np.ndarray, float]  # title, values (n,), smallest range of the axis


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
    """Path in the domain, if short enlarged with contact forces, above six quantities against time."""
    grain, start, bed = scene.grain, scene.placement, scene.bed_shape
    assert grain is not None and start is not None
    ground = None if bed is None else _ground(scene.domain, bed, start)
    views = _views(scene.domain, ground, grain.size, history)
    sheet, maps, panels = _laid_out(views, title)
    first, last = history.times[[0, -1]].tolist()
    norm = Normalize(first, max(last, first + 1e-300))
    names = ("Whole domain", "Path of the grain, enlarged")
    for axes, view, name in zip(maps, views, names, strict=False):
        axes.set(xlim=view[:2], ylim=view[2:], aspect="equal")
        axes.set_title(name if len(views) > 1 else "Path of the grain")
        axes.set(xlabel="x [scene units]", ylabel=f"{'xyz'[scene.up]} [scene units]")
        _draw_domain(axes, scene, ground)
        marks = _draw_path(axes, grain, history, norm)
    if contacts is not None:
        marks += _draw_contacts(maps[-1], contacts, grain.size, history)
    sheet.colorbar(ScalarMappable(norm, _COLOURS), ax=maps).set_label("time [scene units]")
    shown = _quantities(history, grain.size, scene.reference_velocity)
    for k, (axes, quantity) in enumerate(zip(panels, shown, strict=True)):
        new = _draw_quantity(axes, quantity, history, style.FLOW if k < 3 else style.MOTION)
    marks += [(mark, "new mesh") for mark in new[:1]]
    handles, labels = zip(*marks, strict=True)
    sheet.legend(handles, labels, loc="outside lower left", ncols=6, columnspacing=1.4)
    return sheet


def _laid_out(views: Sequence[View], title: str) -> tuple[Figure, list[Axes], list[Axes]]:
    aspect = max((y1 - y0) / (x1 - x0) for x0, x1, y0, y1 in views)
    rows = [
        ["map"] * 6 if len(views) == 1 else ["map"] * 3 + ["near"] * 3,
        [*"001122"],
        [*"334455"],
    ]
    size, ratios = (9.4, 4.6 + min(4.3, 7.4 / len(views) * aspect)), None
    if len(views) == 1 and aspect > _TALL:
        rows, size, ratios = (
            [["map", *"03"], ["map", *"14"], ["map", *"25"]],
            (10.8, 5.2),
            (2, 1.4, 1.4),
        )
    sheet = Figure(figsize=size, layout="constrained")
    style.headline(sheet, textwrap.shorten(title, 200))
    heights = None if ratios else (size[1] - 4.0, 1.3, 1.3)
    axes: dict[str, Axes] = sheet.subplot_mosaic(rows, width_ratios=ratios, height_ratios=heights)
    return sheet, [axes[k] for k in ("map", "near") if k in axes], [axes[k] for k in "012345"]


def _views(domain: Domain, ground: np.ndarray | None, size: float, history: History) -> list[View]:
    pad = 0.015 * max(domain.length, domain.height)
    floor = domain.bottom if ground is None else float(ground[:, 1].min())
    whole = (domain.left - pad, domain.right + pad, floor - pad, domain.ceiling + pad)
    low, high = history.centres.min(axis=0) - 0.7 * size, history.centres.max(axis=0) + 0.7 * size
    across, up = high - low
    if max(across / domain.length, up / domain.height) >= _NEAR:
        return [whole]
    across, up = max(across, 0.8 * up), max(up, 0.6 * across)
    x, y = (low + high) / 2
    return [whole, (x - across / 2, x + across / 2, y - up / 2, y + up / 2)]


def _draw_domain(axes: Axes, scene: Scene, ground: np.ndarray | None) -> None:
    domain = scene.domain
    left, right, low, high = domain.left, domain.right, domain.bottom, domain.ceiling
    closed = domain.kind == "box"
    above = closed or scene.top == "wall"
    below = above or scene.flow.wall_below
    sides = [(left, left, low, high, closed), (right, right, low, high, closed)]
    sides.append((left, right, high, high, above))
    if ground is not None:
        draw_bed(axes, ground)
    else:
        sides.append((left, right, low, low, below))
    for x0, x1, y0, y1, wall in sides:
        looks: Looks = {"lw": 1.4} if wall else {"lw": 0.7, "ls": (0, (4, 3))}
        axes.add_artist(Line2D([x0, x1], [y0, y1], color=INK, zorder=3, **looks))


def _ground(domain: Domain, bed: Any, start: Placement) -> np.ndarray:
    """Points (n, 2) along the bed from left to right, in 3-D below the grain's start."""
    if domain.gdim == 2:
        return bed_line(bed, domain.left, domain.right)
    x = np.linspace(domain.left, domain.right, _BED_PIECES)
    return np.column_stack([x, bed.height(np.column_stack([x, np.full_like(x, start.centre[1])]))])


def _draw_path(axes: Axes, grain: Any, history: History, norm: Normalize) -> list[Mark]:
    first, *between, last = _moments(grain.size, history)
    for time in between:
        colour = _COLOURS(norm(time))
        _draw_grain(axes, grain, history.at(time), 4.0, ec=colour, lw=0.8, fc="none")
    end = _draw_grain(axes, grain, history.at(last), 4.5, ec=INK, lw=1.7, fc=GRAIN)
    # Above the end and broken: both may be in one place.
    looks: Looks = {"ec": INK, "lw": 1.3, "fc": "none", "ls": _DASHES}
    start = _draw_grain(axes, grain, history.at(first), 5.0, **looks)
    count = len(history.times)
    kept = np.unique(np.linspace(0, count - 1, min(count, _SEGMENTS)).astype(int))
    points, times = history.centres[kept], history.times[kept]
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    looks = {"cmap": _COLOURS, "norm": norm, "lw": 1.6, "zorder": 6, "capstyle": "round"}
    path = LineCollection(pieces, array=(times[:-1] + times[1:]) / 2, **looks)
    axes.add_collection(path, autolim=False)
    axis = Line2D([], [], color=INK, lw=1.2, marker="o", markevery=[0], ms=3)
    return [
        (start, f"grain at t = {first:.4g}"),
        (end, f"grain at t = {last:.4g}"),
        (Line2D([], [], color=_COLOURS(0.5), lw=1.6), "its centre's path"),
        (axis, "its first axis"),
    ]


def _draw_contacts(
    axes: Axes, contacts: ContactForces, size: float, history: History
) -> list[Mark]:
    step, drawn = float(np.diff(history.times).max(initial=0.0)), []
    for time in _moments(size, history):
        drawn += contacts.draw(axes, time, size, step if time < history.times[-1] else 0.0)
    return [(drawn[0], "contact force in its cone")] if drawn else []


def _moments(size: float, history: History) -> list[float]:
    first, last = history.times[[0, -1]].tolist()
    kept = [first, last]
    for time in np.linspace(first, last, _MOMENTS)[1:-1].tolist():
        here = np.array(history.at(time).centre)
        distances = [np.linalg.norm(here - np.array(history.at(other).centre)) for other in kept]
        if min(distances) > _APART * size:
            kept.append(time)
    return sorted(kept)


def _draw_grain(axes: Axes, grain: Any, placement: Placement, order: float, **looks: Any) -> Artist:
    if placement.gdim == 3:
        points, _ = placed_surface(grain, placement)
        outline = hull(points[:, [0, 2]])
        arm = placement.to_body(points)[:, 0].max()
        ends = placement.to_scene([[0.0, 0.0, 0.0], [arm, 0.0, 0.0]])[:, [0, 2]]
    else:
        outline = grain_outline(grain, placement)
        ends = spoke(outline, placement)
    body = axes.add_artist(Polygon(outline, zorder=order, joinstyle="round", **looks))
    line: Looks = {"color": looks["ec"], "lw": 0.75 * looks["lw"], "ms": 1.9 * looks["lw"]}
    axes.add_artist(Line2D(*ends.T, marker="o", markevery=[0], zorder=order, **line))
    return body


def _draw_quantity(axes: Axes, shown: Shown, history: History, colour: str) -> list[Artist]:
    title, values, least = shown
    new: list[Artist] = [
        axes.axvline(t, color="#9a9a9a", lw=0.6, ls=":") for t in history.remeshings
    ]
    axes.plot(history.times, values, color=colour, lw=1.2)
    axes.set_title(title, fontsize=8)
    axes.margins(x=0.0)
    known = values[np.isfinite(values)] if np.isfinite(values).any() else np.zeros(1)
    low, high = float(known.min()), float(known.max())
    # Round-off is not blown up.
    half = max(high - low, least, _LEAST * max(abs(low), abs(high))) / 2
    axes.set_ylim((low + high) / 2 - 1.1 * half, (low + high) / 2 + 1.1 * half)
    axes.grid(color="#e2e2e2", lw=0.5)
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.yaxis.set_major_formatter("{x:.6g}")
    place = axes.get_subplotspec()
    if place is not None and place.is_last_row():
        axes.set_xlabel("time [scene units]", fontsize=8)
    return new


def _quantities(history: History, size: float, velocity: float) -> list[Shown]:
    if history.gdim == 3:
        places = [(f"{axis} [scene units]", history[axis], 1e-3 * size) for axis in "xyz"]
        least, unit = 1e-4 * velocity / size, "[rad per unit of time]"
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
        ("velocity x [scene units]", history["velocity_x"], 1e-4 * velocity),
        ("velocity y [scene units]", history["velocity_y"], 1e-4 * velocity),
        ("spin [rad per unit of time]", history["spin"], 1e-4 * velocity / size),
    ]

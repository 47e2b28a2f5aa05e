"""Pictures of the flow: speed with streamlines, pressure with isobars, vorticity, profiles of a box."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection, TriMesh
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from ...arrays import quarter_turned
from ..record import StoredRun
from ..style import GRAIN, GROUND, INK, View, panels
from .mesh import curve, triangles_of
from .streamlines import streamlines

Limits = Callable[[np.ndarray], Normalize]  # of the colours of values that are seen
Overlay = Callable[[Axes, View], None]

_TRIANGLES = 50_000  # about as many as a panel shows; more cannot be told apart
_CLIPPED = 0.5  # per cent of the nodes, at either end, whose pressure exceeds the colour bar
_CLIPPED_VORTICITY = 6.0  # per cent of the nodes: it is greatest in thin layers


def speed(run: StoredRun) -> Figure:
    """Speed in colour, streamlines with the direction of flow."""
    values = np.linalg.norm(run.field("velocity"), axis=1)
    return _picture(run, values, "speed", "viridis", from_zero, partial(draw_streamlines, run))


def pressure(run: StoredRun) -> Figure:
    """Pressure in colour with isobars; extremes at corners and in gaps exceed the colour bar."""
    isobars = partial(_draw_isobars, run)
    return _picture(run, run.field("pressure"), "pressure", "RdYlBu_r", without_extremes, isobars)


def vorticity(run: StoredRun) -> Figure:
    """Vorticity in colour, anticlockwise positive; the colour bar is symmetric and clips the extremes."""
    return _picture(
        run, run.field("vorticity"), "vorticity", "RdBu_r", _symmetric, lambda axes, view: None
    )


def profiles(run: StoredRun) -> Figure:
    """Velocity along the vertical and the horizontal centreline of a box."""
    x0, x1, y0, y1 = run.box
    figure = Figure(figsize=(9.0, 4.2))
    left, right = figure.subplots(1, 2)
    figure.subplots_adjust(left=0.08, right=0.97, top=0.82, bottom=0.13, wspace=0.25)
    figure.text(0.08, 0.95, run.headline, fontsize=11, va="top")
    y, x = np.linspace(y0, y1, 400), np.linspace(x0, x1, 400)
    left.plot(_along(run, 0, np.full_like(y, (x0 + x1) / 2), y), y, color="#1f4e79", lw=1.4)
    left.set(xlabel="v₁ [scene units]", ylabel="y [scene units]", ylim=(y0, y1))
    left.set_title(f"v₁ on the vertical centreline, x = {(x0 + x1) / 2:g}")
    right.plot(x, _along(run, 1, x, np.full_like(x, (y0 + y1) / 2)), color="#a63603", lw=1.4)
    right.set(xlabel="x [scene units]", ylabel="v₂ [scene units]", xlim=(x0, x1))
    right.set_title(f"v₂ on the horizontal centreline, y = {(y0 + y1) / 2:g}")
    left.axvline(0, color=INK, lw=0.5)
    right.axhline(0, color=INK, lw=0.5)
    for axes in (left, right):
        axes.grid(color="#dddddd", lw=0.5)
    return figure


def draw_solids(run: StoredRun, axes: Axes, fluid_shown: bool, grain_shown: bool = True) -> None:
    """The bed with the ground below it, and the grain; without the fluid in colour, the bed is cut out."""
    x0, x1, _, y1 = run.box
    outer = run.mesh.loops[0]
    if run.scene.get("bed"):
        low = axes.get_ylim()[0]
        axes.add_artist(
            Rectangle((x0, low - 1), x1 - x0, y1 - low + 1, color=GROUND, lw=0, zorder=0)
        )
    if not fluid_shown:
        axes.add_artist(Polygon(curve(run.mesh.points, outer), facecolor="white", zorder=0.5))
    axes.add_artist(
        Polygon(curve(run.mesh.points, outer), fill=False, edgecolor=INK, lw=0.8, zorder=3)
    )
    for outline in _grains(run) if grain_shown else ():
        axes.add_artist(Polygon(outline, facecolor=GRAIN, edgecolor=INK, lw=0.9, zorder=3))


def _grains(run: StoredRun) -> list[np.ndarray]:
    """Outlines (n, 2) of what is not fluid amid the mesh, or the grain whose contacts are closed."""
    if run.touching_grain is not None:
        return [run.touching_grain]
    return [curve(run.mesh.points, hole) for hole in run.mesh.loops[1:]]


def draw_streamlines(
    run: StoredRun, axes: Axes, view: View, color: str = "white", alpha: float = 0.9
) -> None:
    """Evenly spaced streamlines with an arrow head in the middle of each."""
    x0, x1, y0, y1 = view
    separation = 0.021 * np.sqrt((x1 - x0) * (y1 - y0))
    lines = streamlines(run.sampled(view), separation)
    heads = [head for line in lines if (head := _arrow_head(line, 0.45 * separation)) is not None]
    fluid = Polygon(curve(run.mesh.points, run.mesh.loops[0]), transform=axes.transData)
    for drawn in (
        LineCollection(
            lines, colors=color, linewidths=0.6, alpha=alpha, zorder=2, capstyle="round"
        ),
        PolyCollection(heads, facecolor=color, edgecolor="none", alpha=alpha, zorder=2),
    ):
        axes.add_collection(drawn, autolim=False)
        drawn.set_clip_path(fluid)


def _draw_isobars(run: StoredRun, axes: Axes, view: View) -> None:
    values, seen = run.field("pressure"), run.mesh.within(view)
    levels = np.linspace(*_range(without_extremes(values[np.unique(seen.cells)])), 19)[1:-1]
    looks = {"colors": INK, "linewidths": 0.35, "linestyles": "solid", "alpha": 0.6}
    axes.tricontour(triangles_of(seen.points, seen.quarters), values, levels=levels, **looks)


def near_grain(run: StoredRun) -> View | None:
    """The part of the plane around the grain and its wake; None without a grain."""
    if not (outlines := _grains(run)):
        return None
    outline = np.vstack(outlines)
    (left, low), (right, high) = outline.min(axis=0), outline.max(axis=0)
    size = max(right - left, high - low)
    x0, x1, _, y1 = run.box
    centre = (left + right) / 2
    view = (centre - 1.7 * size, centre + 2.7 * size, low - 0.5 * size, high + 0.7 * size)
    return max(view[0], x0), min(view[1], x1), max(view[2], _floor(run)), min(view[3], y1)


def _picture(
    run: StoredRun, values: np.ndarray, name: str, colours: str, limits: Limits, overlay: Overlay
) -> Figure:
    """The whole domain and, if there is a grain, its surroundings, each with colours of its own."""
    x0, x1, _, y1 = run.box
    zoom = near_grain(run)
    views = [(x0, x1, _floor(run), y1)] + ([zoom] if zoom else [])
    figure, places = panels(views, run.headline)
    for (axes, bar), view, what in zip(
        places, views, ("whole domain", "around the grain"), strict=False
    ):
        shown = values[np.unique(run.mesh.within(view).cells)]
        norm = limits(shown)
        _paint(run, axes, view, values, colours, norm)
        overlay(axes, view)
        draw_solids(run, axes, fluid_shown=True)
        axes.set_title(f"{name.capitalize()}{', ' + what if zoom else ''}")
        _colour_bar(figure, bar, norm, colours, f"{name} [scene units]", shown)
    return figure


def _paint(
    run: StoredRun, axes: Axes, view: View, values: np.ndarray, colours: str, norm: Normalize
) -> None:
    seen = run.mesh.within(view)
    parts = int(np.clip(np.sqrt(_TRIANGLES / max(len(seen.cells), 1)), 2, 6))
    points, triangles, fine = seen.subdivided(values, parts)
    # What `axes.tripcolor` makes, without its pass over all triangles to find limits that are known.
    painted = TriMesh(
        triangles_of(points, triangles), cmap=colours, norm=norm, rasterized=True, zorder=1
    )
    painted.set_array(fine)
    axes.add_collection(painted, autolim=False)


def _colour_bar(
    figure: Figure, axes: Axes, norm: Normalize, colours: str, label: str, shown: np.ndarray
) -> None:
    lowest, highest = _range(norm)
    above, below = shown.max() > highest, shown.min() < lowest
    extend = {(True, True): "both", (True, False): "max", (False, True): "min"}.get(
        (above, below), "neither"
    )
    bar = figure.colorbar(ScalarMappable(norm, colours), cax=axes, extend=extend, extendfrac=0.04)
    bar.set_label(label)
    bar.ax.tick_params(width=0.5)


def _floor(run: StoredRun) -> float:
    """Lower edge of pictures: some ground is shown below a bed."""
    _, _, y0, y1 = run.box
    return y0 - (0.04 * (y1 - y0) if run.scene.get("bed") else 0.0)


def from_zero(seen: np.ndarray) -> Normalize:
    """Limits of the colours of values that are not negative."""
    return Normalize(0.0, float(seen.max(initial=0.0)) or 1.0)


def without_extremes(seen: np.ndarray) -> Normalize:
    """Limits of the colours of values whose extremes exceed the colour bar."""
    low, high = np.percentile(seen, (_CLIPPED, 100 - _CLIPPED))
    return Normalize(low, high) if high > low else Normalize(low - 0.5, high + 0.5)


def _symmetric(seen: np.ndarray) -> Normalize:
    bound = np.percentile(np.abs(seen), 100 - _CLIPPED_VORTICITY) or 1.0
    return Normalize(-bound, bound)


def _range(norm: Normalize) -> tuple[float, float]:
    return float(norm.vmin or 0.0), float(norm.vmax or 0.0)


def _arrow_head(line: np.ndarray, size: float) -> np.ndarray | None:
    """Triangle (3, 2) in the middle of a line; None on lines too short to carry one."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    reached = np.concatenate([[0.0], np.cumsum(steps)])
    if reached[-1] < 12 * size:
        return None
    middle = int(np.searchsorted(reached, reached[-1] / 2))
    along = line[middle] - line[middle - 1]
    along *= size / np.linalg.norm(along)
    across = 0.6 * quarter_turned(along)
    return line[middle] + np.array([1.2 * along, across - along, -across - along])


def _along(run: StoredRun, component: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A component of the velocity at points, nudged inside where they lie on the box's walls."""
    x0, x1, y0, y1 = run.box
    x = np.clip(x, x0 + 1e-9 * (x1 - x0), x1 - 1e-9 * (x1 - x0))
    y = np.clip(y, y0 + 1e-9 * (y1 - y0), y1 - 1e-9 * (y1 - y0))
    return run.mesh.evaluated(run.field("velocity")[:, component], np.column_stack([x, y]))

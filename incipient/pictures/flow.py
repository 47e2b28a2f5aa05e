"""Pictures of the flow: speed with streamlines, pressure, vorticity; of 3-D runs in the vertical plane of the grain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle
from matplotlib.tri import LinearTriInterpolator

from .mesh import QuadraticMesh, curve
from .record import StoredRun
from .section import VerticalSection, draw_outlines, level_of, section_of, views_of
from .style import FLOW, GRAIN, GROUND, INK, PUSH, Looks, View, headline, panels

_ACROSS = 200  # points of the grid, along the longer side, that streamlines are traced on
_CLIPPED = 0.5  # per cent of the nodes, at either end, whose pressure exceeds the colour bar
_CLIPPED_VORTICITY = 6.0  # per cent of the nodes: vorticity is greatest in thin layers
_ISOBARS = 18


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


@dataclass(frozen=True)
class Shown:
    """A field in a picture: the field that is stored, the values drawn, their colours and the limits of these."""

    name: str
    stored: str
    colours: str
    limits: Callable[[np.ndarray], Normalize]

    def values(self, stored: np.ndarray) -> np.ndarray:
        """Values to draw; of a vector its magnitude."""
        return np.linalg.norm(stored, axis=-1) if self.name == "speed" else stored


SPEED = Shown("speed", "velocity", "viridis", from_zero)
PRESSURE = Shown("pressure", "pressure", "RdYlBu_r", without_extremes)
VORTICITY = Shown("vorticity", "vorticity", "RdBu_r", _symmetric)


def speed(run: StoredRun) -> Figure:
    """Speed in colour with streamlines."""
    return _picture(run, SPEED)


def pressure(run: StoredRun) -> Figure:
    """Pressure in colour with isobars; extremes at corners and in gaps exceed the colour bar."""
    return _picture(run, PRESSURE)


def vorticity(run: StoredRun) -> Figure:
    """Vorticity in colour, anticlockwise positive; the colour bar is symmetric and clips the extremes."""
    return _picture(run, VORTICITY)


def _picture(run: StoredRun, shown: Shown) -> Figure:
    """The whole domain and, if there is a grain, its surroundings, each with colours of its own."""
    views = views_of(run) if run.in_space else _views(run)
    figure, places = panels(views, run.headline, "z" if run.in_space else "y")
    level = f" at y = {level_of(run):.4g}" if run.in_space else ""
    parts = ("", "") if len(views) == 1 else (", whole domain", ", around the grain")
    for axes, view, part in zip(places, views, parts, strict=False):
        paint = _paint_section if run.in_space else _paint
        norm, seen = paint(run, axes, view, shown)
        axes.set_title(f"{shown.name.capitalize()}{level}{part}")
        below, above = seen.min() < (norm.vmin or 0.0), seen.max() > (norm.vmax or 0.0)
        extend = ("neither", "max", "min", "both")[above + 2 * below]
        bar = figure.colorbar(ScalarMappable(norm, shown.colours), ax=axes, extend=extend)
        bar.set_label(f"{shown.name} [scene units]")
    return figure


def _paint(run: StoredRun, axes: Axes, view: View, shown: Shown) -> tuple[Normalize, np.ndarray]:
    values, seen = shown.values(run.field(shown.stored)), run.mesh.within(view)
    norm = shown.limits(values[np.unique(seen.cells)])
    looks: Looks = {"cmap": shown.colours, "norm": norm, "rasterized": True, "zorder": 1}
    axes.tripcolor(seen.triangulation, values, shading="gouraud", **looks)
    if shown is PRESSURE:
        levels = np.linspace(norm.vmin or 0.0, norm.vmax or 0.0, _ISOBARS + 1)[1:-1]
        looks = {"linewidths": 0.35, "linestyles": "solid", "alpha": 0.6}
        axes.tricontour(seen.triangulation, values, levels=levels, colors=INK, **looks)
    if shown is SPEED:
        draw_streamlines(run, axes, view)
    draw_solids(run, axes, fluid_shown=True)
    axes.set(xlim=view[:2], ylim=view[2:])
    return norm, values[np.unique(seen.cells)]


def _paint_section(
    run: StoredRun, axes: Axes, view: View, shown: Shown
) -> tuple[Normalize, np.ndarray]:
    section = section_of(run, view, [shown.stored])
    values = shown.values(section.fields[shown.stored])
    norm = shown.limits(values[section.inside])
    looks: Looks = {"cmap": shown.colours, "norm": norm, "interpolation": "bilinear", "zorder": 1}
    image = axes.imshow(values, origin="lower", extent=view, **looks)
    draw_outlines(axes, section, image)
    if shown is SPEED:
        _streamlines_of(axes, section)
    axes.set(xlim=view[:2], ylim=view[2:])
    return norm, values[section.inside]


def _streamlines_of(axes: Axes, section: VerticalSection) -> None:
    within = np.where(section.inside[..., None], section.fields["velocity"][..., [0, 2]], np.nan)
    if np.nanmax(np.abs(within)) > 0.0:
        axes.streamplot(section.x, section.z, *within.transpose(2, 0, 1), **_lines("white"))


def draw_streamlines(run: StoredRun, axes: Axes, view: View, colour: str = "white") -> None:
    """Streamlines of the plane flow in a part of the plane; none where the fluid is at rest."""
    x, y, velocity = sample(run.mesh, run.field("velocity")[:, :2], view)
    if not np.abs(velocity).max() > 0.0:
        return
    drawn = axes.streamplot(x, y, *velocity, **_lines(colour))
    fluid = Polygon(curve(run.mesh.points, run.mesh.loops[0]), transform=axes.transData)
    drawn.lines.set_clip_path(fluid)


def _lines(colour: str) -> Looks:
    return {"color": colour, "linewidth": 0.6, "arrowsize": 0.6, "density": 1.4, "zorder": 2}


def sample(
    mesh: QuadraticMesh, values: np.ndarray, view: View, across: int = _ACROSS
) -> tuple[np.ndarray, np.ndarray, np.ma.MaskedArray]:
    """Columns x, rows y and nodal values (nodes, d) on that grid (d, rows, columns), masked outside of the fluid."""
    x0, x1, y0, y1 = view
    spacing = max(x1 - x0, y1 - y0) / across
    # Evenly spaced to round-off, half a spacing inside of the boundary.
    x, y = (
        np.linspace(low + spacing / 2, high - spacing / 2, max(int((high - low) / spacing), 2))
        for low, high in ((x0, x1), (y0, y1))
    )
    triangulation = mesh.within(view).triangulation
    finder = triangulation.get_trifinder()
    grids = np.meshgrid(x, y)
    return (
        x,
        y,
        np.ma.stack([LinearTriInterpolator(triangulation, v, finder)(*grids) for v in values.T]),
    )


def profiles(run: StoredRun) -> Figure:
    """Velocity along the vertical and the horizontal centreline of a box."""
    x0, x1, y0, y1 = run.box
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    headline(figure, run.headline)
    left, right = figure.subplots(1, 2)
    middle_x, middle_y = (x0 + x1) / 2, (y0 + y1) / 2
    finder = run.mesh.triangulation.get_trifinder()
    u, v = (
        LinearTriInterpolator(run.mesh.triangulation, run.field("velocity")[:, k], finder)
        for k in (0, 1)
    )
    inside = np.linspace(1e-9, 1.0 - 1e-9, 400)  # the walls' own points may be outside by round-off
    x, y = x0 + (x1 - x0) * inside, y0 + (y1 - y0) * inside
    left.plot(u(np.full_like(y, middle_x), y), y, color=FLOW, lw=1.4)
    left.set(xlabel="v₁ [scene units]", ylabel="y [scene units]", ylim=(y0, y1))
    left.set_title(f"v₁ on the vertical centreline, x = {middle_x:g}")
    right.plot(x, v(x, np.full_like(x, middle_y)), color=PUSH, lw=1.4)
    right.set(xlabel="x [scene units]", ylabel="v₂ [scene units]", xlim=(x0, x1))
    right.set_title(f"v₂ on the horizontal centreline, y = {middle_y:g}")
    left.axvline(0, color=INK, lw=0.5)
    right.axhline(0, color=INK, lw=0.5)
    for axes in (left, right):
        axes.grid(color="#dddddd", lw=0.5)
    return figure


def draw_solids(run: StoredRun, axes: Axes, fluid_shown: bool, grain_shown: bool = True) -> None:
    """The bed with the ground below it, and the grain; without the fluid in colour, the bed is cut out."""
    x0, x1, _, y1 = run.box
    outer = curve(run.mesh.points, run.mesh.loops[0])
    if run.scene.get("bed"):
        low = axes.get_ylim()[0] - 1.0
        axes.add_artist(Rectangle((x0, low), x1 - x0, y1 - low, color=GROUND, lw=0, zorder=0))
    if not fluid_shown:
        axes.add_artist(Polygon(outer, facecolor="white", zorder=0.5))
    axes.add_artist(Polygon(outer, fill=False, edgecolor=INK, lw=0.8, zorder=3))
    for outline in _grains(run) if grain_shown else ():
        axes.add_artist(Polygon(outline, facecolor=GRAIN, edgecolor=INK, lw=0.9, zorder=3))


def _grains(run: StoredRun) -> list[np.ndarray]:
    """Outlines (n, 2) of what is not fluid amid the mesh, or the grain whose contacts are closed."""
    if run.touching_grain is not None:
        return [run.touching_grain]
    return [curve(run.mesh.points, hole) for hole in run.mesh.loops[1:]]


def _views(run: StoredRun) -> list[View]:
    """The whole domain, with some ground below a bed, and the part around a grain and its wake."""
    x0, x1, y0, y1 = run.box
    floor = y0 - (0.04 * (y1 - y0) if run.scene.get("bed") else 0.0)
    whole = (x0, x1, floor, y1)
    if not (outlines := _grains(run)):
        return [whole]
    outline = np.vstack(outlines)
    (left, low), (right, high) = outline.min(axis=0), outline.max(axis=0)
    size, centre = max(right - left, high - low), (left + right) / 2
    near = (centre - 1.7 * size, centre + 2.7 * size, low - 0.5 * size, high + 0.7 * size)
    return [whole, (max(near[0], x0), min(near[1], x1), max(near[2], floor), min(near[3], y1))]

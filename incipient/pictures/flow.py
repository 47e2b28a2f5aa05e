"""Pictures of the flow: speed with streamlines, pressure, vorticity; of 3-D runs in the vertical plane of the grain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from .plane import Plane
from .record import StoredRun
from .style import FLOW, INK, PUSH, Looks, View, headline, panels

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
        """Values to draw: of the velocity its magnitude, of the vorticity in 3-D its part about y."""
        if self.name == "speed":
            return np.linalg.norm(stored, axis=-1)
        return stored if stored.ndim == 1 else stored[:, 1]


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
    plane, views, values = run.plane, run.views, shown.values(run.in_plane(shown.stored))
    figure, places = panels(views, run.headline, plane.upwards)
    level = "" if plane.level is None else f" at y = {plane.level:.4g}"
    parts = ("", "") if len(views) == 1 else (", whole domain", ", around the grain")
    for axes, view, part in zip(places, views, parts, strict=False):
        norm, seen = _paint(plane, values, axes, view, shown)
        axes.set_title(f"{shown.name.capitalize()}{level}{part}")
        below, above = seen.min() < (norm.vmin or 0.0), seen.max() > (norm.vmax or 0.0)
        extend = ("neither", "max", "min", "both")[above + 2 * below]
        bar = figure.colorbar(ScalarMappable(norm, shown.colours), ax=axes, extend=extend)
        bar.set_label(f"{shown.name} [scene units]")
    return figure


def _paint(
    plane: Plane, values: np.ndarray, axes: Axes, view: View, shown: Shown
) -> tuple[Normalize, np.ndarray]:
    """Draw values at the nodes of a part of the plane; limits of the colours, and the values that are seen."""
    triangles = plane.triangulation(view)
    seen = values[np.unique(triangles.triangles)]
    norm = shown.limits(seen)
    looks: Looks = {"cmap": shown.colours, "norm": norm, "rasterized": True, "zorder": 1}
    painted: list[Artist] = [axes.tripcolor(triangles, values, shading="gouraud", **looks)]
    if shown is PRESSURE:
        levels = np.linspace(norm.vmin or 0.0, norm.vmax or 0.0, _ISOBARS + 1)[1:-1]
        looks = {"linewidths": 0.35, "linestyles": "solid", "alpha": 0.6}
        painted.append(axes.tricontour(triangles, values, levels=levels, colors=INK, **looks))
    if shown is SPEED:
        draw_streamlines(plane, axes, view)
    plane.draw_solids(axes, painted)
    axes.set(xlim=view[:2], ylim=view[2:])
    return norm, seen


def draw_streamlines(plane: Plane, axes: Axes, view: View, colour: str = "white") -> None:
    """Streamlines in a part of the plane; none where the fluid is at rest."""
    x, y, velocity = plane.velocities(view)
    if np.abs(velocity).max() > 0.0:
        looks: Looks = {"linewidth": 0.6, "arrowsize": 0.6, "density": 1.4, "zorder": 2}
        axes.streamplot(x, y, velocity[0], velocity[1], color=colour, **looks)


def profiles(run: StoredRun) -> Figure:
    """Velocity along the vertical and the horizontal centreline of a box."""
    x0, x1, y0, y1 = run.plane.box
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    headline(figure, run.headline)
    left, right = figure.subplots(1, 2)
    middle_x, middle_y = (x0 + x1) / 2, (y0 + y1) / 2
    inside = np.linspace(1e-9, 1.0 - 1e-9, 400)  # the walls' own points may be outside by round-off
    x, y = x0 + (x1 - x0) * inside, y0 + (y1 - y0) * inside
    upright, level = np.full_like(y, middle_x), np.full_like(x, middle_y)
    u = run.plane.at(np.column_stack([upright, y]), "velocity")[:, 0]
    v = run.plane.at(np.column_stack([x, level]), "velocity")[:, 1]
    left.plot(u, y, color=FLOW, lw=1.4)
    left.set(xlabel="v₁ [scene units]", ylabel="y [scene units]", ylim=(y0, y1))
    left.set_title(f"v₁ on the vertical centreline, x = {middle_x:g}")
    right.plot(x, v, color=PUSH, lw=1.4)
    right.set(xlabel="x [scene units]", ylabel="v₂ [scene units]", xlim=(x0, x1))
    right.set_title(f"v₂ on the horizontal centreline, y = {middle_y:g}")
    left.axvline(0, color=INK, lw=0.5)
    right.axhline(0, color=INK, lw=0.5)
    for axes in (left, right):
        axes.grid(color="#dddddd", lw=0.5)
    return figure

"""Pictures of speed, pressure, vorticity, walls and mesh; in 3-D in the vertical plane of the grain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from .plane import BESIDE, Plane, level_of, pyvista_off_screen
from .record import StoredRun
from .style import FLOW, GROUND, INK, PUSH, View, headline, panels


def _without_extremes(seen: np.ndarray) -> Normalize:
    low, high = np.percentile(seen, (0.5, 99.5))
    return Normalize(low, high) if high > low else Normalize(low - 0.5, high + 0.5)


def _symmetric(seen: np.ndarray) -> Normalize:
    bound = np.percentile(np.abs(seen), 94.0) or 1.0  # it is greatest in thin layers
    return Normalize(-bound, bound)


@dataclass(frozen=True)
class Shown:
    """A field in a picture: the stored field, its colours and limits, and the values beyond them."""

    name: str
    stored: str
    colours: str
    limits: Callable[[np.ndarray], Normalize]
    extend: str = "both"

    def values(self, stored: np.ndarray) -> np.ndarray:
        if self.name == "speed":
            return np.linalg.norm(stored, axis=-1)
        return stored if stored.ndim == 1 else stored[:, 1]


SPEED = Shown(
    "speed",
    "velocity",
    "viridis",
    lambda seen: Normalize(0.0, float(seen.max(initial=0.0)) or 1.0),
    "neither",
)
PRESSURE = Shown("pressure", "pressure", "RdYlBu_r", _without_extremes)
VORTICITY = Shown("vorticity", "vorticity", "RdBu_r", _symmetric)


def picture(run: StoredRun, shown: Shown) -> Figure:
    """A field in the whole domain and around the grain, each with its own colours."""
    plane, views, values = run.plane, run.views, shown.values(run.in_plane(shown.stored))
    figure, places = panels(views, run.headline + run.moment, plane.upwards)
    level = "" if plane.level is None else f" at y = {plane.level:.4g}"
    parts = ("", "") if len(views) == 1 else (", whole domain", ", around the grain")
    for axes, view, part in zip(places, views, parts, strict=False):
        painted = _paint(plane, values, axes, view, shown)
        axes.set_title(f"{shown.name.capitalize()}{level}{part}")
        figure.colorbar(painted, ax=axes, extend=shown.extend, label=f"{shown.name} [scene units]")
    return figure


def _paint(plane: Plane, values: np.ndarray, axes: Axes, view: View, shown: Shown) -> Any:
    triangles, (x, y) = plane.triangulation, plane.points.T
    near = (view[0] <= x) & (x <= view[1]) & (view[2] <= y) & (y <= view[3])
    norm = shown.limits(values[near])
    painted: list[Any] = [
        axes.tripcolor(
            triangles, values, shading="gouraud", cmap=shown.colours, norm=norm, rasterized=True,
            zorder=1,
        )
    ]  # fmt: skip
    if shown is PRESSURE:
        levels = np.linspace(norm.vmin or 0.0, norm.vmax or 0.0, 19)[1:-1]
        isobars = axes.tricontour(
            triangles, values, levels=levels, colors=INK, linewidths=0.35, linestyles="solid",
            alpha=0.6,
        )  # fmt: skip
        painted.append(isobars)
    if shown is SPEED:
        draw_streamlines(plane, axes, view)
    plane.draw_solids(axes, painted)
    axes.set(xlim=view[:2], ylim=view[2:])
    return painted[0]


def draw_streamlines(plane: Plane, axes: Axes, view: View, colour: str = "white") -> None:
    """Streamlines in a part of the plane; none in fluid at rest."""
    x, y, velocity = plane.velocities(view)
    if np.abs(velocity).max() > 0.0:
        axes.streamplot(
            x, y, velocity[0], velocity[1], color=colour, linewidth=0.6, arrowsize=0.6, density=1.4, zorder=2
        )  # fmt: skip


def mesh(run: StoredRun) -> Figure:
    """Cells around the grain, or all without one; in 3-D those that the plane cuts."""
    around = (0, 3, 1, 4, 2, 5)  # nodes of a quadratic triangle in order
    view, points, faces = run.views[-1], run.fields.points, run.fields.cells[:, around]
    if run.in_space:
        pyvista = pyvista_off_screen()
        cells = {pyvista.CellType.TETRA: run.fields.cells[:, :4]}
        cut = pyvista.UnstructuredGrid(cells, points).slice(
            "y", origin=(0.0, level_of(run, BESIDE), 0.0)
        )
        points, faces = cut.points[:, [0, 2]], cut.irregular_faces
    figure, (axes,) = panels([view], run.headline + run.moment, run.plane.upwards)
    polygons = [points[face, :2] for face in faces]
    axes.add_collection(
        PolyCollection(polygons, facecolor="#d4e3ee", edgecolor=INK, lw=0.35, rasterized=True),
        autolim=False,
    )
    axes.set_title("Cells" + (f" at y = {level_of(run):.4g}" if run.in_space else ""))
    return figure


def along_walls(run: StoredRun) -> Figure:
    """y+ and signed friction along the walls of a turbulent flow."""
    figure = Figure(figsize=(9.0, 5.5), layout="constrained")
    headline(figure, run.headline)
    upper, lower = figure.subplots(2, 1, sharex=True)
    lower.axhline(0.0, color=GROUND)
    walls = run.result["turbulence"]["along"]
    for colour, (name, profile) in zip((FLOW, PUSH, INK), walls.items(), strict=False):
        for axes, column in ((upper, "y_plus"), (lower, "friction")):
            axes.plot(profile["x"], profile[column], ".", markersize=2, color=colour, label=name)
    upper.set(yscale="log", ylabel="y+ at the wall", title="Along the walls")
    lower.set(xlabel="x [scene units]", ylabel="friction coefficient 2τ/V²")
    upper.legend(loc="best")
    return figure

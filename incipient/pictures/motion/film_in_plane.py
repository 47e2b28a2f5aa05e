"""A film of a run in the plane, painted on its quadratic cells."""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.path import Path as Outline
from scipy.spatial import KDTree

from ..flow.mesh import curve, triangles_of
from ..record import StoredRun
from ..style import GRAIN, INK, View
from .film import ARROWS, Film
from .trajectory import spoke


class FilmInPlane(Film):
    """One field on all cells, the grain with a spoke that shows how it is turned, its way so far."""

    _upwards = "y"

    def _box(self) -> View:
        first = self.run(0)
        if first.setting("domain", "top") != "free-surface":
            return first.box
        # A surface rises above where it began.
        return (*first.box[:3], max(self.run(number).box[3] for number in range(self.count)))

    def _shown(self, run: StoredRun, time: float) -> list[Artist]:
        drawn = [self._painted(run), *self._solids(run), *self.way(time), *self._spoke(run, time)]
        if self.field.name == "speed":
            drawn.append(self._flow(run))
        return drawn

    def _painted(self, run: StoredRun) -> Artist:
        triangles = triangles_of(run.mesh.points, run.mesh.quarters)
        return self.axes.tricontourf(
            triangles, self.field.values(run), levels=self.levels, cmap=self.colours, norm=self.norm,
            extend=self.field.beyond, zorder=1,
        )  # fmt: skip

    def _solids(self, run: StoredRun) -> list[Artist]:
        """The boundary of the fluid and the grains in it."""
        outer, *holes = (curve(run.mesh.points, loop) for loop in run.mesh.loops)
        drawn = [Polygon(outer, fill=False, edgecolor=INK, lw=0.8, zorder=3)]
        drawn += [Polygon(hole, facecolor=GRAIN, edgecolor=INK, lw=1.0, zorder=3) for hole in holes]
        return [self.axes.add_artist(patch) for patch in drawn]

    def _spoke(self, run: StoredRun, time: float) -> list[Artist]:
        if self.history is None or len(run.mesh.loops) < 2:
            return []
        axis = spoke(curve(run.mesh.points, run.mesh.loops[1]), self.history.at(time))
        line = Line2D(*axis.T, color=INK, lw=1.0, marker="o", markevery=[0], ms=2.5, zorder=4)
        return [self.axes.add_artist(line)]

    def _flow(self, run: StoredRun) -> Artist:
        """The velocity on a regular grid, from the three nearest nodes."""
        x0, x1, y0, y1 = run.box
        spacing = max(x1 - x0, y1 - y0) / ARROWS
        grid = np.meshgrid(np.arange(x0 + spacing / 2, x1, spacing), np.arange(y0 + spacing / 2, y1, spacing))
        places = np.column_stack([one.ravel() for one in grid])
        places = places[_in_fluid(run, places)]
        distances, nodes = KDTree(run.mesh.points).query(places, k=3)
        weights = 1.0 / np.maximum(distances, 1e-9 * spacing)
        weights /= weights.sum(axis=1, keepdims=True)
        velocities = np.einsum("nk,nkd->nd", weights, run.field("velocity")[nodes, :2])
        return self.arrows(places, velocities, spacing)


def _in_fluid(run: StoredRun, places: np.ndarray) -> np.ndarray:
    """(n,) whether places lie inside the outer boundary and outside the grains."""
    outer, *holes = (Outline(curve(run.mesh.points, loop, 2)) for loop in run.mesh.loops)
    inside = outer.contains_points(places)
    for hole in holes:
        inside &= ~hole.contains_points(places)
    return inside

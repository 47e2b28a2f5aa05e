"""The plane of pictures of a flow; in 3-D the vertical plane through the grain."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch, Polygon
from matplotlib.path import Path
from matplotlib.tri import Triangulation

from ..arrays import spatial
from ..geometry.placement import Placement
from .mesh import curve
from .outlines import Outline
from .style import GRAIN, GROUND, INK, View

if TYPE_CHECKING:
    from .record import StoredRun

BESIDE = 1e-5  # of the width: how far beside a plane of symmetry fields are cut
TETRAHEDRON, STRAIGHT = 24, 10  # VTK's numbers of the quadratic one and of the straight one
# Nodes of the eight straight tetrahedra that a quadratic one is cut into.
PARTS = (
    *((0, 4, 6, 7), (4, 1, 5, 8), (6, 5, 2, 9), (7, 8, 9, 3)),
    *((4, 5, 6, 8), (4, 6, 7, 8), (6, 7, 8, 9), (5, 6, 8, 9)),
)
SUBDIVIDED = 2  # halvings of curved triangles whose sections are drawn
_FINE = 0.02  # of the grain's size: between the points of its surface, whose section is drawn
_BELOW = 0.04  # of the height: ground that is shown below a bed


@dataclass(frozen=True, eq=False)
class Plane:
    """Fields on straight triangles, along the flow and upwards.

    points (n, 2); triangles (m, 3); fields: by name, (n,) or (n, 3)
    outlines, grains: closed lines (k, 2) around the fluid and around grains
    along: indices of the in-plane components; level: y of a plane in 3-D
    """

    points: np.ndarray
    triangles: np.ndarray
    fields: Mapping[str, np.ndarray]
    outlines: list[Outline]
    grains: list[Outline]
    along: tuple[int, int] = (0, 1)
    level: float | None = None

    @property
    def upwards(self) -> str:
        """Name of the axis that is shown upwards."""
        return "xyz"[self.along[1]]

    @property
    def box(self) -> View:
        """Left, right, lowest and highest coordinate of the fluid."""
        (x0, y0), (x1, y1) = self.points.min(axis=0), self.points.max(axis=0)
        return float(x0), float(x1), float(y0), float(y1)

    def within(self, view: View) -> np.ndarray:
        """(k, 3) the triangles that touch a rectangle."""
        corners = self.points[self.triangles]
        low, high = corners.min(axis=1), corners.max(axis=1)
        x0, x1, y0, y1 = view
        seen = (low[:, 0] <= x1) & (high[:, 0] >= x0) & (low[:, 1] <= y1) & (high[:, 1] >= y0)
        return self.triangles[seen]

    def triangulation(self, view: View | None = None) -> Triangulation:
        """matplotlib's triangulation, of a part of the plane or of all."""
        return Triangulation(*self.points.T, self.triangles if view is None else self.within(view))

    def views(self, ground: bool = False) -> list[View]:
        """The whole plane, with some ground below, and the part around a grain and its wake."""
        x0, x1, y0, y1 = self.box
        floor = y0 - (_BELOW * (y1 - y0) if ground else 0.0)
        whole = (x0, x1, floor, y1)
        if not self.grains:
            return [whole]
        outline = np.vstack(self.grains)
        (left, low), (right, high) = outline.min(axis=0), outline.max(axis=0)
        size, centre = max(right - left, high - low), (left + right) / 2
        near = (centre - 1.7 * size, centre + 2.7 * size, low - 0.5 * size, high + 0.7 * size)
        return [whole, (max(near[0], x0), min(near[1], x1), max(near[2], floor), min(near[3], y1))]

    def at(self, points: np.ndarray, name: str) -> np.ma.MaskedArray:
        """A field at points (n, 2), masked outside of the fluid."""
        pyvista = pyvista_off_screen()
        cells = pyvista.PolyData.from_regular_faces(spatial(self.points), self.triangles)
        cells["values"] = self.fields[name]
        samples = pyvista.PolyData(spatial(points)).sample(cells)
        outside = ~np.asarray(samples["vtkValidPointMask"], dtype=bool)
        values = np.asarray(samples["values"])
        mask = np.broadcast_to(outside.reshape(-1, *([1] * (values.ndim - 1))), values.shape)
        return np.ma.masked_array(values, mask)

    def velocities(
        self, view: View, across: int = 200
    ) -> tuple[np.ndarray, np.ndarray, np.ma.MaskedArray]:
        """Columns x, rows y, `across` along the longer side, and the velocity there (2, rows, columns)."""
        x0, x1, y0, y1 = view
        spacing = max(x1 - x0, y1 - y0) / across
        # Evenly spaced to round-off, half a spacing inside of the boundary.
        x, y = (
            np.linspace(low + spacing / 2, high - spacing / 2, max(int((high - low) / spacing), 2))
            for low, high in ((x0, x1), (y0, y1))
        )
        grid = np.stack(np.meshgrid(x, y), axis=-1)
        values = self.at(grid.reshape(-1, 2), "velocity")[:, self.along]
        return x, y, values.T.reshape(2, *grid.shape[:2])

    def draw_solids(
        self, axes: Axes, painted: Iterable[Artist] = (), fluid: str = "none", grain: bool = True
    ) -> None:
        """Draw the ground, the grain, and the boundary of the fluid, to which painted artists are clipped."""
        axes.set_facecolor(GROUND)
        lines = [Path(np.vstack([line, line[:1]]), closed=True) for line in self.outlines]
        looks: dict[str, Any] = {"facecolor": fluid, "edgecolor": INK, "lw": 0.8}
        boundary = PathPatch(
            Path.make_compound_path(*lines), zorder=0.5 if fluid != "none" else 3, **looks
        )
        axes.add_artist(boundary)
        for artist in painted:
            artist.set_clip_path(boundary)
        for outline in self.grains if grain else ():
            axes.add_artist(Polygon(outline, facecolor=GRAIN, edgecolor=INK, lw=0.9, zorder=3))


def plane_of(run: StoredRun) -> Plane:
    """A run's last fields on its plane of pictures."""
    if run.in_space:
        return _section(run)
    mesh = run.mesh
    outer, *holes = (curve(mesh.points, loop) for loop in mesh.loops)
    grains = holes if run.touching_grain is None else [run.touching_grain]
    return Plane(mesh.points, mesh.quarters, run.fields.fields, [outer], grains)


def _section(run: StoredRun) -> Plane:
    """The vertical plane through the grain, or the middle: straight parts of the cells, cut."""
    grid = pyvista_off_screen().UnstructuredGrid({TETRAHEDRON: run.fields.cells}, run.fields.points)
    for name, values in run.fields.fields.items():
        grid[name] = values
    level = level_of(run, BESIDE)
    origin = (0.0, level, 0.0)
    cut = _straight(grid, level).slice("y", origin=origin, generate_triangles=True)
    fields = {name: np.asarray(cut[name]) for name in run.fields.fields}
    outlines, grains = boundary_lines(grid, level), grain_lines(run, level)
    points = np.asarray(cut.points)[:, [0, 2]]
    return Plane(points, cut.regular_faces, fields, outlines, grains, (0, 2), level_of(run))


def pyvista_off_screen() -> Any:
    """pyvista, set to render without a display where there is none, before VTK makes a window."""
    if not os.environ.get("DISPLAY"):
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    import pyvista

    return pyvista


def level_of(run: StoredRun, beside: float = 0.0) -> float:
    """y of the plane that is shown: through the grain, or the middle; a fraction of the width within the domain."""
    low, high = run.fields.points[:, 1].min(), run.fields.points[:, 1].max()
    centre = run.value("grain", "computed_centre")
    y = run.middle if centre is None else float(centre[1])
    inwards = beside * (high - low)
    return float(np.clip(y, low + inwards, high - inwards))


def boundary_lines(grid: Any, level: float) -> list[Outline]:
    """Closed lines (n, 2) of x and z along which a plane of constant y cuts the boundary of quadratic tetrahedra."""
    y = grid.points[:, 1][grid.cells_dict[TETRAHEDRON]]
    cut = grid.extract_cells(np.flatnonzero((y.min(axis=1) <= level) & (y.max(axis=1) >= level)))
    surface = cut.extract_surface(nonlinear_subdivision=SUBDIVIDED, algorithm="dataset_surface")
    return _lines(surface.triangulate(), level)


def grain_lines(run: StoredRun, level: float) -> list[Outline]:
    """Closed lines (n, 2) around the grain where it was computed, in a plane of constant y."""
    centre = run.value("grain", "computed_centre")
    if centre is None:
        return []
    grain = run.model.grain
    placement = Placement(centre, quaternion=tuple(run.value("grain", "quaternion")))
    surface = grain.surface(_FINE * grain.size)
    points = placement.to_scene(surface.points)
    solid = pyvista_off_screen().PolyData.from_regular_faces(points, surface.triangles)
    return _lines(solid, level)


def _lines(surface: Any, level: float) -> list[Outline]:
    lines = surface.slice(normal="y", origin=(0.0, level, 0.0)).strip(join=True)
    return [line.points[:, [0, 2]] for line in lines.cell]


def _straight(grid: Any, level: float) -> Any:
    """The straight parts of quadratic tetrahedra that a plane of constant y goes through, on the same nodes."""
    cells = grid.cells_dict[TETRAHEDRON][:, np.array(PARTS)].reshape(-1, 4)
    y = grid.points[:, 1][cells]
    cells = cells[(y.min(axis=1) <= level) & (y.max(axis=1) >= level)]
    cut = pyvista_off_screen().UnstructuredGrid({STRAIGHT: cells}, grid.points)
    for name in grid.point_data:
        cut[name] = grid[name]
    return cut

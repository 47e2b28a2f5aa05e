"""Plane of pictures of a flow, in 3-D the vertical plane through the grain, cut by VTK; outlines of grains and beds."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.tri import Triangulation
from scipy.spatial import ConvexHull, QhullError

from ..arrays import spatial
from ..geometry.placement import Placement
from .style import GRAIN, GROUND, INK, View

if TYPE_CHECKING:
    from .record import StoredRun

BESIDE = 1e-8  # of the width: how far beside a plane of symmetry fields are cut
Outline = np.ndarray  # points (n, 2) around a grain


def pyvista_off_screen() -> Any:
    """pyvista, set to render off screen before VTK makes a window."""
    if not os.environ.get("DISPLAY"):
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    import pyvista

    return pyvista


@dataclass(frozen=True, eq=False)
class Plane:
    """Fields along the flow and upwards.

    sheet: pyvista's triangles in x and y, with values of the fields
    outlines, grains: closed lines (k, 2) around the fluid and around grains
    along: indices of the in-plane components; level: y of a plane in 3-D
    """

    sheet: Any
    outlines: list[Outline]
    grains: list[Outline]
    along: tuple[int, int] = (0, 1)
    level: float | None = None

    @cached_property
    def points(self) -> np.ndarray:
        return np.asarray(self.sheet.points)[:, :2]

    @property
    def upwards(self) -> str:
        return "xyz"[self.along[1]]

    @property
    def triangulation(self) -> Triangulation:
        return Triangulation(*self.points.T, self.sheet.regular_faces)

    def views(self, ground: bool = False) -> list[View]:
        """The whole plane, with ground below, and the surroundings of a grain and its wake."""
        x0, x1, y0, y1, *_ = self.sheet.bounds
        floor = y0 - (0.04 * (y1 - y0) if ground else 0.0)
        whole = (x0, x1, floor, y1)
        if not self.grains:
            return [whole]
        outline = np.vstack(self.grains)
        (left, low), (right, high) = outline.min(axis=0), outline.max(axis=0)
        size, centre = max(right - left, high - low), (left + right) / 2
        near = (centre - 1.7 * size, centre + 2.7 * size, low - 0.5 * size, high + 0.7 * size)
        return [whole, (max(near[0], x0), min(near[1], x1), max(near[2], floor), min(near[3], y1))]

    def at(self, points: np.ndarray, name: str) -> np.ma.MaskedArray:
        samples = pyvista_off_screen().PolyData(spatial(points)).sample(self.sheet)
        values = np.asarray(samples[name])
        outside = np.asarray(samples["vtkValidPointMask"]) == 0
        mask = np.broadcast_to(outside.reshape(-1, *([1] * (values.ndim - 1))), values.shape)
        return np.ma.masked_array(values, mask)

    def velocities(
        self, view: View, across: int = 200
    ) -> tuple[np.ndarray, np.ndarray, np.ma.MaskedArray]:
        """Columns x, rows y, `across` along the longer side, and velocity (2, rows, columns)."""
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
        """Draw ground, grain, and boundary of the fluid, to which painted artists are clipped."""
        axes.set_facecolor(GROUND)
        boundary = PathPatch(
            region_within(self.outlines), facecolor=fluid, edgecolor=INK, lw=0.8,
            zorder=3 if fluid == "none" else 0.5,
        )  # fmt: skip
        axes.add_artist(boundary)
        for artist in painted:
            artist.set_clip_path(boundary)
        if grain and self.grains:
            around = region_within(self.grains)
            axes.add_artist(PathPatch(around, facecolor=GRAIN, edgecolor=INK, lw=0.9, zorder=3))


def region_within(lines: list[Outline]) -> Path:
    """The region that an odd number of closed lines surround: matplotlib fills what their turns do not cancel."""
    closed, parts = [np.vstack([line, line[:1]]) for line in lines], []
    for line in closed:
        around = sum(Path(other).contains_point(line[0]) for other in closed if other is not line)
        x, y = line.T
        clockwise = float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])) < 0.0
        is_hole = around % 2 == 1
        parts.append(Path(line if clockwise == is_hole else line[::-1], closed=True))
    return Path.make_compound_path(*parts)


def plane_of(run: StoredRun) -> Plane:
    """A run's last fields on its plane of pictures."""
    along, level = ((0, 2), level_of(run)) if run.in_space else ((0, 1), None)
    fine = run.grid.extract_surface(nonlinear_subdivision=2, algorithm="dataset_surface")
    if run.in_space:
        origin = (0.0, level_of(run, BESIDE), 0.0)
        sheet = run.grid.slice("y", origin=origin, generate_triangles=True)
        # Cells with an edge in the plane of symmetry leave slivers, which matplotlib shades in wrong colours.
        sheet = sheet.clean(tolerance=100.0 * BESIDE * np.ptp(run.fields.points[:, 1]))
        sheet.lines = sheet.verts = np.empty(0, dtype=int)  # as which slivers are kept
        sides = fine.slice("y", origin=origin)
    else:
        sheet = run.grid.triangulate().extract_surface(algorithm="dataset_surface")
        edges = {"feature_edges": False, "manifold_edges": False, "non_manifold_edges": False}
        sides = fine.clean().extract_feature_edges(**edges)
    outlines = lines_of(sides, along)
    sheet.points = spatial(np.asarray(sheet.points)[:, along])
    return Plane(sheet, outlines, grain_lines(run, level), along, level)


def level_of(run: StoredRun, beside: float = 0.0) -> float:
    """y of the plane of pictures, of the grain or the middle, within the domain by a fraction `beside` of its width."""
    low, high = run.fields.points[:, 1].min(), run.fields.points[:, 1].max()
    placement = run.placement()
    y = run.scene.domain.middle if placement is None else placement.centre[1]
    inwards = beside * (high - low)
    return float(np.clip(y, low + inwards, high - inwards))


def grain_lines(run: StoredRun, level: float | None) -> list[Outline]:
    """Closed lines (n, 2) around the grain, in 3-D in a plane of constant y."""
    grain, placement = run.scene.grain, run.placement()
    if grain is None or placement is None:
        return []
    if level is None:
        return [grain_outline(grain, placement)]
    points, triangles = placed_surface(grain, placement, spacing=0.02)
    solid = pyvista_off_screen().PolyData.from_regular_faces(points, triangles)
    return lines_of(solid.slice("y", origin=(0.0, level, 0.0)), (0, 2))


def lines_of(segments: Any, along: tuple[int, int]) -> list[Outline]:
    """Lines (n, 2) of joined segments, the longest across first."""
    joined = segments.strip(join=True, max_length=segments.n_cells + 1)
    lines = [np.asarray(line.points)[:, along] for line in joined.cell]
    return sorted(lines, key=lambda line: -np.ptp(line, axis=0).max())


# -- outlines -----------------------------------------------------------------------------------------


def grain_outline(grain: Any, placement: Any) -> Outline:
    """Counter-clockwise points (n, 2) around a placed 2-D grain."""
    return np.vstack([_along(curve.moved(placement))[:-1] for curve in grain.outline()])


def hull(points: np.ndarray) -> Outline:
    """Convex hull of points (n, 2), in order; all of collinear ones."""
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:
        return points


def seen_from_the_side(grain: Any, placement: Placement) -> tuple[Outline, np.ndarray]:
    """Outline (n, 2) of a placed grain along x and upwards, and a line (2, 2) along its first axis to its surface."""
    if placement.gdim == 2:
        points = grain_outline(grain, placement)
        local = placement.to_body(points)
        tip = points[np.argmin(np.abs(np.arctan2(local[:, 1], local[:, 0])))]
        return points, np.array([placement.centre, tip])
    points, _ = placed_surface(grain, placement)
    arm = placement.to_body(points)[:, 0].max()
    ends = placement.to_scene([[0.0, 0.0, 0.0], [arm, 0.0, 0.0]])
    return hull(points[:, [0, 2]]), ends[:, [0, 2]]


def bed_line(bed: Any, x0: float, x1: float) -> np.ndarray:
    """Points (n, 2) along a 2-D bed from left to right, as far as it is known."""
    ((low, high),) = bed.extent
    return np.vstack([_along(curve) for curve in bed.curves(max(x0, low), min(x1, high))])


def placed_surface(
    grain: Any, placement: Any, spacing: float = 0.04
) -> tuple[np.ndarray, np.ndarray]:
    """Surface of a placed grain: points (n, 3) and triangles (m, 3); `spacing` in grain sizes."""
    surface = grain.surface(spacing * grain.size)
    return placement.to_scene(surface.points), surface.triangles


def _along(curve: Any) -> np.ndarray:
    return np.asarray(curve.point(np.linspace(0.0, 1.0, 49)))

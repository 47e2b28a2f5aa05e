"""A vertical plane through a 3-D run: its fields on a regular grid, from straight parts of the quadratic cells."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from matplotlib.patches import PathPatch, Polygon
from matplotlib.path import Path
from scipy.spatial import KDTree

from ..geometry.placement import Placement
from .record import StoredRun
from .style import GRAIN, GROUND, INK, View

BESIDE = 1e-5  # of the width: how far beside a plane of symmetry fields are cut
TETRAHEDRON, STRAIGHT = 24, 10  # VTK's numbers of the quadratic one and of the straight one
# Nodes of the eight straight tetrahedra that a quadratic one is cut into: VTK takes points far outside of curved cells
# for points within.
PARTS = (
    *((0, 4, 6, 7), (4, 1, 5, 8), (6, 5, 2, 9), (7, 8, 9, 3)),
    *((4, 5, 6, 8), (4, 6, 7, 8), (6, 7, 8, 9), (5, 6, 8, 9)),
)
COLUMNS = 500  # points along the longer side
SUBDIVIDED = 2  # halvings of curved triangles whose sections are drawn
_FINE = 0.02  # of the grain's size: between the points of its surface, whose section is drawn


@dataclass(frozen=True, eq=False)
class VerticalSection:
    """Fields on a regular grid (rows, columns) over a part (left, right, lowest, highest) of a vertical plane."""

    view: View
    x: np.ndarray  # of the columns
    z: np.ndarray  # of the rows
    inside: np.ndarray
    fields: dict[str, np.ndarray]  # outside of the fluid those of the next point in it
    fluid: tuple[
        np.ndarray, ...
    ]  # closed lines (n, 2) where the plane cuts the boundary of the mesh
    grain: tuple[np.ndarray, ...]  # closed lines (n, 2) around the grain, by its own shape


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


def views_of(run: StoredRun) -> list[View]:
    """The whole plane and, with a grain, its surroundings."""
    (x0, _, z0), (x1, _, z1) = run.fields.points.min(axis=0), run.fields.points.max(axis=0)
    whole = (float(x0), float(x1), float(z0), float(z1))
    centre, size = run.value("grain", "computed_centre"), run.value("grain", "size")
    if centre is None:
        return [whole]
    x, _, z = centre
    near = (x - 2.0 * size, x + 2.5 * size, z - 1.2 * size, z + 1.3 * size)
    return [
        whole,
        (max(near[0], x0), min(near[1], x1), max(near[2], z0 - 0.1 * size), min(near[3], z1)),
    ]


def section_of(
    run: StoredRun, view: View, names: Sequence[str], columns: int = COLUMNS
) -> VerticalSection:
    """Fields by name on a grid over a part of the plane, `columns` points along its longer side."""
    pyvista = pyvista_off_screen()
    spacing = max(view[1] - view[0], view[3] - view[2]) / columns
    x = np.arange(view[0] + 0.5 * spacing, view[1], spacing)
    z = np.arange(view[2] + 0.5 * spacing, view[3], spacing)
    across, up = np.meshgrid(x, z)
    level = level_of(run, BESIDE)
    points = np.column_stack([across.ravel(), np.full(across.size, level), up.ravel()])
    grid = tetrahedra(run, view, names)
    found = pyvista.PolyData(points).sample(straight(grid, level))
    # Points next to curved boundaries are missed: there the fields are those of the nearest point that is not.
    known = np.asarray(found["vtkValidPointMask"], dtype=bool)
    if known.any():
        missing = np.flatnonzero(~known)
        _, nearest = KDTree(points[known]).query(points[missing])
        for name in names:
            found[name][missing] = found[name][known][nearest]
    shape, values = across.shape, {name: np.asarray(found[name]) for name in names}
    shaped = {name: field.reshape(*shape, *field.shape[1:]) for name, field in values.items()}
    outlines = boundary_lines(grid, level), grain_lines(run, level)
    return VerticalSection(view, x, z, known.reshape(shape), shaped, *outlines)


def draw_outlines(axes: Axes, section: VerticalSection, image: AxesImage) -> list[Artist]:
    """Cut an image to the fluid, and draw lines around it, the ground outside, and the grain."""
    axes.set_facecolor(GROUND)
    codes = [Path(line, closed=True) for line in section.fluid]
    fluid = PathPatch(
        Path.make_compound_path(*codes), fill=False, edgecolor=INK, lw=0.8, zorder=2.5
    )
    grains = [
        Polygon(line, facecolor=GRAIN, edgecolor=INK, lw=0.9, zorder=3) for line in section.grain
    ]
    drawn = [axes.add_artist(one) for one in (fluid, *grains)]
    image.set_clip_path(fluid)
    return drawn


def boundary_lines(grid: Any, level: float) -> tuple[np.ndarray, ...]:
    """Closed lines (n, 2) of x and z along which a plane of constant y cuts the boundary of quadratic tetrahedra."""
    y = grid.points[:, 1][grid.cells_dict[TETRAHEDRON]]
    cut = grid.extract_cells(np.flatnonzero((y.min(axis=1) <= level) & (y.max(axis=1) >= level)))
    surface = cut.extract_surface(
        nonlinear_subdivision=SUBDIVIDED, algorithm="dataset_surface"
    ).triangulate()
    lines = surface.slice(normal="y", origin=(0.0, level, 0.0)).strip(join=True)
    return tuple(line.points[:, [0, 2]] for line in lines.cell)


def grain_lines(run: StoredRun, level: float) -> tuple[np.ndarray, ...]:
    """Closed lines (n, 2) around the grain where it was computed, in a plane of constant y."""
    centre = run.value("grain", "computed_centre")
    if centre is None:
        return ()
    grain = run.model.grain
    placement = Placement(centre, quaternion=tuple(run.value("grain", "quaternion")))
    surface = grain.surface(_FINE * grain.size)
    solid = pyvista_off_screen().PolyData.from_regular_faces(
        placement.to_scene(surface.points), surface.triangles
    )
    lines = solid.slice(normal="y", origin=(0.0, level, 0.0)).strip(join=True)
    return tuple(line.points[:, [0, 2]] for line in lines.cell)


def straight(grid: Any, level: float) -> Any:
    """The straight parts of quadratic tetrahedra that a plane of constant y goes through, on the same nodes."""
    cells = grid.cells_dict[TETRAHEDRON][:, np.array(PARTS)].reshape(-1, 4)
    y = grid.points[:, 1][cells]
    cells = cells[(y.min(axis=1) <= level) & (y.max(axis=1) >= level)]
    cut = pyvista_off_screen().UnstructuredGrid({STRAIGHT: cells}, grid.points)
    for name in grid.point_data:
        cut[name] = grid[name]
    return cut


def tetrahedra(run: StoredRun, view: View | None, names: Sequence[str]) -> Any:
    """The tetrahedra of a run, or those in a view from the side, with fields by name."""
    pyvista = pyvista_off_screen()
    cells = run.fields.cells
    if view is not None:
        x, z = run.fields.points[cells][..., 0], run.fields.points[cells][..., 2]
        seen = (x.max(axis=1) >= view[0]) & (x.min(axis=1) <= view[1])
        cells = cells[seen & (z.max(axis=1) >= view[2]) & (z.min(axis=1) <= view[3])]
    cut = pyvista.UnstructuredGrid({TETRAHEDRON: cells}, run.fields.points)
    for name in names:
        cut[name] = run.field(name)
    return cut

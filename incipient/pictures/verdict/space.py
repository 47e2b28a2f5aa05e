"""Pictures of runs in space: the flow in the vertical plane through the grain, traction, mesh, the judged grain.

The fields of a run stand on quadratic tetrahedra, which VTK cuts and samples; matplotlib sets the words.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ...geometry.space.beds import Terrain
from ...scene import Scene
from ..flow.cells import COLOURS, framed, pyvista_off_screen, stage
from ..flow.fields import Limits, from_zero, without_extremes
from ..flow.section import (
    BESIDE,
    TETRAHEDRON,
    draw_outlines,
    level_of,
    section_of,
    tetrahedra,
    views_of,
)
from ..flow.streamlines import streamlines
from ..record import StoredRun
from ..style import FLOW, FORCES, INK, PAPER, Looks, panels
from .grain import judged_numbers, sheet_of
from .judged import Judged
from .outlines import Solid
from .plane import Marks, aside, label, marks_of
from .sheet import explain, write_numbers
from .solid import Rendering, rendered

SPACING = 0.04  # of the triangles of a grain's surface, in grain sizes
QUADRATIC_TRIANGLE = 22  # VTK's number of the quadratic one
# Per cent of the nodes that have a smaller traction than that of the last colour: it is large in gaps.
_LARGEST = 98.0


def speed(run: StoredRun) -> Figure:
    """Speed in colour in the vertical plane through the grain's centre, with streamlines in that plane."""
    return _sections(run, "speed", "viridis", from_zero, lines=True)


def pressure(run: StoredRun) -> Figure:
    """Pressure in colour in the same plane; extremes exceed the colour bar."""
    return _sections(run, "pressure", "RdYlBu_r", without_extremes, lines=False)


def _sections(run: StoredRun, name: str, colours: str, limits: Limits, lines: bool) -> Figure:
    """The whole plane and, with a grain, its surroundings, each with colours of its own."""
    views = views_of(run)
    figure, places = panels(views, run.headline)
    for (axes, bar), view, what in zip(
        places, views, ("whole length", "around the grain"), strict=False
    ):
        section = section_of(run, view, ["velocity", "pressure"])
        fields = section.fields
        values = np.linalg.norm(fields["velocity"], axis=-1) if name == "speed" else fields[name]
        norm = limits(values[section.inside])
        looks: Looks = {"cmap": colours, "norm": norm, "interpolation": "bilinear", "zorder": 1}
        image = axes.imshow(values, origin="lower", extent=view, **looks)
        draw_outlines(axes, section, image)
        if lines:
            separation = 0.03 * np.sqrt((view[1] - view[0]) * (view[3] - view[2]))
            found = streamlines(section.along, separation)
            axes.add_collection(
                LineCollection(found, colors="white", linewidths=0.6, alpha=0.9, zorder=2)
            )
        axes.set(xlim=view[:2], ylim=view[2:], ylabel="z [scene units]")
        axes.set_title(f"{name.capitalize()} at y = {level_of(run):.4g}, {what}")
        figure.colorbar(ScalarMappable(norm, colours), cax=bar).set_label(f"{name} [scene units]")
    return figure


def mesh(run: StoredRun) -> Figure:
    """The cells that the vertical plane through the grain cuts, over the speed."""
    view = views_of(run)[-1]
    grid = tetrahedra(run, view, ["velocity"])
    level = level_of(run)
    low, high = run.fields.points[:, 1].min(), run.fields.points[:, 1].max()
    level = float(np.clip(level, low + BESIDE * (high - low), high))
    corners = run.fields.points[grid.cells_dict[TETRAHEDRON][:, :4]]
    behind = corners[..., 1].max(axis=1) > level
    kept = grid.extract_cells(np.flatnonzero(behind & (corners[..., 1].min(axis=1) <= level)))
    kept["speed"] = np.linalg.norm(kept["velocity"], axis=1)
    shown = kept.extract_surface(nonlinear_subdivision=0, algorithm="dataset_surface")
    x0, x1, z0, z1 = view
    across, up = shown.points[:, 0], shown.points[:, 2]
    seen = (across >= x0) & (across <= x1) & (up >= z0) & (up <= z1)
    fastest = float(shown["speed"][seen].max(initial=1e-12))
    plotter = stage(view)
    plotter.add_mesh(
        shown, scalars="speed", cmap=COLOURS, clim=(0.0, fastest), show_edges=True, edge_color=INK, lighting=False,
        show_scalar_bar=False,
    )  # fmt: skip
    plotter.camera.focal_point = (0.5 * (x0 + x1), level, 0.5 * (z0 + z1))
    plotter.camera.position = (0.5 * (x0 + x1), level - 10.0 * (x1 - x0), 0.5 * (z0 + z1))
    plotter.camera.up = (0.0, 0.0, 1.0)
    what = f"Cells cut by the plane y = {level:.4g}, coloured by the speed"
    return framed(plotter, view, run.headline, what, fastest, "z")


def traction(run: StoredRun) -> Figure:
    """The size of the traction on the grain's surface in colour, seen from upstream and from downstream."""
    assert run.surface is not None
    points, cells, values = whole_surface(run)
    size = np.linalg.norm(values, axis=1)
    norm = Normalize(0.0, last_colour(size))
    figure = Figure(figsize=(9.4, 4.7))
    figure.text(
        0.05, 0.965, f"{run.title}: traction of the fluid on the grain", fontsize=11, va="top"
    )
    for left, along, words in ((0.02, -1.0, "from upstream"), (0.45, 1.0, "from downstream")):
        axes = figure.add_axes((left, 0.04, 0.42, 0.8))
        axes.imshow(_shown_surface(points, cells, values, norm, along), interpolation="antialiased")
        axes.set_axis_off()
        axes.set_title(f"Seen {words}, with the traction's arrows")
    beside = figure.add_axes((0.9, 0.12, 0.017, 0.65))
    bar = figure.colorbar(ScalarMappable(norm, "magma"), cax=beside, extend="max")
    bar.set_label("size of the traction [scene units]")
    return figure


def last_colour(sizes: np.ndarray) -> float:
    """The size of the traction that has the last colour, by the sizes (n,) at the nodes."""
    return float(np.percentile(sizes, _LARGEST)) or 1.0


def whole_surface(run: StoredRun) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes, quadratic triangles and traction of the grain's surface, half a grain with its mirror image."""
    assert run.surface is not None
    points, cells, values = run.surface.points, run.surface.cells, run.surface.fields["traction"]
    if run.halved:
        values = np.vstack([values, values * [1.0, -1.0, 1.0]])
    return *run.whole(points, cells), values


def _shown_surface(
    points: np.ndarray, cells: np.ndarray, values: np.ndarray, norm: Normalize, along: float
) -> np.ndarray:
    pyvista = pyvista_off_screen()
    surface = pyvista.UnstructuredGrid({QUADRATIC_TRIANGLE: cells}, points)
    surface["size"] = np.linalg.norm(values, axis=1)
    plotter = pyvista.Plotter(off_screen=True, window_size=[1100, 1100], lighting="three lights")
    plotter.background_color = "white"
    drawn = surface.extract_surface(nonlinear_subdivision=2, algorithm="dataset_surface")
    shown = {"clim": (norm.vmin, norm.vmax), "show_scalar_bar": False, "smooth_shading": True}
    plotter.add_mesh(drawn, scalars="size", cmap="magma", **shown)
    extent = float(np.ptp(points, axis=0).max())
    largest = float(norm.vmax or 1.0)
    step = max(1, len(points) // 400)
    few = pyvista.PolyData(points[::step])
    sizes = np.linalg.norm(values[::step], axis=1, keepdims=True)
    few["arrows"] = values[::step] / largest * np.minimum(1.0, largest / np.maximum(sizes, 1e-300))
    arrows = few.glyph(orient="arrows", scale="arrows", factor=0.35 * extent)
    plotter.add_mesh(arrows, color=FLOW, show_scalar_bar=False)
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    plotter.camera.parallel_projection = True
    plotter.camera.focal_point = centre
    plotter.camera.position = centre + 10.0 * extent * np.array([along, -0.6, 0.35])
    plotter.camera.up = (0.0, 0.0, 1.0)
    plotter.camera.parallel_scale = 0.85 * extent
    plotter.reset_camera_clipping_range()
    image = np.asarray(plotter.screenshot(return_img=True))
    plotter.close()
    return image


def verdict(run: StoredRun) -> Figure:
    """The grain on its bed with contacts, forces and couple; the verdict in words; the numbers behind it."""
    figure, axes, case = sheet_of(run)
    if case is None:
        axes.set_axis_off()
    else:
        scene = Scene(**run.scene)
        explain(
            axes,
            show_judged(axes, case, *placed_surface(scene.grain, scene.placement), scene.bed_shape),
        )
    write_numbers(axes, judged_numbers(run, case, planar=False))
    return figure


def placed_surface(grain: Any, placement: Any, coarser: int = 1) -> Solid:
    """A grain's surface at its place: points (n, 3) and triangles (m, 3), coarser than usual by a factor."""
    surface = grain.surface(coarser * SPACING * grain.size)
    return placement.to_scene(surface.points), surface.triangles


def show_judged(
    axes: Axes,
    case: Judged,
    points: np.ndarray,
    triangles: np.ndarray,
    terrain: Terrain | None = None,
) -> Marks:
    """Show a judged case in space with its grain's surface, points (n, 3) and triangles (m, 3); what the marks mean."""
    seen = rendered(case, points, triangles, terrain)
    axes.imshow(seen.image, aspect="auto", interpolation="antialiased")
    axes.set(xticks=[], yticks=[])
    _name_forces(axes, seen)
    if len(seen.numbers) > 1:
        for index, (across, down) in enumerate(seen.numbers):
            axes.text(
                across, down, f"{index + 1}", ha="center", va="center", fontsize=8, bbox=PAPER
            )
    _show_triad(axes, seen.triad, seen.image.shape)
    return marks_of(case)


def _name_forces(axes: Axes, seen: Rendering) -> None:
    """The names of the forces beyond their tips."""
    upright = np.array([1.0, -1.0])  # images count rows downward
    along = {name: upright * (tip - seen.centre) for name, tip in seen.tips.items()}
    for name, arrow in along.items():
        unit = arrow / max(float(np.linalg.norm(arrow)), 1e-300)
        others = [other for key, other in along.items() if key != name]
        place = seen.tips[name] + 0.015 * seen.image.shape[1] * upright * unit
        label(axes, place, unit + aside(unit, others), name, FORCES[name])


def _show_triad(axes: Axes, directions: np.ndarray, shape: tuple[int, ...]) -> None:
    """The three axes in the lower left corner, as the camera sees them."""
    corner = np.array([0.07 * shape[1], 0.92 * shape[0]])
    longest = float(np.linalg.norm(directions, axis=1).max())
    for name, direction in zip("xyz", 0.055 * shape[1] / longest * directions, strict=True):
        axes.plot(*np.array([corner, corner + direction]).T, color=INK, lw=1.0)
        across, down = corner + 1.3 * direction
        axes.text(across, down, name, ha="center", va="center", fontsize=8)

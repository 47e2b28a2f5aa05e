"""The traction of the fluid on the grain's surface: arrows and components in 2-D, two views of it in 3-D."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..arrays import planar_cross, quarter_turned
from .drawing import draw_grain, show_place
from .mesh import curve, directed, enclosed_area
from .plane import pyvista_off_screen
from .record import StoredRun
from .style import FLOW, INK, PULL, PUSH, headline

_ARROWS = 64
_LONGEST = 0.75  # arrow of a traction, in grain sizes
# Per cent of the nodes with a traction below the last colour: traction is large in gaps.
_LARGEST = 98.0
QUADRATIC_TRIANGLE = 22  # VTK's number of the quadratic one


def picture(run: StoredRun) -> Figure:
    """The traction on the grain of a run."""
    return _in_3d(run) if run.in_space else _in_2d(run)


def _in_2d(run: StoredRun) -> Figure:
    """Arrows of the traction on the grain's surface, and its components around the grain."""
    assert run.surface is not None
    edges = directed(run.surface.cells)
    points, tractions = run.surface.points[:, :2], run.surface.fields["traction"][:, :2]
    if enclosed_area(points, edges) < 0:
        edges = edges[::-1][:, [1, 0, 2]]
    middles, start, end = (points[edges[:, k]] for k in (2, 0, 1))
    normals = -quarter_turned(end - start)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    figure = Figure(figsize=(9.4, 4.7), layout="constrained")
    headline(figure, f"{run.title}: traction of the fluid on the grain")
    left, right = figure.subplots(1, 2, width_ratios=(1.2, 1.0))
    grain = curve(points, edges) if run.touching_grain is None else run.touching_grain
    _show_arrows(run, left, grain, middles, tractions[edges[:, 2]], normals)
    centre = np.array(run.value("grain", "centre", middles.mean(axis=0))[:2], dtype=float)
    _show_components(right, middles - centre, tractions[edges[:, 2]], normals)
    return figure


def _show_arrows(
    run: StoredRun,
    axes: Axes,
    grain: np.ndarray,
    points: np.ndarray,
    tractions: np.ndarray,
    normals: np.ndarray,
) -> None:
    """Pressing tractions end on the surface, pulling ones start there: all stand outside the grain."""
    size = float(np.ptp(points, axis=0).max())
    show_place(axes, points, size, above=0.95)
    axes.set_aspect("equal")
    run.plane.draw_solids(axes, fluid="white", grain=False)
    draw_grain(axes, grain)
    steps = np.linalg.norm(np.diff(points, axis=0, append=points[:1]), axis=1)
    evenly = np.arange(_ARROWS) * steps.sum() / _ARROWS
    chosen = np.unique(np.minimum(np.searchsorted(np.cumsum(steps), evenly), len(points) - 1))
    strength = np.linalg.norm(tractions[chosen], axis=1)
    longest = float(np.percentile(strength, 95)) or 1.0
    shortened = np.minimum(1.0, 1.3 * longest / np.maximum(strength, 1e-300))
    shown = tractions[chosen] * shortened[:, None]
    presses = np.sum(tractions[chosen] * normals[chosen], axis=1) < 0
    for which, pivot, colour in ((presses, "tip", PUSH), (~presses, "tail", PULL)):
        arrows = axes.quiver(
            *points[chosen][which].T, *shown[which].T, pivot=pivot, color=colour, angles="xy", scale_units="xy",
            scale=longest / (_LONGEST * size), width=0.0045, headwidth=4, headlength=5, zorder=5,
        )  # fmt: skip
    axes.quiverkey(
        arrows, 0.3, 0.94, longest, f"{longest:.3g} scene units", labelpos="E", color=INK, zorder=6
    )
    marks = [Line2D([], [], color=colour, lw=2) for colour in (PUSH, PULL)]
    labels = ["presses on the grain", "pulls at the grain"]
    axes.legend(marks, labels, loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0.2, ncols=2)


def _show_components(
    axes: Axes, arms: np.ndarray, tractions: np.ndarray, normals: np.ndarray
) -> None:
    """Components along normal and surface against the direction (n,) from the centre, broken where no flow is."""
    angles = np.degrees(np.arctan2(arms[:, 1], arms[:, 0])) % 360
    order = np.argsort(angles)
    apart = np.diff(angles[order])
    broken = np.flatnonzero(apart > 8.0 * np.median(apart)) + 1
    for part, colour, label in (
        (np.sum(tractions * normals, axis=1), PUSH, "along the outward normal (negative: pressed)"),
        (planar_cross(normals, tractions), PULL, "along the surface, anticlockwise"),
    ):
        lines = (np.insert(values[order], broken, np.nan) for values in (angles, part))
        axes.plot(*lines, color=colour, lw=1.3, label=label)
    axes.axhline(0, color=INK, lw=0.5)
    axes.set(xlim=(0, 360), xlabel="direction from the grain's centre [degrees]")
    axes.set_ylabel("traction [scene units]")
    axes.set_xticks([0, 90, 180, 270, 360], ["0\n+x", "90\n+y", "180\n−x", "270\n−y", "360\n+x"])
    axes.grid(color="#dddddd", lw=0.5)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0.2)


def _in_3d(run: StoredRun) -> Figure:
    """The size of the traction on the grain's surface in colour, seen from upstream and from downstream."""
    points, cells, values = whole_surface(run)
    norm = Normalize(0.0, last_colour(np.linalg.norm(values, axis=1)))
    figure = Figure(figsize=(9.4, 4.7), layout="constrained")
    headline(figure, f"{run.title}: traction of the fluid on the grain")
    pair = figure.subplots(1, 2)
    for axes, along, words in zip(
        pair, (-1.0, 1.0), ("from upstream", "from downstream"), strict=True
    ):
        axes.imshow(_shown_surface(points, cells, values, norm, along), interpolation="antialiased")
        axes.set_axis_off()
        axes.set_title(f"Seen {words}, with the traction's arrows")
    bar = figure.colorbar(ScalarMappable(norm, "magma"), ax=pair, extend="max", shrink=0.8)
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
    """An image of the surface, seen along x and a little from above."""
    pyvista = pyvista_off_screen()
    surface = pyvista.UnstructuredGrid({QUADRATIC_TRIANGLE: cells}, points)
    surface["size"] = np.linalg.norm(values, axis=1)
    plotter = pyvista.Plotter(off_screen=True, window_size=[1100, 1100], lighting="three lights")
    plotter.background_color = "white"
    drawn = surface.extract_surface(nonlinear_subdivision=2, algorithm="dataset_surface")
    shown = {"clim": (norm.vmin, norm.vmax), "show_scalar_bar": False, "smooth_shading": True}
    plotter.add_mesh(drawn, scalars="size", cmap="magma", **shown)
    few = pyvista.PolyData(points[:: max(1, len(points) // 400)])
    few["traction"] = values[:: max(1, len(points) // 400)]
    extent = float(np.ptp(points, axis=0).max())
    lengths = {"scale": "traction", "factor": 0.35 * extent / (norm.vmax or 1.0)}
    arrows = few.glyph(orient="traction", clamping=False, **lengths)
    plotter.add_mesh(arrows, color=FLOW, show_scalar_bar=False)
    plotter.enable_parallel_projection()
    plotter.view_vector((along, -0.6, 0.35), viewup=(0.0, 0.0, 1.0))
    image = np.asarray(plotter.screenshot(return_img=True))
    plotter.close()
    return image

"""Pictures of the traction on the grain and of the free surface."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy.spatial import KDTree

from ..arrays import planar_cross, quarter_turned
from ..geometry.space.beds import Terrain
from ..scene import Domain
from .drawing import draw_grain, show_place
from .plane import pyvista_off_screen
from .record import StoredRun
from .style import FLOW, INK, PULL, PUSH, Looks, headline, panels

_ARROWS = 64
_LONGEST = 0.75  # arrow of a traction, in grain sizes
# Per cent of the nodes with a traction below the last colour: traction is large in gaps.
_LARGEST = 98.0
_UPWARD = 0.1  # least rise of a normal that points up
_LEVELS = 24  # colours
_LINES, _PLACES = 7, 201  # of equal height of the bed; in each direction at which that is known


def traction(run: StoredRun) -> Figure:
    """Traction on the grain: arrows and components in 2-D, two views in 3-D."""
    figure = Figure(figsize=(9.4, 4.7), layout="constrained")
    headline(figure, f"{run.title}: traction of the fluid on the grain")
    if run.in_space:
        _show_views(figure, run)
        return figure
    points, tractions, normals = _around(run)
    left, right = figure.subplots(1, 2, width_ratios=(1.2, 1.0))
    _show_arrows(run, left, points, tractions, normals)
    centre = np.array(run.value("grain", "centre", points.mean(axis=0))[:2], dtype=float)
    _show_components(right, points - centre, tractions, normals)
    return figure


def _around(run: StoredRun) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Midpoints of a 2-D grain's facets in order, tractions and outward normals, (n, 2)."""
    assert run.surface is not None
    cells = run.surface.cells
    halves = np.insert(np.vstack([cells[:, [0, 2]], cells[:, [2, 1]]]), 0, 2, axis=1)
    sides = pyvista_off_screen().PolyData(run.surface.points, lines=halves)
    (line, *_) = sides.strip(join=True, max_length=2 * len(cells) + 1).cell
    nodes = np.array(line.point_ids)
    points = run.surface.points[:, :2]
    x, y = points[nodes].T
    if np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) < 0.0:  # clockwise
        nodes = nodes[::-1]
    first = 1 if np.isin(nodes[1], cells[:, 2]) else 2
    middles = nodes[first:-1:2]
    along = points[nodes[first + 1 :: 2]] - points[nodes[first - 1 : -2 : 2]]
    normals = -quarter_turned(along) / np.linalg.norm(along, axis=1)[:, None]
    return points[middles], run.surface.fields["traction"][middles, :2], normals


def _show_arrows(
    run: StoredRun, axes: Axes, points: np.ndarray, tractions: np.ndarray, normals: np.ndarray
) -> None:
    size = float(np.ptp(points, axis=0).max())
    show_place(axes, points, size, above=0.95)
    axes.set_aspect("equal")
    run.plane.draw_solids(axes, fluid="white", grain=False)
    for grain in run.plane.grains:
        draw_grain(axes, grain)
    steps = np.linalg.norm(np.diff(points, axis=0, append=points[:1]), axis=1)
    evenly = np.arange(_ARROWS) * steps.sum() / _ARROWS
    chosen = np.unique(np.minimum(np.searchsorted(np.cumsum(steps), evenly), len(points) - 1))
    strength = np.linalg.norm(tractions[chosen], axis=1)
    longest = float(np.percentile(strength, 95)) or 1.0
    shortened = np.minimum(1.0, 1.3 * longest / np.maximum(strength, 1e-300))
    shown = tractions[chosen] * shortened[:, None]
    presses = np.sum(tractions[chosen] * normals[chosen], axis=1) < 0
    looks: Looks = {"angles": "xy", "scale_units": "xy", "scale": longest / (_LONGEST * size)}
    looks |= {"width": 0.0045, "headwidth": 4, "headlength": 5, "zorder": 5}
    for which, pivot, colour in ((presses, "tip", PUSH), (~presses, "tail", PULL)):
        at = points[chosen][which].T
        arrows = axes.quiver(*at, *shown[which].T, pivot=pivot, color=colour, **looks)
    said = f"{longest:.3g} scene units"
    axes.quiverkey(arrows, 0.3, 0.94, longest, said, labelpos="E", color=INK, zorder=6)
    marks = [Line2D([], [], color=colour, lw=2) for colour in (PUSH, PULL)]
    labels = ["presses on the grain", "pulls at the grain"]
    axes.legend(marks, labels, loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0.2, ncols=2)


def _show_components(
    axes: Axes, arms: np.ndarray, tractions: np.ndarray, normals: np.ndarray
) -> None:
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


def _show_views(figure: Figure, run: StoredRun) -> None:
    points, cells, values = whole_surface(run)
    norm = Normalize(0.0, last_colour(np.linalg.norm(values, axis=1)))
    pair = figure.subplots(1, 2)
    sides = ((-1.0, "from upstream"), (1.0, "from downstream"))
    for axes, (along, words) in zip(pair, sides, strict=True):
        axes.imshow(_shown_surface(points, cells, values, norm, along), interpolation="antialiased")
        axes.set_axis_off()
        axes.set_title(f"Seen {words}, with the traction's arrows")
    bar = figure.colorbar(ScalarMappable(norm, "magma"), ax=pair, extend="max", shrink=0.8)
    bar.set_label("size of the traction [scene units]")


def last_colour(sizes: np.ndarray) -> float:
    """Traction at the upper colour limit, from the magnitudes (n,) at the nodes."""
    return float(np.percentile(sizes, _LARGEST)) or 1.0


def whole_surface(run: StoredRun) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes, quadratic triangles and traction of the grain's surface, with the mirror image of a half."""
    assert run.surface is not None
    points, cells, values = run.surface.points, run.surface.cells, run.surface.fields["traction"]
    if run.halved:
        values = np.vstack([values, values * [1.0, -1.0, 1.0]])
    return *run.whole(points, cells), values


def _shown_surface(
    points: np.ndarray, cells: np.ndarray, values: np.ndarray, norm: Normalize, along: float
) -> np.ndarray:
    pyvista = pyvista_off_screen()
    surface = pyvista.UnstructuredGrid({pyvista.CellType.QUADRATIC_TRIANGLE: cells}, points)
    surface["size"] = np.linalg.norm(values, axis=1)
    plotter = pyvista.Plotter(off_screen=True, window_size=[1100, 1100], lighting="three lights")
    plotter.background_color = "white"
    drawn = surface.extract_surface(nonlinear_subdivision=2, algorithm="dataset_surface")
    shown = {"clim": (norm.vmin, norm.vmax), "show_scalar_bar": False, "smooth_shading": True}
    plotter.add_mesh(drawn, scalars="size", cmap="magma", **shown)
    every = max(1, len(points) // 400)
    extent = float(np.ptp(points, axis=0).max())
    plotter.add_arrows(
        points[::every], values[::every], 0.35 * extent / (norm.vmax or 1.0), color=FLOW,
        show_scalar_bar=False,
    )  # fmt: skip
    plotter.enable_parallel_projection()
    plotter.view_vector((along, -0.6, 0.35), viewup=(0.0, 0.0, 1.0))
    image = np.asarray(plotter.screenshot(return_img=True))
    plotter.close()
    return image


def elevation(run: StoredRun) -> Figure:
    """Elevation of the free surface of a 3-D run in colour, the bed's height in lines."""
    points, triangles = run.whole(*surface_of(run))
    scene = run.model
    domain = scene.domain
    above = points[:, 2] - domain.ceiling
    figure, (axes,) = panels([(domain.left, domain.right, *domain.across)], run.headline)
    largest = max(float(np.abs(above).max()), 1e-300)
    levels = np.linspace(-largest, largest, _LEVELS + 1)
    looks: Looks = {"levels": levels, "cmap": "RdBu_r"}
    drawn = axes.tricontourf(points[:, 0], points[:, 1], triangles, above, **looks)
    forms = _show_bed(domain, scene.bed_shape, axes)
    axes.set_title("The free surface from above" + ("; lines: heights of the bed" if forms else ""))
    figure.colorbar(drawn, ax=axes).set_label("elevation [scene units]")
    return figure


def surface_of(run: StoredRun) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) and straight triangles (m, 3) of the free surface: upward facets except the grain's."""
    grid = run.grid.copy(deep=False)
    # Places in VTK are of single precision.
    grid["node"] = np.arange(len(run.fields.points), dtype=float)
    grid["grain"] = np.zeros(len(run.fields.points))
    if run.surface is not None:
        reach = 1e-6 * float(np.ptp(run.surface.points, axis=0).max())
        grid["grain"] = 1.0 * (KDTree(run.surface.points).query(run.fields.points)[0] < reach)
    sides = grid.extract_surface(nonlinear_subdivision=1, algorithm="dataset_surface").triangulate()
    sides = sides.compute_normals(point_normals=False, auto_orient_normals=True)
    triangles = sides.regular_faces
    upwards = sides["Normals"][:, 2] > _UPWARD
    used, rows = np.unique(
        triangles[upwards & (sides["grain"][triangles].min(axis=1) < 1.0)], return_inverse=True
    )
    nodes = np.rint(sides["node"][used]).astype(int)
    return run.fields.points[nodes], rows.reshape(-1, 3)


def _show_bed(domain: Domain, bed: Terrain | None, axes: Axes) -> bool:
    if bed is None or not np.isfinite(bed.feature):
        return False
    x, y = (np.linspace(*sides, _PLACES) for sides in ((domain.left, domain.right), domain.across))
    places = np.stack(np.meshgrid(x, y), axis=-1)
    heights = bed.height(places.reshape(-1, 2)).reshape(_PLACES, _PLACES)
    axes.contour(x, y, heights, _LINES, colors=INK, linewidths=0.5)
    return True

"""Pictures of the traction on the grain and of the free surface."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ..arrays import planar_cross
from .drawing import draw_grain, frame
from .plane import pyvista_off_screen
from .record import StoredRun, grid_of
from .style import FLOW, INK, PULL, PUSH, headline, panels


def traction(run: StoredRun) -> Figure:
    """Traction on the grain: arrows and components in 2-D, two views in 3-D."""
    figure = Figure(figsize=(9.4, 4.7), layout="constrained")
    headline(figure, f"{run.title}: traction of the fluid on the grain{run.moment}")
    if run.in_space:
        _show_views(figure, run)
        return figure
    left, right = figure.subplots(1, 2, width_ratios=(1.2, 1.0))
    grain, placement = run.scene.grain, run.placement()
    assert run.surface is not None and grain is not None and placement is not None
    middle = run.surface.cells[:, 2]  # of the facets
    points, tractions = run.surface.points[middle, :2], run.surface.fields["traction"][middle, :2]
    angles = np.degrees(np.arctan2(*(points - placement.centre).T[::-1])) % 360
    order = np.argsort(angles)
    angles, points, tractions = angles[order], points[order], tractions[order]
    normals = grain.normal(placement.to_body(points)) @ placement.rotation.T
    normal, tangential = (tractions * normals).sum(axis=1), planar_cross(normals, tractions)
    frame(left, points, grain.size, above=0.95)
    run.plane.draw_solids(left, fluid="white", grain=False)
    draw_grain(left, run.plane.grains[0])
    _show_arrows(left, points, tractions, normal < 0.0, grain.size)
    # Lines break where an object hides the grain's side from its centre.
    broken = np.flatnonzero(np.diff(angles) > 8.0 * np.median(np.diff(angles))) + 1
    for values, colour, label in (
        (normal, PUSH, "normal, positive outwards"),
        (tangential, PULL, "tangential, positive counterclockwise"),
    ):
        lines = (np.insert(line, broken, np.nan) for line in (angles, values))
        right.plot(*lines, color=colour, lw=1.3, label=label)
    right.axhline(0, color=INK, lw=0.5)
    right.set(xlim=(0, 360), xlabel="direction from the centre of the grain [degrees from +x]")
    right.set(ylabel="traction [scene units]", xticks=[0, 90, 180, 270, 360])
    right.grid(color="#dddddd", lw=0.5)
    for axes in (left, right):
        axes.legend(loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0.2)
    return figure


def _show_arrows(
    axes: Axes, points: np.ndarray, tractions: np.ndarray, presses: np.ndarray, size: float
) -> None:
    """Arrows to one scale up to a length, at even spacings along the grain."""
    way = np.cumsum(np.linalg.norm(np.diff(points, axis=0, prepend=points[:1]), axis=1))
    chosen = np.unique(np.searchsorted(way, np.linspace(0.0, way[-1], 64)))
    points, tractions, presses = points[chosen], tractions[chosen], presses[chosen]
    strength = np.linalg.norm(tractions, axis=1)
    longest = float(np.percentile(strength, 95)) or 1.0
    shown = tractions * np.minimum(1.0, longest / np.maximum(strength, 1e-300))[:, None]
    for kind, pivot, colour, label in (
        (presses, "tip", PUSH, "pushes on the grain"),
        (~presses, "tail", PULL, "pulls on the grain"),
    ):
        arrows = axes.quiver(
            *points[kind].T, *shown[kind].T, color=colour, pivot=pivot, label=label, width=0.0045,
            angles="xy", scale_units="xy", scale=longest / (0.75 * size), zorder=5,
        )  # fmt: skip
    axes.quiverkey(
        arrows, 0.3, 0.94, longest, f"{longest:.3g} scene units", labelpos="E", color=INK
    )


def _show_views(figure: Figure, run: StoredRun) -> None:
    assert run.surface is not None
    pyvista = pyvista_off_screen()
    grid = _whole(run, grid_of(run.surface, "QUADRATIC_TRIANGLE"))
    points, values = np.asarray(grid.points), np.asarray(grid["traction"])
    grid["size"] = np.linalg.norm(values, axis=1)
    norm = Normalize(0.0, float(np.percentile(grid["size"], 98.0)) or 1.0)  # it is large in gaps
    surface = grid.extract_surface(nonlinear_subdivision=2, algorithm="dataset_surface")
    every = max(1, len(points) // 400)
    longest = 0.35 * float(np.ptp(points, axis=0).max()) / (norm.vmax or 1.0)
    plotter = pyvista.Plotter(
        off_screen=True, shape=(1, 2), border=False, window_size=[2200, 1100], lighting="three lights"
    )  # fmt: skip
    plotter.background_color = "white"
    for side, along in enumerate((-1.0, 1.0)):
        plotter.subplot(0, side)
        plotter.add_mesh(
            surface, scalars="size", clim=(norm.vmin, norm.vmax), cmap="magma",
            smooth_shading=True, show_scalar_bar=False,
        )  # fmt: skip
        plotter.add_arrows(
            points[::every], values[::every], longest, color=FLOW, show_scalar_bar=False
        )
        plotter.enable_parallel_projection()
        plotter.view_vector((along, -0.6, 0.35), viewup=(0.0, 0.0, 1.0))
    axes = figure.add_subplot(title="Traction vectors, seen along x and against it")
    axes.imshow(np.asarray(plotter.screenshot(return_img=True)), interpolation="antialiased")
    axes.set_axis_off()
    plotter.close()
    figure.colorbar(
        ScalarMappable(norm, "magma"), ax=axes, extend="max", shrink=0.8,
        label="magnitude of the traction [scene units]",
    )  # fmt: skip


def _whole(run: StoredRun, surface: Any) -> Any:
    """A surface of pyvista, with its mirror image for half a domain."""
    domain = run.scene.domain
    if run.fields.points[:, 1].min() < domain.middle - 0.25 * (domain.width or 0.0):
        return surface
    other = surface.reflect(
        (0, 1, 0), point=(0.0, domain.middle, 0.0), transform_all_input_vectors=True
    )
    return surface.merge(other, merge_points=False)


def elevation(run: StoredRun) -> Figure:
    """Elevation of the free surface of a 3-D run."""
    surface = _whole(run, pyvista_off_screen().PolyData.from_regular_faces(*surface_of(run)))
    points, triangles = np.asarray(surface.points), surface.regular_faces
    domain = run.scene.domain
    above = points[:, 2] - domain.ceiling
    figure, (axes,) = panels([(domain.left, domain.right, *domain.across)], run.headline)
    largest = max(float(np.abs(above).max()), 1e-300)
    drawn = axes.tricontourf(
        points[:, 0], points[:, 1], triangles, above, levels=np.linspace(-largest, largest, 25),
        cmap="RdBu_r",
    )  # fmt: skip
    axes.set_title("The free surface from above")
    figure.colorbar(drawn, ax=axes).set_label("elevation [scene units]")
    return figure


def surface_of(run: StoredRun) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) and straight triangles (m, 3) of the free surface: upward facets except the grain's."""
    grid = run.grid.copy(deep=False)
    # Coordinates in VTK are of single precision.
    grid["node"] = np.arange(len(run.fields.points), dtype=float)
    sides = grid.extract_surface(nonlinear_subdivision=1, algorithm="dataset_surface").triangulate()
    sides = sides.compute_normals(point_normals=False, auto_orient_normals=True)
    upwards = sides.extract_cells(sides["Normals"][:, 2] > 0.1)
    x0, x1, y0, y1, low, high = grid.bounds
    above = (x0 + x1) / 2, (y0 + y1) / 2, 2.0 * high - low
    surface = upwards.connectivity("closest", closest_point=above)  # without a grain's underside
    nodes = np.rint(surface["node"]).astype(int)
    return run.fields.points[nodes], surface.cells.reshape(-1, 4)[:, 1:]

"""The mesh, seen through VTK: the cells on the speed they carry, as ParaView would show them."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ...arrays import spatial
from .. import style
from ..record import StoredRun

PIXELS = 1600  # across
COLOURS = "YlGnBu"  # of the speed


def picture(run: StoredRun) -> Figure:
    """The cells over the speed, rendered off screen with pyvista. Not collective."""
    pyvista = pyvista_off_screen()
    cells = {pyvista.CellType.QUADRATIC_TRIANGLE: run.mesh.cells}
    grid = pyvista.UnstructuredGrid(cells, spatial(run.mesh.points))
    speeds = grid["speed"] = np.linalg.norm(run.field("velocity"), axis=1)
    view, (x, y) = _view(run), run.mesh.points.T
    seen = (x >= view[0]) & (x <= view[1]) & (y >= view[2]) & (y <= view[3])
    fastest = float(speeds[seen].max(initial=1e-12))  # the colours are for what is seen
    plotter = stage(view)
    surface = grid.extract_surface(nonlinear_subdivision=2, algorithm="dataset_surface")
    looks = {"cmap": COLOURS, "clim": (0.0, fastest), "lighting": False, "show_scalar_bar": False}
    plotter.add_mesh(surface, scalars="speed", **looks)
    plotter.add_mesh(_edges(pyvista, run), color=style.INK, line_width=1.5, lighting=False)
    plotter.view_xy()
    middle = (0.5 * (view[0] + view[1]), 0.5 * (view[2] + view[3]))
    plotter.camera.focal_point, plotter.camera.position = (*middle, 0.0), (*middle, 1.0)
    return framed(plotter, view, run.headline, "Cells, coloured by the speed", fastest)


def stage(view: style.View) -> Any:
    """A plotter off screen for a view that fills it, seen without perspective."""
    pixels = [PIXELS, max(int(PIXELS * (view[3] - view[2]) / (view[1] - view[0])), 2)]
    plotter = pyvista_off_screen().Plotter(off_screen=True, window_size=pixels)
    plotter.background_color = "white"
    plotter.camera.parallel_projection = True
    return plotter


def framed(
    plotter: Any, view: style.View, title: str, what: str, fastest: float, up: str = "y"
) -> Figure:
    """What a plotter shows of a view, with a title, axes and the colours of the speed, from zero; it is closed."""
    plotter.camera.parallel_scale = 0.5 * (view[3] - view[2])
    plotter.reset_camera_clipping_range()
    image = np.asarray(plotter.screenshot(return_img=True))
    plotter.close()
    figure, ((axes, bar),) = style.panels([view], title)
    axes.imshow(image, extent=view, interpolation="antialiased", zorder=0)
    axes.set(xlim=view[:2], ylim=view[2:], ylabel=f"{up} [scene units]", title=what)
    colours = figure.colorbar(ScalarMappable(Normalize(0.0, fastest), COLOURS), cax=bar)
    colours.set_label("speed [scene units]")
    return figure


def pyvista_off_screen() -> Any:
    """pyvista, set to render without a display where there is none, before VTK makes a window."""
    if not os.environ.get("DISPLAY"):
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    import pyvista

    return pyvista


def _edges(pyvista: Any, run: StoredRun) -> Any:
    """Every cell's outline as a polyline along the sides' parabolas."""
    corners, sides = run.mesh.cells[:, :3], run.mesh.cells[:, 3:]
    s = np.linspace(0.0, 1.0, 7)[:, None, None, None]
    start, middle, end = (
        run.mesh.points[part] for part in (corners, sides, np.roll(corners, -1, axis=1))
    )
    curves = (1 - s) * (1 - 2 * s) * start + 4 * s * (1 - s) * middle + s * (2 * s - 1) * end
    lines = curves.transpose(1, 2, 0, 3).reshape(-1, len(s), 2)
    connectivity = np.arange(lines.shape[0] * len(s)).reshape(-1, len(s))
    heads = np.full((len(connectivity), 1), len(s))
    return pyvista.PolyData(
        spatial(lines.reshape(-1, 2)), lines=np.hstack([heads, connectivity]).ravel()
    )


def _view(run: StoredRun) -> style.View:
    """The surroundings of the grain, or the whole domain without one."""
    x0, x1, y0, y1 = run.box
    if run.surface is None:
        return run.box
    size, centre = run.value("grain", "size", 1.0), run.space("grain", "centre")[:2]
    x0, x1 = max(x0, centre[0] - 2 * size), min(x1, centre[0] + 2 * size)
    return x0, x1, max(y0, centre[1] - size), min(y1, centre[1] + size)

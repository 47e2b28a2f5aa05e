"""The mesh, seen through VTK: the cells on the speed they carry, as ParaView would show them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import spatial
from . import style
from .record import Run

PIXELS = (1600, 800)


def picture(run: Run, path: Path) -> None:
    """Render the cells over the speed off screen with pyvista and write a PNG. Not collective."""
    pyvista = pyvista_off_screen()
    grid = pyvista.UnstructuredGrid(
        {pyvista.CellType.QUADRATIC_TRIANGLE: run.mesh.cells}, spatial(run.mesh.points)
    )
    grid["speed"] = np.linalg.norm(run.field("velocity"), axis=1)
    plotter = pyvista.Plotter(off_screen=True, window_size=list(PIXELS))
    plotter.background_color = "white"
    view = _view(run)
    # Without the empty line the title would touch the numbers.
    bar = {"title": "speed [scene units]\n", "color": style.INK, "vertical": False, "fmt": "%.2g"}
    bar |= {"position_x": 0.3, "width": 0.4, "position_y": 0.01, "height": 0.1, "label_font_size": 20}
    plotter.add_mesh(
        grid.extract_surface(nonlinear_subdivision=2, algorithm="dataset_surface"),
        scalars="speed",
        cmap="YlGnBu",
        clim=(0.0, _fastest(run, view)),
        lighting=False,
        scalar_bar_args={**bar, "title_font_size": 22},
    )
    plotter.add_mesh(_edges(pyvista, run), color=style.INK, line_width=1.5, lighting=False)
    plotter.view_xy()
    _look_at(plotter, view)
    plotter.screenshot(path)
    plotter.close()


def pyvista_off_screen() -> Any:
    """pyvista, told to render without a display where there is none; set before VTK makes a window."""
    if not os.environ.get("DISPLAY"):
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    import pyvista

    return pyvista


def _edges(pyvista: Any, run: Run) -> Any:
    """Every cell's outline as a polyline along the sides' parabolas."""
    corners, sides = run.mesh.cells[:, :3], run.mesh.cells[:, 3:]
    s = np.linspace(0.0, 1.0, 7)[:, None, None, None]
    start, middle, end = (run.mesh.points[part] for part in (corners, sides, np.roll(corners, -1, axis=1)))
    curves = (1 - s) * (1 - 2 * s) * start + 4 * s * (1 - s) * middle + s * (2 * s - 1) * end
    lines = curves.transpose(1, 2, 0, 3).reshape(-1, len(s), 2)
    connectivity = np.arange(lines.shape[0] * len(s)).reshape(-1, len(s))
    heads = np.full((len(connectivity), 1), len(s))
    return pyvista.PolyData(spatial(lines.reshape(-1, 2)), lines=np.hstack([heads, connectivity]).ravel())


def _view(run: Run) -> style.View:
    """The surroundings of the grain, or the whole domain without one."""
    x0, x1, y0, y1 = run.box
    if run.surface is None:
        return run.box
    size, centre = run.value("grain", "size", 1.0), run.vector("grain", "centre")
    x0, x1 = max(x0, centre[0] - 2 * size), min(x1, centre[0] + 2 * size)
    return x0, x1, max(y0, centre[1] - size), min(y1, centre[1] + size)


def _fastest(run: Run, view: style.View) -> float:
    """The largest speed in view: the colours are for what is seen."""
    x, y = run.mesh.points.T
    seen = (x >= view[0]) & (x <= view[1]) & (y >= view[2]) & (y <= view[3])
    return float(np.linalg.norm(run.field("velocity"), axis=1)[seen].max(initial=1e-12))


def _look_at(plotter: Any, view: style.View) -> None:
    """The view, with room for the colour bar below it."""
    x0, x1, y0, y1 = view
    height = 1.2 * max(y1 - y0, (x1 - x0) * PIXELS[1] / PIXELS[0])
    middle = ((x0 + x1) / 2, (y0 + y1) / 2 - 0.07 * height)
    plotter.camera.parallel_projection = True
    plotter.camera.focal_point = (*middle, 0.0)
    plotter.camera.position = (*middle, 1.0)
    plotter.camera.parallel_scale = height / 2

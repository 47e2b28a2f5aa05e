"""The cells of the mesh in the colour of the speed; of a 3-D run those that the vertical plane of the grain cuts."""

from __future__ import annotations

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from .flow import from_zero
from .plane import BESIDE, level_of, pyvista_off_screen
from .record import StoredRun
from .style import INK, panels

_COLOURS = "YlGnBu"
_TETRAHEDRON = 10  # VTK's number of the straight one


def picture(run: StoredRun) -> Figure:
    """Cells around the grain, or all without one, in the colour of their mean speed."""
    view = run.views[-1]
    polygons, speeds = (_cut if run.in_space else _curved)(run)
    seen = [np.ptp(np.clip(p, view[::2], view[1::2]), axis=0).all() for p in polygons]
    norm = from_zero(speeds[np.array(seen)])
    figure, (axes,) = panels([view], run.headline, "z" if run.in_space else "y")
    shown = PolyCollection(polygons, array=speeds, norm=norm, cmap=_COLOURS)
    shown.set(edgecolor=INK, linewidth=0.35, rasterized=True)
    axes.add_collection(shown, autolim=False)
    where = f" that the plane y = {level_of(run):.4g} cuts" if run.in_space else ""
    axes.set_title(f"Cells{where}, in the colour of their mean speed")
    figure.colorbar(ScalarMappable(norm, _COLOURS), ax=axes).set_label("speed [scene units]")
    return figure


def _curved(run: StoredRun) -> tuple[list[np.ndarray], np.ndarray]:
    """Outlines (n, 2) of the cells of a plane mesh along the parabolas of their sides, and mean speeds."""
    s = np.arange(6)[:, None, None, None] / 6
    corners, sides = run.mesh.cells[:, :3], run.mesh.cells[:, 3:]
    start, middle, end = (
        run.mesh.points[part] for part in (corners, sides, np.roll(corners, -1, axis=1))
    )
    along = (1 - s) * (1 - 2 * s) * start + 4 * s * (1 - s) * middle + s * (2 * s - 1) * end
    polygons = along.transpose(1, 2, 0, 3).reshape(len(corners), -1, 2)
    speeds = np.linalg.norm(run.field("velocity"), axis=1)[run.mesh.cells].mean(axis=1)
    return list(polygons), speeds


def _cut(run: StoredRun) -> tuple[list[np.ndarray], np.ndarray]:
    """Polygons (n, 2) in which a vertical plane cuts tetrahedra, their sides taken as straight, and mean speeds."""
    pyvista = pyvista_off_screen()
    grid = pyvista.UnstructuredGrid({_TETRAHEDRON: run.fields.cells[:, :4]}, run.fields.points)
    grid["speed"] = np.linalg.norm(run.field("velocity"), axis=1)
    cut = grid.slice(normal="y", origin=(0.0, level_of(run, BESIDE), 0.0), generate_triangles=False)
    faces = cut.irregular_faces
    places = cut.points[:, [0, 2]]
    return [places[face] for face in faces], np.array([cut["speed"][f].mean() for f in faces])

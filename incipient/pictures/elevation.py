"""The free surface of a 3-D run as seen from above, with the bed below it."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial import KDTree

from ..geometry.space.beds import Terrain
from ..scene import Domain
from .plane import TETRAHEDRON, pyvista_off_screen
from .record import StoredRun
from .style import INK, panels

_UPWARD = 0.1  # least rise of a normal that points up
_LEVELS = 24  # colours
_LINES, _PLACES = (
    7,
    201,
)  # lines of equal height of the bed; places in each direction at which that is known


def picture(run: StoredRun) -> Figure:
    """Elevation above the still level in colour as seen from above, the bed's height in lines."""
    points, triangles = run.whole(*surface_of(run))
    scene = run.model
    domain = scene.domain
    elevation = points[:, 2] - domain.ceiling
    view = (domain.left, domain.right, *domain.across)
    figure, (axes,) = panels([view], run.headline)
    largest = max(float(np.abs(elevation).max()), 1e-300)
    levels = np.linspace(-largest, largest, _LEVELS + 1)
    drawn = axes.tricontourf(
        points[:, 0], points[:, 1], triangles, elevation, levels=levels, cmap="RdBu_r"
    )
    forms = _show_bed(domain, scene.bed_shape, axes)
    axes.set_title("The free surface from above" + ("; lines: heights of the bed" if forms else ""))
    figure.colorbar(drawn, ax=axes).set_label("elevation [scene units]")
    return figure


def surface_of(run: StoredRun) -> tuple[np.ndarray, np.ndarray]:
    """The nodes (n, 3) of the free surface and straight triangles (m, 3) between them.

    They are the sides of the mesh whose outward normals point up, less those of the grain.
    """
    grid = pyvista_off_screen().UnstructuredGrid({TETRAHEDRON: run.fields.cells}, run.fields.points)
    sides = grid.extract_surface(nonlinear_subdivision=1, algorithm="dataset_surface").triangulate()
    sides = sides.compute_normals(point_normals=False, auto_orient_normals=True)
    triangles, chosen = sides.regular_faces, sides["Normals"][:, 2] > _UPWARD
    if run.surface is not None:
        reach = 1e-6 * float(np.ptp(run.surface.points, axis=0).max())
        away = KDTree(run.surface.points).query(sides.points)[0]
        chosen &= away[triangles].max(axis=1) > reach
    used, places = np.unique(triangles[chosen], return_inverse=True)
    # Places in VTK are of single precision.
    nodes = KDTree(run.fields.points).query(sides.points[used])[1]
    return run.fields.points[nodes], places.reshape(-1, 3)


def _show_bed(domain: Domain, bed: Terrain | None, axes: Axes) -> bool:
    """Show lines of equal height of a bed that has forms; whether it has."""
    if bed is None or not np.isfinite(bed.feature):
        return False
    x, y = (np.linspace(*sides, _PLACES) for sides in ((domain.left, domain.right), domain.across))
    places = np.stack(np.meshgrid(x, y), axis=-1)
    heights = bed.height(places.reshape(-1, 2)).reshape(_PLACES, _PLACES)
    between = np.linspace(heights.min(), heights.max(), _LINES + 2)[1:-1]
    axes.contour(x, y, heights, levels=between, colors=INK, linewidths=0.5)
    return True

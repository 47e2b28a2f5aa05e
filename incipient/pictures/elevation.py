"""The free surface of a 3-D run as seen from above, with the bed below it."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial import KDTree

from ..geometry.space.beds import Terrain
from ..scene import Domain
from .mesh import QUARTERS
from .record import StoredRun
from .style import INK, panels

_FACES = np.array([(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)])  # corners of a tetrahedron's faces
_MIDDLES = np.array(
    [(4, 5, 6), (4, 8, 7), (6, 9, 7), (5, 9, 8)]
)  # nodes on the sides of these, in order
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

    They are the faces of one cell alone whose outward normals point up, less those of the grain.
    """
    cells, points = run.fields.cells, run.fields.points
    corners = cells[:, _FACES].reshape(-1, 3)
    _, first, count = np.unique(
        np.sort(corners, axis=1), axis=0, return_index=True, return_counts=True
    )
    outside = first[count == 1]
    a, b, c = points[corners[outside]].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    inner = points[cells[outside // 4, 3 - outside % 4]]
    normal *= -np.sign(np.sum(normal * (inner - a), axis=1))[:, None]
    up = normal[:, 2] > _UPWARD * np.linalg.norm(normal, axis=1)
    if run.surface is not None:
        reach = 1e-6 * float(np.ptp(run.surface.points, axis=0).max())
        away = KDTree(run.surface.points).query(points)[0][corners[outside]]
        up &= away.max(axis=1) > reach
    chosen = outside[up]
    nodes = np.column_stack([corners[chosen], cells[chosen[:, None] // 4, _MIDDLES[chosen % 4]]])
    used, places = np.unique(nodes, return_inverse=True)
    return points[used], places.reshape(-1, 6)[:, QUARTERS].reshape(-1, 3)


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

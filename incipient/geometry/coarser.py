"""Coarser copies of outlines, of surfaces of triangles and of heights on a raster: scans of less resolution."""

from dataclasses import dataclass

import numpy as np

from incipient.arrays import Floats, planar_cross, unit
from incipient.geometry.space.heightmap import HeightMap
from incipient.geometry.space.remeshing import Draft, ExactSurface, remeshed
from incipient.geometry.space.surfaces import Surface, Triangles

SHARP = np.radians(35.0)  # turn of an outline at a corner that is its shape, not its resolution
EVERY = ((2, 0), (2, 1), (3, 0))  # of how many points one is kept, and the first one, copy by copy
AROUND = 8  # points whose edges are averaged for the length of edges at a place


def coarser_outline(points: Floats, copy: int, closed: bool) -> Floats:
    """Every second or third of points (n, 2) of an outline, sharp corners and ends kept; `copy` is 0, 1 or 2."""
    every, first = EVERY[copy % len(EVERY)]
    kept = np.arange(len(points)) % every == first
    before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
    along, onwards = unit(before), unit(after)
    kept |= np.abs(np.arctan2(planar_cross(along, onwards), (along * onwards).sum(axis=1))) > SHARP
    if not closed:
        kept[[0, -1]] = True
    return points[kept]


@dataclass(frozen=True, eq=False)
class _Scan(ExactSurface):
    """A closed surface of triangles in a unit in which its extent is one; sharp edges stay."""

    surface: Surface
    faces: Triangles

    def draft(self) -> Draft:
        """The triangles themselves."""
        return Draft(
            self.surface, np.zeros(self.surface.points.shape, dtype=bool), sharp=True, faceted=False
        )

    def project(self, x: Floats, held: np.ndarray) -> Floats:
        """The nearest points of the triangles."""
        return self.faces.nearest(x, 0.0)[0]


def coarser_surface(surface: Surface, factor: float) -> Surface:
    """A closed surface with edges about `factor` times as long everywhere, its corners on the given one.

    Edges at which facets meet at more than 35 degrees stay. Raises MeshError if the triangles do not settle.
    """
    from scipy.spatial import cKDTree

    low, extent = surface.points.min(axis=0), float(np.ptp(surface.points, axis=0).max())
    unit_one = Surface((surface.points - low) / extent, surface.triangles)
    middles, lengths = _edges(unit_one)
    tree = cKDTree(middles)

    def size(x: Floats) -> Floats:
        """The wanted length of edges at points (n, 3)."""
        near = tree.query(x, k=min(AROUND, len(middles)))[1]
        return np.asarray(factor * lengths[near].mean(axis=1))

    exact = _Scan(unit_one, Triangles(unit_one.corners))
    result = remeshed(exact, exact.draft(), size)
    return Surface(low + extent * result.points, result.triangles)


def coarser_heights(heights: Floats, copy: int) -> Floats:
    """Heights (rows, columns) as every second row and column of them tell, `copy` 0 to 3 from which on."""
    row, column = divmod(copy % 4, 2)
    coarse = HeightMap(heights[row::2, column::2], (2.0, 2.0), (float(column), float(row), 0.0))
    rows_, columns = heights.shape
    x, y = np.meshgrid(np.arange(columns, dtype=float), np.arange(rows_, dtype=float))
    return coarse.height(np.column_stack([x.ravel(), y.ravel()])).reshape(heights.shape)


def _edges(surface: Surface) -> tuple[Floats, Floats]:
    """Middles (k, 3) and lengths (k,) of the sides of all triangles."""
    corners = surface.corners
    following = np.roll(corners, -1, axis=1)
    middles = 0.5 * (corners + following)
    return middles.reshape(-1, 3), np.linalg.norm(following - corners, axis=2).ravel()

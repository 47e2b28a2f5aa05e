"""Sizes of cells far from grain and bed, and graded rows."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise, takewhile

import numpy as np

from ..arrays import Point
from ..geometry.plane.curves import Curve
from ..meshes import Near

# Length, over the depth, of the zone in which a free surface comes in level; a cell at the least.
LEVEL = 0.25
FAR_CELL = {2: 0.10, 3: 0.15, 4: 0.20}  # of the domain's height
FAR_CELL_IN_SPACE = {2: 0.25, 3: 0.45, 4: 0.5}  # likewise


# Names of the lines that close the space below a grain, upstream and downstream of its contacts.
CLOSED = ("closed upstream", "closed downstream")
GRID_CELLS = {2: 48, 3: 32, 4: 24}  # along the shorter side of an empty box
GRID_CELLS_IN_SPACE = {2: 16, 3: 9, 4: 6}  # likewise (docs/contribute/defaults.md)
FEWEST = {2: 4, 3: 2}  # along a side of such a grid, by dimension, whatever the cells' size

# Behind a corner that sticks out: how far its shear layer reaches, and the cells in it, over the height by which the
# bed falls; their growth away from it; points along it; sine of the turn from which on a corner is one.
LEE, LEE_CELL, LEE_GROWTH, LEE_POINTS, OUTWARD = 6.0, 0.09, 0.15, 25, -0.17


@dataclass(frozen=True)
class FarCells:
    """The cells far from grain and bed, for mesh_size = 1."""

    extents: tuple[float, ...]  # of the domain
    order: int  # of the velocity
    # Reynolds number in an empty box, which has a grid; None in other scenes
    box_reynolds: float | None = None

    @property
    def largest(self) -> float:
        """Their size [length]; without a grid the 2-D size."""
        if self.box_reynolds is None:
            return FAR_CELL[self.order] * self.extents[-1]
        # Boundary layers thin as Re^-1/2; the grading provides half of that.
        refined = max(1.0, (self.box_reynolds / 1000.0) ** 0.25)
        cells = GRID_CELLS if len(self.extents) == 2 else GRID_CELLS_IN_SPACE
        return min(self.extents) / (cells[self.order] * refined)

    def largest_in_space(self, order: int) -> float:
        if self.box_reynolds is not None:
            return self.largest
        return min(FAR_CELL_IN_SPACE[order] * self.extents[-1], 0.5 * min(self.extents))

    @property
    def coarsest_grid(self) -> float:
        """Largest numerics.mesh_size at which an empty box's cells still grow; inf: other scenes."""
        if self.box_reynolds is None:
            return math.inf
        return min(self.extents) / (FEWEST[len(self.extents)] * self.largest)


def layer_ends(layers: int, grading: float, half: bool) -> tuple[float, ...]:
    """Ends of layers across the width, as fractions of it: layers grow evenly from the sides.

    grading: thickness next to sides over that in the middle; 1: uniform
    half:    the first layer lies at the plane of symmetry
    """
    middles = (np.arange(layers) + 0.5) / layers
    away = 1.0 - middles if half else 2.0 * np.minimum(middles, 1.0 - middles)
    ends = np.cumsum(grading + (1.0 - grading) * away)
    return (*map(float, ends[:-1] / ends[-1]), 1.0)


def corners(curves: Iterable[Curve], following: Iterable[Curve]) -> tuple[Point, ...]:
    """Corners of more than ten degrees between successive curves."""
    cosine = np.cos(np.radians(10.0))
    return tuple(
        after.start
        for before, after in zip(curves, following, strict=False)
        if before.tangent([1.0])[0] @ after.tangent([0.0])[0] < cosine
    )


def separating(bed: tuple[Curve, ...]) -> Iterator[tuple[Point, float]]:
    """Corners that protrude into the flow, which separates there, and the drop of the bed behind each."""
    for before, after in pairwise(range(len(bed))):
        ahead, behind = bed[before].tangent([1.0])[0], bed[after].tangent([0.0])[0]
        if ahead[0] * behind[1] - ahead[1] * behind[0] < OUTWARD:
            falling = takewhile(lambda curve: curve.end[1] <= curve.start[1], bed[after:])
            lowest = min([curve.end[1] for curve in falling], default=bed[after].start[1])
            yield bed[after].start, bed[after].start[1] - lowest


def lee(corner: Point, drop: float) -> Near:
    """Cells in the shear layer that leaves a corner."""
    shares = np.linspace(0.0, 1.0, LEE_POINTS).tolist()
    points = tuple((corner[0] + LEE * drop * s, corner[1] - drop * s) for s in shares)
    return Near(LEE_CELL * drop, LEE_GROWTH, points=points)

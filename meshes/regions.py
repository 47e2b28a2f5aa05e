"""The shapes that are meshed: regions above a bed with grains as holes, and graded grids."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from incipient.arrays import Floats, Point
from incipient.geometry.placement import Placement
from incipient.geometry.plane.curves import Curve
from incipient.geometry.space.beds import Terrain
from incipient.geometry.space.grains import Solid
from incipient.geometry.space.remeshing import GRID as GRID_IN_SPACE

GRID = 2.0**-40  # of a plane region's height
SYMMETRY = "symmetry"  # the name of the plane in which a symmetric region is cut


@dataclass(frozen=True, eq=False)
class Frame:
    """Coordinates in which a region is drawn: from its lower corner, in units of its height.

    Rounded to multiples of `grid`, so that a scene in other units is drawn with the same numbers.
    """

    origin: Floats
    length: float
    grid: float = GRID

    def local(self, x: Floats) -> Floats:
        """Points (..., gdim) of the scene in this frame, rounded."""
        return np.asarray(np.round((x - self.origin) / self.length / self.grid) * self.grid)

    def scene(self, x: Floats) -> Floats:
        return np.asarray(x * self.length + self.origin)

    def size(self, length: float) -> float:
        """A length in this frame, to twelve digits."""
        return float(f"{length / self.length:.12g}")


@dataclass(frozen=True)
class Region:
    """The plane region above `bottom` and below `top`, less its holes."""

    bottom: tuple[Curve, ...]  # curves from left to right; their ends are the lower corners
    top: float  # vertical coordinate of the straight upper side
    # Closed outlines, counter-clockwise, by name
    holes: dict[str, tuple[Curve, ...]] = field(default_factory=dict)
    # Names of the bottom, right, top and left boundary
    sides: tuple[str, str, str, str] = ("bed", "outflow", "top", "inflow")
    # Curves by name, of what stands on the bottom and bounds the region where the bottom has a gap
    standing: dict[str, tuple[Curve, ...]] = field(default_factory=dict)

    @property
    def inner(self) -> dict[str, tuple[Curve, ...]]:
        return self.holes | self.standing

    @property
    def frame(self) -> Frame:
        low = min(curve.start[1] for curve in self.bottom)
        return Frame(np.array([self.bottom[0].start[0], low]), self.top - low)


@dataclass(frozen=True, eq=False)
class PlacedSolid:
    """A grain at its position."""

    solid: Solid
    placement: Placement


@dataclass(frozen=True)
class Resolved:
    """Bedforms are meshed within a horizontal `radius` of `centre`; over `passage` they blend into a `level`.

    A plane keeps its slope in any case.
    """

    centre: Point
    radius: float
    passage: float
    level: float

    def share(self, x: Floats) -> Floats:
        """Weight (n,) of the level at points (n, 2): 0 within, 1 beyond, smooth between."""
        away = np.linalg.norm(x - np.asarray(self.centre), axis=1)
        t = np.clip((away - self.radius) / self.passage, 0.0, 1.0)
        return np.asarray(t * t * t * (10.0 - 15.0 * t + 6.0 * t * t))


@dataclass(frozen=True, eq=False)
class SolidRegion:
    """The box over `x` and `y`, above a bed and below `ceiling`, less its holes."""

    x: tuple[float, float]
    y: tuple[float, float]
    ceiling: float
    bed: Terrain
    holes: dict[str, PlacedSolid] = field(default_factory=dict)  # closed surfaces by name
    # Names of the boundary at x[0], x[1], y[0], y[1], at the ceiling and at the bed; names may occur twice
    sides: tuple[str, ...] = ("inflow", "outflow", "right", "left", "top", "bed")
    # Only the half above the middle of `y` is meshed; the cut is called "symmetry" and sides[2] does not occur. Grains
    # and bed are taken to be mirror images of themselves in that plane.
    symmetric: bool = False
    resolved: Resolved | None = None  # where the bed is meshed as it is; None: everywhere

    @property
    def rectangle(self) -> tuple[Floats, Floats]:
        low = 0.5 * (self.y[0] + self.y[1]) if self.symmetric else self.y[0]
        return np.array([self.x[0], low]), np.array([self.x[1], self.y[1]])

    @property
    def names(self) -> tuple[str, ...]:
        right = SYMMETRY if self.symmetric else self.sides[2]
        return (*self.sides[:2], right, *self.sides[3:])

    @property
    def frame(self) -> Frame:
        low, high = self.rectangle
        corners = np.array([[a, b] for a in (low[0], high[0]) for b in (low[1], high[1])])
        bottom = float(self.bed.height(corners).min())
        return Frame(np.array([*low, bottom]), self.ceiling - bottom, GRID_IN_SPACE)


@dataclass(frozen=True)
class Grid:
    """A rectangle or box in graded cells, each cut into two triangles or six tetrahedra."""

    extents: tuple[Point, ...]  # the least and the largest coordinate along each axis
    # Where the cells along each axis end, as ascending fractions of the extent, the last of them one
    ends: tuple[tuple[float, ...], ...]
    # Names of the boundaries at the least and the largest coordinate along each axis; names may occur twice
    sides: tuple[str, ...]
    half: bool = False  # in 3-D, the least y is a plane of symmetry, in the middle of the whole box
    parallel: bool = (
        False  # in 3-D, all diagonals have one direction, instead of leading inwards from corners
    )

    @property
    def cells(self) -> int:
        return int(np.prod([len(ends) for ends in self.ends])) * {2: 2, 3: 6}[len(self.ends)]


def graded_ends(count: int, grading: float) -> tuple[float, ...]:
    """Ends of `count` cells, finer at both ends, as ascending fractions of a length.

    The spacing at s is proportional to 1 - (1 - grading) (2 s - 1)^2.
    """
    t = np.arange(1, count) / count
    if grading < 1.0:
        root = np.sqrt(1.0 - grading)
        t = 0.5 * (1.0 + np.tanh(np.arctanh(root) * (2.0 * t - 1.0)) / root)
    return (*t.tolist(), 1.0)

"""What is meshed: regions above a bed with grains as holes, graded grids, and sizes of their cells."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from incipient.arrays import Floats, Integers, Point
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


Place = Point | tuple[float, float, float]  # in 2-D, in 3-D
LAYERS_SHARE = (
    0.35  # of the edges at a wall in 3-D: what all layers there take at most of the cells beyond
)


@dataclass(frozen=True)
class Away:
    """Growth of cells along a feature with the distance from a point, up to a largest size; scene units.

    Beyond the distance `level` the feature is planar, and cells grow further.
    """

    point: Place
    growth: float
    largest: float
    level: float = float("inf")


@dataclass(frozen=True)
class Near:
    """Cells of a size (scene units) at points or a named boundary, growing with the distance from them."""

    size: float
    growth: float
    points: tuple[Place, ...] = ()
    boundary: str = ""
    # Without cells of this size the geometry is not resolved; they are not coarsened
    needed: bool = False
    away: Away | None = None  # where along a boundary the cells may be larger; None: nowhere
    # The largest cells that follow the boundary's shape: by no factor do they become larger
    most: float = float("inf")

    def scaled(self, factor: float) -> Near:
        """The size times a factor, except the largest one away, which the boundary's shape limits."""
        less, size = min(factor, 1.0), min(self.size * factor, max(self.most, self.size))
        away = self.away and replace(
            self.away, growth=less * self.away.growth, largest=less * self.away.largest
        )
        return replace(self, size=size, growth=less * self.growth, away=away)


@dataclass(frozen=True, eq=False)
class SizeField:
    """Target sizes (n,) at vertices `points` (n, gdim) of earlier `triangles` (m, 3), linear on these."""

    points: Floats
    triangles: Integers
    sizes: Floats


@dataclass(frozen=True)
class WallLayers:
    """Thickness of the first layer at each named wall, number of layers, and their growth."""

    first: dict[str, float]
    number: int  # at most
    growth: float
    graded: bool = False  # thinner layers grow less: by a factor all of them become thinner
    most: float = float("inf")  # largest factor by which first layers become thicker

    def scaled(self, factor: float) -> WallLayers:
        growth = self.growth**factor if self.graded else self.growth
        thicker = min(factor, max(self.most, 1.0))
        first = {name: thicker * size for name, size in self.first.items()}
        return replace(self, first=first, growth=growth, most=self.most / thicker)


@dataclass(frozen=True)
class Sizes:
    """The size of cells: `far` at most, less near features, and where a field says so; scene units."""

    far: float
    near: tuple[Near, ...] = ()
    field: SizeField | None = None
    # In 3-D, cells are at most this fraction of the width between the bed and a grain, or two grains
    gap_part: float = float("inf")
    layers: WallLayers | None = None  # along walls; None: there are none

    def scaled(self, factor: float) -> Sizes:
        near = tuple(n.scaled(factor) for n in self.near)
        return replace(
            self,
            far=self.far * factor,
            near=near,
            gap_part=self.gap_part * factor,
            layers=self.layers and self.layers.scaled(factor),
        )

    def coarsened(self, factor: float, growth: float) -> Sizes:
        """Sizes that are not needed times a factor above one, growing with distance at least as given."""
        near = tuple(
            replace(n if n.needed else n.scaled(factor), growth=max(n.growth, growth))
            for n in self.near
        )
        return replace(self.scaled(factor), near=near, gap_part=self.gap_part)

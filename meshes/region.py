"""What is meshed: a region between a bed and a rectangle's sides, with holes, and how fine it is where."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from incipient.arrays import Floats, Integers, Point
from incipient.geometry.plane.curves import Curve

GRID = 2.0**-40  # of a region's height
PART = 0.35  # of the edges at a place of a wall in space: what all layers there take at most of the cells beyond

Place = Point | tuple[float, float, float]  # in the plane, in space


@dataclass(frozen=True)
class Frame:
    """Coordinates in which a region is drawn: from its lower left corner, in units of its height.

    The tolerances of a mesh generator are lengths: only so do they mean the same in every unit and at every place.
    Coordinates are rounded to GRID, so that a scene in other units is drawn as the very same numbers.
    """

    origin: Point
    length: float

    @classmethod
    def of(cls, region: Region) -> Frame:
        """The frame of a region."""
        low = min(curve.start[1] for curve in region.bottom)
        return cls((region.bottom[0].start[0], low), region.top - low)

    def local(self, x: float, y: float) -> Point:
        """A point of the region in this frame."""
        places = (x - self.origin[0]) / self.length, (y - self.origin[1]) / self.length
        return round(places[0] / GRID) * GRID, round(places[1] / GRID) * GRID

    def size(self, length: float) -> float:
        """A length in this frame, in twelve digits."""
        return float(f"{length / self.length:.12g}")


@dataclass(frozen=True)
class Region:
    """The plane region above `bottom` and below `height_top`, less its holes."""

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
        """The boundaries that are no sides: holes and what stands on the bottom."""
        return self.holes | self.standing


@dataclass(frozen=True)
class Away:
    """How cells along a feature may grow with the distance from a point, up to a largest size; scene units.

    From the distance `level` on the feature has no forms that this size follows: cells grow on.
    """

    point: Place
    growth: float
    largest: float
    level: float = float("inf")


@dataclass(frozen=True)
class Near:
    """Cells of a size (scene units) at points or at a named boundary, growing with the distance from them."""

    size: float
    growth: float
    points: tuple[Place, ...] = ()
    boundary: str = ""
    needed: bool = (
        False  # without cells of this size the geometry is not resolved; they are not coarsened
    )
    away: Away | None = None  # where along a boundary the cells may be larger; None: nowhere
    # The largest cells that follow the boundary's shape: by no factor do they become larger
    most: float = float("inf")

    def scaled(self, factor: float) -> Near:
        """The size times a factor; the largest one away, which the boundary's shape bears, does not grow.

        Finer cells grow more slowly with the distance, so that all become smaller by the factor.
        """
        less = min(factor, 1.0)
        away = self.away and replace(
            self.away, growth=less * self.away.growth, largest=less * self.away.largest
        )
        return replace(self, size=self._times(factor), growth=less * self.growth, away=away)

    def coarsened(self, factor: float, growth: float) -> Near:
        """The size times a factor unless it is needed, growing with distance at least as given."""
        size = self.size if self.needed else self._times(factor)
        return replace(self, size=size, growth=max(self.growth, growth))

    def _times(self, factor: float) -> float:
        return min(self.size * factor, max(self.most, self.size))


@dataclass(frozen=True, eq=False)
class SizeField:
    """Sizes of cells wanted at the vertices of an earlier mesh, linear on its triangles, scene units.

    points (n, 2), triangles (m, 3) of them, sizes (n,)
    """

    points: Floats
    triangles: Integers
    sizes: Floats


@dataclass(frozen=True)
class WallLayers:
    """How thick cells at walls are: that of the first layer at each named wall, how many layers, and their growth."""

    first: dict[str, float]
    number: int  # at most
    growth: float
    graded: bool = False  # thinner layers grow less: by a factor all of them become thinner

    def scaled(self, factor: float) -> WallLayers:
        """First layers thicker by a factor."""
        growth = self.growth**factor if self.graded else self.growth
        return replace(
            self, first={name: factor * size for name, size in self.first.items()}, growth=growth
        )


@dataclass(frozen=True)
class Sizes:
    """The size of cells: `far` at most, less near features, and where a field says so; scene units."""

    far: float
    near: tuple[Near, ...] = ()
    field: SizeField | None = None
    # In space, cells are at most this part of the width between the bed and a grain, or two grains
    gap_part: float = float("inf")
    layers: WallLayers | None = None  # along walls; None: there are none

    def scaled(self, factor: float) -> Sizes:
        """All sizes but a field's times a factor: one number refines everything alike."""
        near = tuple(n.scaled(factor) for n in self.near)
        layers = self.layers and self.layers.scaled(factor)
        return replace(
            self, far=self.far * factor, near=near, gap_part=self.gap_part * factor, layers=layers
        )

    def coarsened(self, factor: float, growth: float) -> Sizes:
        """Sizes times a factor but where they are needed, all growing with distance at least as given."""
        near = tuple(n.coarsened(factor, growth) for n in self.near)
        return replace(
            self,
            far=self.far * factor,
            near=near,
            layers=self.layers and self.layers.scaled(factor),
        )


@dataclass(frozen=True)
class Grid:
    """A rectangle cut into graded columns and rows, each cell into two triangles.

    grading is the ratio of the smallest to the largest spacing on each side; both ends are fine. `ends`, where they are
    given, are where the rows end, as ascending parts of the height, the last of them one; `column_ends` are likewise
    where the columns end. The lower side of the first columns may have a name of its own: `ahead` is that and their
    number.
    """

    origin: Point
    length: float
    height: float
    columns: int
    rows: int
    grading: float = 0.05
    sides: tuple[str, str, str, str] = ("bottom", "right", "top", "left")
    ends: tuple[float, ...] = ()
    column_ends: tuple[float, ...] = ()
    ahead: tuple[str, int] = ("", 0)


@dataclass(frozen=True)
class SolidGrid:
    """A grid of the plane of x and z extruded along y: each triangle of each layer into three tetrahedra."""

    grid: Grid
    across: tuple[float, float]  # the least and the largest y
    # Where each layer ends, as ascending parts of the way across, the last of them one
    ends: tuple[float, ...]
    sides: tuple[str, str] = (
        "right",
        "left",
    )  # names of the boundaries at the least and the largest y

    @property
    def layers(self) -> int:
        """How many there are."""
        return len(self.ends)


@dataclass(frozen=True)
class BoxGrid:
    """A box in space cut into graded cells, each into six tetrahedra."""

    extents: tuple[Point, Point, Point]  # the least and the largest x, y and z
    # Where the cells along each of the three axes end, as ascending parts of the extent, the last of them one
    ends: tuple[tuple[float, ...], ...]
    # Names of the boundaries at the least and the largest x, y and z; names may occur twice
    sides: tuple[str, str, str, str, str, str]
    half: bool = False  # the least y is a plane of symmetry, in the middle of the whole box

    @property
    def cells(self) -> int:
        """How many tetrahedra there are."""
        return 6 * len(self.ends[0]) * len(self.ends[1]) * len(self.ends[2])

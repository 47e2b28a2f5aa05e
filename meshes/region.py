"""What is meshed: a region between a bed and a rectangle's sides, with holes, and how fine it is where."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from incipient.geometry.curves import Curve, Point


@dataclass(frozen=True)
class Region:
    """The plane region above `bottom` and below `height_top`, less its holes.

    bottom:   curves from left to right; their ends are the lower corners
    top:      vertical coordinate of the straight upper side
    holes:    closed outlines, counter-clockwise, by name
    sides:    names of the bottom, right, top and left boundary
    """

    bottom: tuple[Curve, ...]
    top: float
    holes: dict[str, tuple[Curve, ...]] = field(default_factory=dict)
    sides: tuple[str, str, str, str] = ("bed", "outflow", "top", "inflow")


@dataclass(frozen=True)
class Near:
    """Cells of a size (scene units) at points or at a named boundary, growing with the distance from them."""

    size: float
    growth: float
    points: tuple[Point, ...] = ()
    boundary: str = ""


@dataclass(frozen=True)
class Sizes:
    """The size of cells: `far` at most, less near features; scene units."""

    far: float
    near: tuple[Near, ...] = ()

    def scaled(self, factor: float) -> Sizes:
        """All sizes times a factor: one number refines everything alike."""
        near = tuple(Near(n.size * factor, n.growth, n.points, n.boundary) for n in self.near)
        return Sizes(self.far * factor, near)

    def at(self, distances: Iterable[float]) -> float:
        """The size where the distances to the features are as given, in their order."""
        sizes = (n.size + n.growth * d for n, d in zip(self.near, distances, strict=True))
        return min(self.far, *sizes)


@dataclass(frozen=True)
class Grid:
    """A rectangle cut into graded columns and rows, each cell into two triangles.

    grading is the ratio of the smallest to the largest spacing on each side; both ends are fine.
    """

    origin: Point
    length: float
    height: float
    columns: int
    rows: int
    grading: float = 0.05
    sides: tuple[str, str, str, str] = ("bottom", "right", "top", "left")

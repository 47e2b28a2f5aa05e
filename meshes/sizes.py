"""Sizes of cells: near features of a boundary, in layers along walls, and from an error estimate."""

from __future__ import annotations

from dataclasses import dataclass, replace

from incipient.arrays import Floats, Integers, Point

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

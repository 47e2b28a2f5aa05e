"""What is meshed in space: a box above a bed, with grains as holes, whole or cut by its plane of symmetry."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from incipient.arrays import Floats, Point
from incipient.geometry.placement import Placement
from incipient.geometry.space.beds import Terrain
from incipient.geometry.space.grains import Solid
from incipient.geometry.space.remeshing import GRID

SYMMETRY = "symmetry"  # the name of the plane in which a symmetric region is cut


@dataclass(frozen=True, eq=False)
class PlacedSolid:
    """A grain where it is: a closed surface in the scene."""

    solid: Solid
    placement: Placement


@dataclass(frozen=True)
class Resolved:
    """Where a bed is meshed as it is: within `radius` of `centre`, horizontally.

    Over the length `passage` it goes over smoothly to its mean level.
    """

    centre: Point
    radius: float
    passage: float
    # That level; None: the bed's mean height within radius + passage (a plane keeps its slope in any case)
    level: float | None = None

    def share(self, x: Floats) -> Floats:
        """The part (n,) of the mean level in the bed's shape at points (n, 2): 0 within, 1 beyond, smooth between."""
        away = np.linalg.norm(x - np.asarray(self.centre), axis=1)
        t = np.clip((away - self.radius) / self.passage, 0.0, 1.0)
        return np.asarray(t * t * t * (10.0 - 15.0 * t + 6.0 * t * t))


@dataclass(frozen=True, eq=False)
class SolidRegion:
    """The box over `x` and `y`, above a bed and below `ceiling`, less its holes; z points up."""

    x: tuple[float, float]
    y: tuple[float, float]
    ceiling: float
    bed: Terrain
    holes: dict[str, PlacedSolid] = field(default_factory=dict)  # closed surfaces by name
    # Names of the boundary at x[0], x[1], y[0], y[1], at the ceiling and at the bed; names may occur twice
    sides: tuple[str, str, str, str, str, str] = (
        "inflow",
        "outflow",
        "right",
        "left",
        "top",
        "bed",
    )
    # Only the half above the middle of `y` is meshed; the cut is called "symmetry" and sides[2] does not occur. Grains
    # and bed are taken to be mirror images of themselves in that plane.
    symmetric: bool = False
    resolved: Resolved | None = None  # where the bed is meshed as it is; None: everywhere
    # Radius with which the valleys between the balls and the base of a bed, and between the spheres of a clump, are
    # rounded: touching balls are bridged. The surface changes only where two pieces are nearer than this. 0: a fifth of
    # the smallest radius.
    fillet: float = 0.0

    @property
    def rectangle(self) -> tuple[Floats, Floats]:
        """The least and the largest x and y, (2,) each, of what is meshed."""
        low = 0.5 * (self.y[0] + self.y[1]) if self.symmetric else self.y[0]
        return np.array([self.x[0], low]), np.array([self.x[1], self.y[1]])

    @property
    def names(self) -> tuple[str, str, str, str, str, str]:
        """The names of the sides of what is meshed."""
        first, second, right, left, top, bed = self.sides
        return first, second, SYMMETRY if self.symmetric else right, left, top, bed


@dataclass(frozen=True, eq=False)
class SolidFrame:
    """Coordinates in which a region is drawn: from its lower corner, in units of its height (see `Frame`)."""

    origin: Floats
    length: float

    @classmethod
    def of(cls, region: SolidRegion) -> SolidFrame:
        """The frame of a region."""
        low, high = region.rectangle
        corners = np.array([[a, b] for a in (low[0], high[0]) for b in (low[1], high[1])])
        bottom = float(region.bed.height(corners).min())
        return cls(np.array([*low, bottom]), region.ceiling - bottom)

    def local(self, x: Floats) -> Floats:
        """Points (n, 3) of the scene in this frame, rounded so that they are the same numbers in every unit."""
        return np.asarray(np.round((x - self.origin) / self.length / GRID) * GRID)

    def scene(self, x: Floats) -> Floats:
        """Points (n, 3) of this frame in the scene."""
        return np.asarray(x * self.length + self.origin)

    def size(self, length: float) -> float:
        """A length in this frame, in twelve digits."""
        return float(f"{length / self.length:.12g}")

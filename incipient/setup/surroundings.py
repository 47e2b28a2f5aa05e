"""Clearance of a moving grain from the domain's sides and the bed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Floats
from ..geometry.placement import Placement
from ..geometry.plane.grains import Grain
from ..geometry.proximity import Proximity
from ..geometry.space.grains import Solid
from .geometry import Geometry, Place, SideNames, point

# On each curve of the outline, by which the distance of a side is known to 1e-7 of the grain's size
SAMPLES = 2000


@dataclass(frozen=True)
class Clearance:
    """Smallest distance of grain and surroundings, its position, and the side or bed."""

    distance: float
    on_grain: Place
    on_other: Place
    other: str


@dataclass(frozen=True)
class Side:
    """A straight side of the domain: at a `place` on an axis, with the fluid on the side `inwards` (1, -1)."""

    name: str
    axis: int
    place: float
    inwards: int


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The sides of a domain, and the bed, if any, instead of the lower one."""

    grain: Grain | Solid
    sides: tuple[Side, ...]
    near_bed: Proximity | None = None
    name_of_bed: str = "bed"

    def clearance(self, placement: Placement, within: float = np.inf) -> Clearance:
        """Smallest distance [length] of the placed grain from sides and bed; negative beyond them.

        The distance of the bed is computed only if it may be below `within`.
        """
        clearances = [self._from_side(placement, side) for side in self.sides]
        down = -np.eye(placement.gdim)[-1]
        lowest = float(self._extreme(placement, down)[-1])
        near = self.near_bed
        if near is not None and (within == np.inf or lowest - near.bed.crest < within):
            gap, on_grain, on_bed = near.clearance(placement)
            clearances.append(Clearance(gap, point(on_grain), point(on_bed), self.name_of_bed))
        return min(clearances, key=lambda one: one.distance)

    def _from_side(self, placement: Placement, side: Side) -> Clearance:
        towards = -side.inwards * np.eye(placement.gdim)[side.axis]
        on_grain = self._extreme(placement, towards)
        foot = on_grain.copy()
        foot[side.axis] = side.place
        return Clearance(
            float((foot - on_grain) @ towards), point(on_grain), point(foot), side.name
        )

    def _extreme(self, placement: Placement, direction: Floats) -> Floats:
        towards = direction @ placement.rotation
        if isinstance(self.grain, Grain):
            end = self._outline[np.argmax(self._outline @ towards)]
        else:
            end = self.grain.extreme(towards)
        return np.asarray(placement.to_scene([end])[0])

    @cached_property
    def _outline(self) -> Floats:
        assert isinstance(self.grain, Grain)
        return self.grain.chain.points(SAMPLES)


def surroundings_of(geometry: Geometry, names: SideNames, ceiling: float) -> Surroundings:
    """The boundaries that the grain may meet; a free surface replaces the top of the domain."""
    scene, domain, up = geometry.scene, geometry.scene.domain, geometry.scene.up
    sides = [Side(names.right, 0, domain.right, -1), Side(names.left, 0, domain.left, 1)]
    if not scene.has_surface:
        sides.insert(0, Side(names.top, up, ceiling, -1))
    # In half a scene the grain is equally far from the side beyond the plane of symmetry.
    ends = zip(domain.across[::-1], (-1, 1), strict=True) if scene.gdim == 3 else ()
    sides += [Side(name, 1, *end) for name, end in zip(names.across[::-1], ends, strict=False)]
    near_bed = None if scene.bed_shape is None else geometry.near_bed
    if near_bed is None:
        sides.append(Side(names.bottom, up, domain.bottom, 1))
    return Surroundings(scene.grain, tuple(sides), near_bed, names.bottom)

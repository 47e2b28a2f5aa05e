"""Clearance of a moving grain from the domain's sides and the bed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Floats
from ..geometry.closest import proximity
from ..geometry.placement import Placement
from ..geometry.plane.beds import Bed
from ..geometry.plane.grains import Grain
from ..geometry.proximity import Proximity
from ..geometry.space.beds import Terrain
from ..geometry.space.grains import Solid
from .scene_geometry import Geometry, Place, point
from .sides import SideNames

FREE_OF_INFLOW = 1.0  # grain sizes before a grain, below which the plan warns
# On each curve of the outline, by which the distance of a side is known to 1e-7 of the grain's size
SAMPLES = 2000


@dataclass(frozen=True)
class Clearance:
    """The smallest distance of grain and surroundings, where it is, and from which side or whether the bed."""

    distance: float
    on_grain: Place
    on_other: Place
    other: str


@dataclass(frozen=True)
class Side:
    """A straight side of the domain: at a `place` on an axis, with the fluid on the side `inwards` (1, -1) of it."""

    name: str
    axis: int
    place: float
    inwards: int


def near_inflow(geometry: Geometry, still: bool) -> str:
    """A warning for a grain near the inflow, where the velocity is prescribed, or an empty string.

    still: whether the fluid is at rest but for the grain. Not collective.
    """
    placement, domain = geometry.placement, geometry.domain
    if placement is None or domain.kind == "box" or still:
        return ""
    size = geometry.grain.size
    away = (placement.centre[0] - domain.left) / size - 0.5
    if away >= FREE_OF_INFLOW:
        return ""
    return (
        f"the grain is {max(away, 0.0):.2g} of its size from the inflow, where the velocity is prescribed: that "
        f"changes its load; leave {FREE_OF_INFLOW:g} of its size at the least, by body.x or domain.origin"
    )


def surroundings_of(
    geometry: Geometry, names: SideNames, ceiling: float, surface_above: bool
) -> Surroundings:
    """The boundaries that the grain may meet; a free surface replaces the top of the domain. Not collective."""
    domain, up = geometry.domain, geometry.up
    sides = [Side(names.right, 0, domain.right, -1), Side(names.left, 0, domain.left, 1)]
    if not surface_above:
        sides.insert(0, Side(names.top, up, ceiling, -1))
    # In half a scene the grain is equally far from the side beyond the plane of symmetry.
    ends = zip(domain.across[::-1], (-1, 1), strict=True) if geometry.gdim == 3 else ()
    sides += [Side(name, 1, *end) for name, end in zip(names.across[::-1], ends, strict=False)]
    if geometry.bed is None:
        sides.append(Side(names.bottom, up, domain.bottom, 1))
    assert geometry.grain is not None
    return Surroundings(geometry.grain, tuple(sides), geometry.bed, names.bottom)


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The sides of a domain, without the lower one where there is a bed, and that bed."""

    grain: Grain | Solid
    sides: tuple[Side, ...]
    bed: Bed | Terrain | None = None
    name_of_bed: str = "bed"

    def clearance(self, placement: Placement, within: float = np.inf) -> Clearance:
        """The smallest distance [length] of the placed grain from sides and bed; negative beyond them.

        The distance of the bed is computed only if it may be below `within`.
        """
        clearances = [self._from_side(placement, side) for side in self.sides]
        down = -np.eye(placement.gdim)[-1]
        lowest = float(self._extreme(placement, down)[-1])
        if self.bed is not None and (within == np.inf or lowest - self.bed.crest < within):
            gap, on_grain, on_bed = self._near_bed.clearance(placement)
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
        """The point (gdim,) of the grain farthest along a unit vector (gdim,), in the scene."""
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

    @cached_property  # preparation takes longer than a query
    def _near_bed(self) -> Proximity:
        assert self.bed is not None
        return proximity(self.grain, self.bed)

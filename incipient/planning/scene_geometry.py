"""The geometry of a scene: grain and bed in the domain, and where the grain is placed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..geometry.closest import clearance, lifted, proximity, touching
from ..geometry.placement import Placement
from ..geometry.plane.beds import Flat
from ..geometry.plane.closing import Closing, closing
from ..geometry.proximity import Proximity
from ..geometry.space.beds import Plane
from ..scene import Domain

if TYPE_CHECKING:
    from ..contact import Contacts

NARROW = 3.0  # gaps at contact up to which the space between a moving grain and its bed is meshed as narrow
Place = Any  # a point (gdim,) as a tuple of numbers


@dataclass(frozen=True)
class Stance:
    """Placement of a grain."""

    resting: Placement | None = None  # where it touches the bed or is held; None without a grain
    placement: Placement | None = None  # where the flow is computed: lifted by the gap
    gap: float = (
        np.inf
    )  # smallest distance from the bed in the computed flow [length], inf without contact
    gap_ends: tuple[Place, Place] | None = None  # the two points between which the gap is measured


@dataclass(frozen=True, eq=False)
class Geometry:
    """Grain and bed in the domain."""

    domain: Domain
    grain: Any  # shape in its body frame, a Grain of the plane or a Solid; None without a grain
    bed: Any  # shape, a Bed of the plane or a Terrain; None without a bed
    placement: (
        Placement | None
    )  # the grain where it touches the bed or is held; None without a grain
    rests: bool  # whether it rests on the bed
    moves: bool  # whether it moves while the flow is computed
    touches: bool  # whether it continues to move where it touches the bed
    gap: float  # that stands for contact while the flow is computed
    tolerance: float  # distance that counts as touching [length]
    top: str  # what the upper side is
    sides: str  # what both sides across the width of a 3-D domain are
    symmetric: bool  # whether half of the domain is computed
    meshed_bed: float  # numerics.meshed_bed

    @property
    def gdim(self) -> int:
        """Dimension of space."""
        return len(self.domain.extents)

    @property
    def up(self) -> int:
        """Number of the coordinate in which heights are counted."""
        return self.gdim - 1

    @property
    def walled(self) -> bool:
        """Whether the fluid sticks to the sides across the width."""
        return self.gdim == 3 and self.sides == "wall"

    @property
    def half(self) -> tuple[float, float]:
        """The least and the largest y of what is computed of a 3-D domain."""
        low, high = self.domain.across
        return (self.domain.middle if self.symmetric else low), high

    @cached_property
    def contacts(self) -> Contacts:
        """Contacts of the resting grain with the bed."""
        assert self.placement is not None
        return touching(self.grain, self.placement, self.bed, self.tolerance)

    @cached_property
    def stance(self) -> Stance:
        """The grain where it rests or is held; over a bed on which it rests it is lifted by the gap."""
        if self.grain is None or self.bed is None or self.placement is None:
            return Stance(self.placement, self.placement)
        placement = self.placement
        if self.rests and self.moves:
            placement = self.near_bed.with_gap(placement, self.gap, self.contacts.points)
        elif self.rests:
            placement = lifted(self.grain, self.placement, self.bed, self.gap)
        gap, on_grain, on_bed = clearance(self.grain, placement, self.bed)
        ends = self.halved(point(on_grain)), self.halved(point(on_bed))
        return Stance(self.placement, placement, gap, ends)

    @cached_property
    def closing(self) -> Closing:
        """The closing of the space below the resting grain.

        Raises SceneError if the grain does not touch the bed, or the space is nowhere wider than the gap.
        """
        assert self.placement is not None
        outline = tuple(curve.moved(self.placement) for curve in self.grain.drawn())
        return closing(outline, self.bed, self.contacts.points[:, :2], self.gap)

    @cached_property
    def near_bed(self) -> Proximity:
        """Places where the grain is near its bed, or the lower side instead."""
        level = self.domain.bottom
        flat = Flat(level) if self.gdim == 2 else Plane(origin_z=level)
        return proximity(self.grain, flat if self.bed is None else self.bed)

    def gap_points(self, ends: tuple[Place, Place], placement: Placement) -> tuple[Place, ...]:
        """Points where grain and bed nearly touch: the narrowest one, and every contact of a resting grain."""
        if self.touches:
            near = self.near_bed.gaps(placement, NARROW * self.gap).points
            return tuple(dict.fromkeys([*ends, *(self.halved(point(x)) for x in near)]))
        if not self.rests:
            return ends if self.moves and self.gdim == 2 else ends[:1]
        contacts = self.contacts.points[:, : self.gdim]
        return tuple(dict.fromkeys([ends[0], *(point(x) for x in contacts)]))

    def halved(self, x: Place) -> Place:
        """The point, or its mirror image, in what is computed: of half a domain that with larger y."""
        if not self.symmetric:
            return x
        return x[0], self.domain.middle + abs(x[1] - self.domain.middle), x[2]


def point(x: Any) -> Any:
    """The coordinates (gdim,) as a tuple of plain numbers."""
    return tuple(float(one) for one in x)

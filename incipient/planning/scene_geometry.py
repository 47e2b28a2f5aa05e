"""The geometry of a scene: grain and bed in the domain, and where the grain is placed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..geometry.placement import Placement
from ..scene import Domain, Scene

Place = Any  # a point (gdim,) as a tuple of numbers


@dataclass(frozen=True, eq=False)
class Geometry:
    """Grain and bed in the domain.

    grain:     shape in its body frame, a Grain of the plane or a Solid; None without a grain
    bed:       shape, a Bed of the plane or a Terrain; None without a bed
    placement: the grain where it touches the bed or is held; None without a grain
    rests:     whether it rests on the bed; moves: whether it moves while the flow is computed
    gap:       that stands for contact while the flow is computed; tolerance: distance that counts as touching [length]
    top:       what the upper side is; sides: what both sides across the width of a domain in space are
    symmetric: whether half of the domain is computed
    meshed_bed: numerics.meshed_bed
    """

    domain: Domain
    grain: Any
    bed: Any
    placement: Placement | None
    rests: bool
    moves: bool
    gap: float
    tolerance: float
    top: str
    sides: str
    symmetric: bool
    meshed_bed: float

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
        """The least and the largest y of what is computed of a domain in space."""
        low, high = self.domain.across
        return (self.domain.middle if self.symmetric else low), high

    def halved(self, x: Place) -> Place:
        """The point, or its mirror image, in what is computed: of half a domain that with larger y."""
        if not self.symmetric:
            return x
        return x[0], self.domain.middle + abs(x[1] - self.domain.middle), x[2]


def geometry_of(scene: Scene) -> Geometry:
    """The geometry of a scene. Not collective."""
    return Geometry(
        domain=scene.domain,
        grain=scene.grain,
        bed=scene.bed_shape,
        placement=scene.placement,
        rests=scene.rests,
        moves=scene.body is not None and scene.body.moves,
        gap=scene.contact_gap,
        tolerance=scene.contact_tolerance,
        top=scene.top,
        sides=scene.sides,
        symmetric=scene.symmetric,
        meshed_bed=scene.numerics.meshed_bed,
    )


def point(x: Any) -> Any:
    """The coordinates (gdim,) as a tuple of plain numbers."""
    return tuple(float(one) for one in x)

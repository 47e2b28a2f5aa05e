"""How far a moving grain is from what surrounds it: the domain's sides and the bed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Floats, Point
from ..geometry.placement import Placement
from ..geometry.plane.bed import Bed
from ..geometry.plane.grain import Grain
from ..geometry.rest import clearance
from ..scene import Domain

SAMPLES = (
    2000  # on each curve of the outline; the distance of a side then is known to 1e-7 of the grain's size
)


@dataclass(frozen=True)
class Clearance:
    """The smallest distance of grain and surroundings, where it is, and from which side or whether the bed."""

    distance: float
    on_grain: Point
    on_other: Point
    other: str


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The sides of a domain, by the names (bottom, right, top, left), and the bed in place of the bottom."""

    grain: Grain
    domain: Domain
    sides: tuple[str, str, str, str]
    bed: Bed | None = None

    def clearance(self, placement: Placement, within: float = np.inf) -> Clearance:
        """The smallest distance [length] of the placed grain from sides and bed; negative beyond them.

        The bed is looked at more closely only if it may be nearer than `within`.
        """
        outline, up = placement.to_scene(self._outline), self.grain.gdim - 1
        low, right, high, left = self.sides
        domain = self.domain
        found = [
            self._side(outline, up, domain.ceiling, -1, high),
            self._side(outline, 0, domain.right, -1, right),
            self._side(outline, 0, domain.left, 1, left),
        ]
        if self.bed is None:
            found.append(self._side(outline, up, domain.bottom, 1, low))
        if self.bed is not None and (within == np.inf or outline[:, up].min() - self.bed.crest < within):
            gap, on_grain, on_bed = clearance(self.grain, placement, self.bed)
            found.append(Clearance(gap, _point(on_grain), _point(on_bed), low))
        return min(found, key=lambda one: one.distance)

    @cached_property
    def _outline(self) -> Floats:
        return self.grain.chain.points(SAMPLES)

    @staticmethod
    def _side(outline: Floats, axis: int, place: float, inwards: int, name: str) -> Clearance:
        """The distance from the side at a `place` on an axis, with the fluid on the side `inwards` of it."""
        distances = inwards * (outline[:, axis] - place)
        k = int(np.argmin(distances))
        foot = outline[k].copy()
        foot[axis] = place
        return Clearance(float(distances[k]), _point(outline[k]), _point(foot), name)


def _point(x: Floats) -> Point:
    return float(x[0]), float(x[1])

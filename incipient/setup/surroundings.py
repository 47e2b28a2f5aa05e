"""Clearance of a moving grain from the domain's sides and the bed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..geometry.placement import Placement
from .geometry import Place, point

if TYPE_CHECKING:
    from .setup import Setup


@dataclass(frozen=True)
class Clearance:
    """Smallest distance of grain and surroundings, its position, and the side or bed."""

    distance: float
    on_grain: Place
    on_other: Place
    other: str


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The straight sides of a domain, and the bed, if any, instead of the lower one."""

    setup: Setup

    def clearance(
        self, placement: Placement, within: float = np.inf, from_bed: bool = True
    ) -> Clearance:
        """Smallest distance [length] of the placed grain from sides and bed; negative beyond them.

        The distance of the bed is computed only if it may be below `within`, and that of bed or bottom `from_bed`.
        """
        axes, bottom, clearances = np.eye(placement.gdim), self.setup.sides.bottom, []
        for name, axis, place, inwards in self._sides:
            if name != bottom or from_bed:
                towards = -inwards * axes[axis]
                on_grain = self.extreme(placement, towards)
                foot = on_grain.copy()
                foot[axis] = place
                distance = float((foot - on_grain) @ towards)
                clearances.append(Clearance(distance, point(on_grain), point(foot), name))
        if from_bed and self.setup.scene.bed_shape is not None:
            near = self.setup.geometry.near_bed
            if self.extreme(placement, -axes[-1])[-1] - near.bed.crest < within:
                gap, on_grain, on_bed = near.clearance(placement)
                clearances.append(Clearance(gap, point(on_grain), point(on_bed), bottom))
        return min(clearances, key=lambda one: one.distance)

    @cached_property
    def _sides(self) -> list[tuple[str, int, float, int]]:
        """Name, axis, position and inward direction of each; a free surface replaces the top of the domain."""
        scene, names, domain = self.setup.scene, self.setup.sides, self.setup.scene.domain
        sides = [(names.right, 0, domain.right, -1), (names.left, 0, domain.left, 1)]
        if not scene.has_surface:
            sides.insert(0, (names.top, scene.up, self.setup.ceiling, -1))
        if scene.gdim == 3:
            # In half a scene the grain is equally far from the side beyond the plane of symmetry.
            ends = zip(names.across[::-1], domain.across[::-1], (-1, 1), strict=False)
            sides += [(name, 1, place, inwards) for name, place, inwards in ends]
        if scene.bed_shape is None:
            sides.append((names.bottom, scene.up, domain.bottom, 1))
        return sides

    def extreme(self, placement: Placement, direction: Floats) -> Floats:
        """The point (gdim,) of the placed grain that is farthest in a direction."""
        farthest = self.setup.scene.grain.extreme(direction @ placement.rotation)
        return np.asarray(placement.to_scene([farthest])[0])

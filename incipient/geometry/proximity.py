"""A grain and its bed, prepared for queries at many placements, in 2-D and 3-D."""

from abc import ABC, abstractmethod
from functools import cached_property
from typing import Any

import numpy as np

from incipient.arrays import Floats
from incipient.errors import SceneError
from incipient.geometry.contacts import ClosestPoints, Contacts, wrenches
from incipient.geometry.placement import Placement

SAME_PLACE = 1e-6  # of the grain's size: points as near are one


class Proximity(ABC):
    """A grain and a bed of one dimension."""

    grain: Any
    bed: Any

    @cached_property
    def size(self) -> float:
        return float(self.grain.size)

    @property
    @abstractmethod
    def sampling(self) -> float:
        """The longest distance of neighbouring samples on the grain's surface."""

    @abstractmethod
    def drop(self, placement: Placement) -> float:
        """Least vertical distance of samples from the bed."""

    @abstractmethod
    def minima(self, placement: Placement, within: float) -> ClosestPoints:
        """Local minima of the gap, and corners of the grain, of at most `within` (a length).

        Minima closer than the samples are not resolved.
        """

    @abstractmethod
    def tracked(self, placement: Placement, old: ClosestPoints) -> ClosestPoints:
        """The minima `old`, in their order, at a nearby placement."""

    @abstractmethod
    def locally_least(
        self, placement: Placement, minima: ClosestPoints, corners: bool = False, slack: float = 0.0
    ) -> ClosestPoints:
        """Minima over the whole surface, within `slack`; on request also all corners."""

    @abstractmethod
    def contacts(self, placement: Placement, tolerance: float) -> Contacts:
        """See `settle.touching`."""

    def lowered(self, placement: Placement, gap: float = 0.0) -> Placement:
        """The placement moved vertically to a least distance `gap` from the bed."""
        placement = placement.raised(gap - self.drop(placement))
        near = self.minima(placement, gap + self.sampling)
        for _ in range(60):
            if not len(near):
                raise SceneError("the grain finds no bed below it; move it over the bed")
            # Normals that are nearly level tell nothing about heights.
            lift = float(((gap - near.gaps) / np.maximum(near.normals[:, -1], 0.02)).max())
            placement = placement.raised(lift)
            if abs(lift) <= 1e-12 * self.size:
                break
            near = self.tracked(placement, near)
        return placement

    def clearance(self, placement: Placement) -> tuple[float, Floats, Floats]:
        # No point is farther from the bed than from the place straight below.
        within = max(self.drop(placement), 0.0) + SAME_PLACE * self.size
        while not len(near := self.minima(placement, within)):  # of a bed that overhangs the grain
            within += self.size
        k = int(np.argmin(near.gaps))
        return float(near.gaps[k]), near.points[k], near.feet[k]

    def gaps(self, placement: Placement, within: float) -> ClosestPoints:
        """Local minima of the gap up to `within` (a length), and corners that a turn may bring to the bed."""
        near, corners = self.minima(placement, within), self.grain.gdim == 3
        near = self.locally_least(placement, near, corners=corners)
        return near.distinct(SAME_PLACE * self.size)

    def with_gap(
        self, placement: Placement, gap: float, places: Floats, before: float = 0.0
    ) -> Placement:
        """The nearby placement at which contacts at (k, gdim) have a gap, where they had `before`."""
        within = 4.0 * max(gap, before)  # as far a contact may wander when the grain is a gap away
        near = self.gaps(placement, within)
        apart = np.linalg.norm(near.points[:, None] - places[None, :, : placement.gdim], axis=2)
        # Of several small gaps about a place only the nearest is its contact.
        chosen = np.zeros(len(near), dtype=bool)
        if len(near):
            nearest = apart.argmin(axis=0)
            chosen[nearest[apart.min(axis=0) <= within]] = True
        return self.closed(placement, near.only(chosen), gap)

    def rates(self, placement: Placement, contacts: ClosestPoints) -> Floats:
        """Rows (k, n): changes of gaps with motions, both in grain sizes and radians."""
        arms = contacts.points - np.asarray(placement.centre)
        return wrenches(contacts.normals, arms, self.size)

    def moved(self, placement: Placement, motion: Floats) -> Placement:
        """Motions (n,) are in grain sizes and radians."""
        d = placement.gdim
        return placement.moved(self.size * motion[:d], motion[d:])

    def closed(self, placement: Placement, contacts: ClosestPoints, gap: float = 0.0) -> Placement:
        for _ in range(6 if len(contacts) else 0):  # steps of Newton's method
            now = self.tracked(placement, contacts)
            lacking = (gap - now.gaps) / self.size
            if np.abs(lacking).max() <= 1e-14:
                break
            motion = np.linalg.lstsq(self.rates(placement, now), lacking, rcond=1e-9)[0]
            placement = self.moved(placement, motion)
        return placement

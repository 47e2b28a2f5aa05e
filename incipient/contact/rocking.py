"""Rocking of a grain in its pocket: its rest position, continued from the weight to larger flow loads.

Contacts with a reserve hold up to their capacity, otherwise the grain settles again in short steps.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from incipient.arrays import spatial
from incipient.contact.friction import FrictionCone, Law
from incipient.contact.problem import Load
from incipient.contact.safety import safety_factor
from incipient.contact.verdict import MassAndInertia, judged
from incipient.geometry.contacts import Contacts
from incipient.geometry.placement import Placement
from incipient.geometry.plane.beds import Bed
from incipient.geometry.plane.grains import Grain
from incipient.geometry.settle import settle
from incipient.geometry.space.beds import Terrain
from incipient.geometry.space.grains import Solid

# Largest jump within one pocket, in grain sizes; of turns 0.75, below half a right angle: the same side stays down.
POCKET = 0.3
NOTHING = 1e-4  # fraction that counts as none
ALL = 0.999  # fraction that counts as all
BEYOND = 0.02  # relative excess over the critical load at which the mode is evaluated


@dataclass(frozen=True, eq=False)
class Rest:
    """Rest position under the weight and the flow's load at factors from `low` to `high`."""

    low: float
    high: float
    placement: Placement
    contacts: Contacts


@dataclass(frozen=True, eq=False)
class Rocking:
    """Rest positions of a grain under an increasing, frozen flow load."""

    rests: tuple[Rest, ...]  # in the order of factors, the first under the weight alone
    critical: float  # the largest factor with a rest in the pocket; may be infinite
    mode: str  # how the grain leaves the last rest, by the exact criterion; "rest" if it does not
    size: float  # largest diameter of the grain
    round: bool  # whether rotation leaves its shape unchanged

    @property
    def leaves(self) -> bool:
        return self.critical < 1.0

    @property
    def last(self) -> Rest:
        return next((rest for rest in self.rests if rest.high >= 1.0), self.rests[-1])

    def turned(self, rest: Rest) -> float:
        return float(np.linalg.norm(rest.placement.turn_since(self.rests[0].placement)))

    def moved(self, rest: Rest) -> float:
        return math.dist(rest.placement.centre, self.rests[0].placement.centre)

    def drift(self, rest: Rest) -> float:
        return self.moved(rest) / self.size + (0.0 if self.round else self.turned(rest))

    def way(self, rest: Rest) -> str:
        turned, moved = math.degrees(self.turned(rest)), self.moved(rest) / self.size
        return f"turned by {turned:.3g} degrees and moved by {moved:.3g} of its size"

    @property
    def sentence(self) -> str:
        way, factor = self.way(self.last), f"safety factor {self.critical:.4g}"
        if self.leaves:
            way = f"begins to move ({self.mode}), having rocked, {way}"
            return f"the grain {way}, {factor}: above that multiple of the flow's load it leaves its pocket"
        if not math.isfinite(self.critical):
            factor = "safety factor infinite"
        return (
            f"the grain rocks to another rest, {way}, {factor}: up to that multiple of the flow's load it stays in its "
            "pocket"
        )

    def to_dict(self) -> dict[str, Any]:
        """JSON data; an infinite factor is None. The pose is the last one at factors up to one."""
        place = self.last.placement
        turn = (
            {"angle": place.angle}
            if place.quaternion is None
            else {"quaternion": list(place.quaternion)}
        )
        return {
            "critical": self.critical if math.isfinite(self.critical) else None,
            "leaves": self.leaves,
            "mode": self.mode,
            "turned": self.turned(self.last),
            "moved": self.moved(self.last),
            "drift": self.drift(self.last),
            "centre": list(place.centre),
            **turn,
            "contacts": len(self.last.contacts),
        }


def follow(
    grain: Grain | Solid,
    bed: Bed | Terrain,
    start: Placement,
    load: Load,
    law: Law,
    mass_and_inertia: MassAndInertia | None = None,
    resolved: float = 5e-3,
) -> Rocking | None:
    """Continue the rest of a grain from its weight alone until it leaves its pocket.

    None if it has no rest at `start`. The load acts at the grain's centroid, not `load.centre`.
    Without mass and inertia the mode is unknown. `resolved` is the relative tolerance of the
    critical factor. A contact opens once its pull exceeds the cohesion, and then pulls no more: the
    law of Raous, Cangemi and Cocu (1999, Comput. Methods Appl. Mech. Eng. 177, 383) without energy
    of decohesion.

    Raises SceneError if grain and bed differ in dimension, or friction is invalid.
    """
    pocket = _Pocket(grain, bed, load, FrictionCone.of(law), resolved)
    first = pocket.rest(0.0, start)
    if first is None:
        return None
    rests = tuple(pocket.rests(first))
    last = rests[-1]
    mode = "rest"
    if math.isfinite(last.high):
        more = max(last.high * (1.0 + BEYOND), BEYOND * pocket.unit)
        beyond = pocket.load_at(more, last.placement)
        mode = judged(beyond, last.contacts, law, mass_and_inertia).label
    return Rocking(rests, last.high, mode, grain.size, pocket.round)


@dataclass(frozen=True, eq=False)
class _Pocket:
    grain: Grain | Solid
    bed: Bed | Terrain
    load: Load
    law: FrictionCone
    resolved: float

    @property
    def round(self) -> bool:
        return type(self.grain).__name__ in ("Disc", "Sphere")

    @cached_property
    def unit(self) -> float:
        """Factor at which the flow's force and torque over size equal the weight in magnitude."""
        flow = math.hypot(*self.load.flow_force, *(self.load.flow_couple / self.grain.size))
        return math.hypot(*self.load.weight) / flow if flow else math.inf

    def load_at(self, factor: float, placement: Placement) -> Load:
        flow, torque = factor * self.load.flow_force, factor * self.load.flow_couple
        return Load(flow, torque, self.load.weight, spatial(placement.centre))

    def rest(self, factor: float, start: Placement) -> Rest | None:
        """Rest near a placement under a multiple of the load, or None if it lies outside the pocket."""
        acting = self.load_at(factor, start)
        force, torque = acting.force, acting.flow_couple
        if self.grain.gdim == 2:
            force, torque = force[:2], torque[2:]
        if not force.any():
            return None
        settled = settle(
            self.grain,
            self.bed,
            start,
            force,
            float(self.law.coefficient),
            2.0 * POCKET,
            20,  # settling steps to a nearby rest
            torque,
            float(self.law.cohesion),
        )
        placement, contacts = settled.placement, settled.contacts
        if not settled.stable or contacts is None or self._far(start, placement):
            return None
        return Rest(factor, self._held_to(factor, placement, contacts), placement, contacts)

    def rests(self, rest: Rest) -> Iterator[Rest]:
        """Rests with increasing factor; `high` of the last is the critical factor."""
        # The smallest fraction a/(1 + a) of the flow, a in weights, without a nearby rest, and the next step: short
        # beyond the capacity of the contacts, since they rarely yield to another rest.
        lost, step = 1.0, 0.02 if self._fraction(rest.high) <= NOTHING else 0.0
        for _ in range(200):
            fraction = self._fraction(rest.high)
            if fraction >= ALL:
                break
            shortest = self.resolved * fraction * (1.0 - fraction) + NOTHING
            tried = self._tried(fraction, step, lost, shortest)
            # Rounded below one, the factor of the actual load would be tried again and again.
            is_whole = tried == self._fraction(1.0)
            factor = 1.0 if is_whole else self.unit * tried / (1.0 - tried)
            reached = self.rest(factor, rest.placement)
            if reached is None:
                if tried - fraction <= 1.01 * shortest:
                    break
                lost = tried
                continue
            yield rest
            held = self._fraction(reached.high) > tried + shortest
            step = 0.0 if held else min(3.0 * (tried - fraction), 0.1)
            rest, lost = reached, lost if tried < lost else 1.0
        none, every = self._fraction(rest.high) <= 2.0 * NOTHING, self._fraction(rest.high) >= ALL
        yield replace(rest, high=0.0 if none else math.inf) if none or every else rest

    def _tried(self, fraction: float, step: float, lost: float, shortest: float) -> float:
        if fraction <= NOTHING and lost < 1.0:
            return max(0.005 * lost, fraction + shortest)
        whole, tried = (
            self._fraction(1.0),
            max(min(fraction + step, 0.5 * (fraction + lost)), fraction + shortest),
        )
        return whole if fraction < whole < tried else tried

    def _fraction(self, factor: float) -> float:
        return 1.0 if math.isinf(factor) else factor / (self.unit + factor)

    def _held_to(self, factor: float, placement: Placement, contacts: Contacts) -> float:
        interval = safety_factor(self.load_at(1.0, placement), contacts, self.law).interval
        if interval is None or interval[0] > factor * (1.0 + self.resolved):
            return factor
        return max(factor, interval[1])

    def _far(self, before: Placement, after: Placement) -> bool:
        turned = 0.0 if self.round else float(np.linalg.norm(after.turn_since(before)))
        return math.dist(before.centre, after.centre) > POCKET * self.grain.size or turned > 0.75

"""The safety factor over all loads of an error box: at which factors some of them are held, and at which all.

A load of the box is weight + s (flow + ways u) with |u_i| <= 1. What contacts hold is a convex cone, so

- whether some load is held at a factor is one program, with u among its unknowns. With s u in place of u it is linear
  in s as well, and the smallest and the largest such factor are the ends of two programs;
- all loads are held at a factor exactly if those at the corners of the box are. That corners move proves nothing.

Where a program is not answered the factors at which some load may be held are taken as all.
"""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from incipient.arrays import Floats
from incipient.contact.exact.grasp import Grasp, Wrenches, grasp, leave_plane, wrenches
from incipient.contact.exact.safety import NEARLY_ALL, balanced_interval
from incipient.contact.exact.support import TOLERANCE, Support, Widened, support
from incipient.contact.model import Load
from incipient.geometry.contacts import Contacts

Interval = tuple[float, float]


@dataclass(frozen=True, eq=False)
class ErrorBox:
    """Errors of the flow's load, and of the coefficient of friction."""

    # (6, m): changes of force and couple about the centre of mass, of which each load has any share from -1 to 1.
    ways: Floats
    friction: float = 0.0  # by how much friction may be smaller or larger

    @classmethod
    def of(cls, errors: Floats) -> "ErrorBox":
        """The box of errors (6,) of force and couple, each up to its size."""
        return cls(np.diag(errors)[:, np.asarray(errors) > 0.0])

    def corners(self, load: Load) -> Iterator[Load]:
        """The load itself, and those at the 2^m corners of the box."""
        yield load
        for signs in itertools.product((-1.0, 1.0), repeat=self.ways.shape[1]):
            yield shifted(load, self.ways @ np.array(signs))


@dataclass(frozen=True, eq=False)
class SafetyRange:
    """What the loads of a box have in common."""

    # The smallest and the largest factor at which some load of the box, or every load, is held; None if there is none.
    some: Interval | None
    every: Interval | None
    # The safety factors of all loads are between them.
    low: float
    high: float
    worst: (
        Load  # of the given one and those at the corners, that which is held at the fewest factors
    )

    @property
    def rests(self) -> bool:
        """Whether every load of the box is held as it is."""
        return _contains(self.every, 1.0)

    @property
    def moves(self) -> bool:
        """Whether no load of the box is held as it is."""
        return not _contains(self.some, 1.0)

    def widened(self, ratio: float) -> "SafetyRange":
        """The range where all factors may be larger or smaller by a ratio of at least one. Not collective."""
        if ratio == 1.0:
            return self
        if math.isinf(ratio):
            return replace(self, some=(0.0, math.inf), every=None, low=0.0, high=math.inf)
        some, every = self.some, self.every
        less = None if every is None else (ratio * every[0], every[1] / ratio)
        return replace(
            self,
            some=some and (some[0] / ratio, some[1] * ratio),
            every=less if less and less[0] <= less[1] else None,
            low=self.low / ratio,
            high=self.high * ratio,
        )

    @property
    def width(self) -> float:
        """How much longer `some` is than `every`, on the scale of s / (1 + s), where infinity is a number, too."""
        return _length(self.some) - _length(self.every)


def safety_range(load: Load, contacts: Contacts, friction: float, box: ErrorBox) -> SafetyRange:
    """The factors at which some load of a box and every load of it are held. Not collective.

    All ends are exact but for round-off. Raises SceneError as `safety.safety_factor` does.
    """
    firm = _Held.of(load, contacts, friction + box.friction, box)
    loose = (
        firm
        if box.friction == 0.0
        else _Held.of(load, contacts, max(friction - box.friction, 0.0), box)
    )
    some = firm.some()
    every, worst = loose.every(load, box)
    return SafetyRange(
        some=some,
        every=every,
        low=every[1] if loose.weight_held and every is not None else 0.0,
        high=some[1] if firm.weight_held and some is not None else 0.0,
        worst=worst,
    )


def held_words(some: Interval | None, every: Interval | None) -> str:
    """At which multiples of the flow's load a grain is held, for one whose safety factor is zero."""
    if some is None:
        return "no multiple of the flow's load holds it"
    if some[1] == 0.0:
        return "any part of the flow's load moves it"
    may = f"{_ends(some)} times the flow's load may hold it"
    return (
        f"{may}, none for certain"
        if every is None
        else f"{may}, {_ends(every)} times do for certain"
    )


def shifted(load: Load, change: Floats) -> Load:
    """The load with force and couple of the flow changed, by (6,). Not collective."""
    return Load(
        load.flow_force + change[:3], load.flow_couple + change[3:], load.weight, load.centre
    )


@dataclass(frozen=True, eq=False)
class _Held:
    """What contacts with one coefficient of friction hold: `ways` (6, m) in the units of the grasp."""

    grasp: Grasp
    carried: Support
    acting: Wrenches
    ways: Floats
    weight_held: bool

    @classmethod
    def of(cls, load: Load, contacts: Contacts, friction: float, box: ErrorBox) -> "_Held":
        """What contacts hold with a coefficient of friction, the directions of the box in the units of their grasp."""
        held_by = grasp(load, contacts, friction)
        ways = box.ways / np.array([1.0, 1.0, 1.0, *3 * [held_by.reach]])[:, None]
        if held_by.plane is not None and leave_plane(held_by.plane, ways):
            held_by = replace(held_by, plane=None)
        acting, carried = wrenches(load, held_by.reach), support(held_by)
        weight_held = acting.weight_size == 0.0 or carried.holds(acting.weight)
        return cls(held_by, carried, acting, ways, weight_held)

    def some(self) -> Interval | None:
        """The smallest and the largest factor at which some load of the box is held."""
        acting = self.acting
        if self.ways.shape[1] == 0:
            found = balanced_interval(self.carried, acting, self.weight_held)
            return None if found is None else found[0]
        size = acting.flow_size + float(np.linalg.norm(self.ways))
        wide = Widened.of(self.carried, acting.flow * acting.flow_size / size, self.ways / size)
        if acting.weight_size == 0.0:
            return (0.0, math.inf if wide.may_hold_flow() else 0.0)
        unit = acting.weight_size / size
        largest = wide.largest_share_of_flow(acting.weight)
        if largest is None:
            return (0.0, 0.0) if self.weight_held else None
        endless = largest >= 1.0 - NEARLY_ALL and wide.may_hold_flow()
        high = math.inf if endless else unit * largest / max(1.0 - largest, 1e-300)
        if self.weight_held:
            return 0.0, high
        share = wide.largest_share_of_weight(acting.weight)
        return None if share is None or share <= TOLERANCE else (unit * (1.0 - share) / share, high)

    def every(self, load: Load, box: ErrorBox) -> tuple[Interval | None, Load]:
        """The factors at which the loads at all corners are held, and the load that is held at the fewest."""
        common: Interval | None = (0.0, math.inf)
        worst = load
        for corner in box.corners(load):
            acting = wrenches(corner, self.grasp.reach)
            # Held at two factors, a load is held between them.
            if common is None or all(self._held_at(acting, factor) for factor in common):
                continue
            found = balanced_interval(self.carried, acting, self.weight_held)
            common, worst = _common(common, None if found is None else found[0]), corner
        return common, worst

    def _held_at(self, acting: Wrenches, factor: float) -> bool:
        if factor == 0.0 or acting.flow_size == 0.0:
            return self.weight_held
        return self.carried.holds(acting.flow if math.isinf(factor) else acting.at(factor)[0])


def _common(one: Interval, other: Interval | None) -> Interval | None:
    """The factors in both intervals."""
    if other is None:
        return None
    low, high = max(one[0], other[0]), min(one[1], other[1])
    return (low, high) if low <= high else None


def _contains(interval: Interval | None, factor: float) -> bool:
    return (
        interval is not None
        and interval[0] <= factor + TOLERANCE
        and interval[1] >= factor - TOLERANCE
    )


def _ends(interval: Interval) -> str:
    return f"{interval[0]:.4g} to {interval[1]:.4g}"


def _length(interval: Interval | None) -> float:
    """The length of an interval of safety factors s on the scale of s / (1 + s)."""
    return 0.0 if interval is None else 1.0 / (1.0 + interval[0]) - 1.0 / (1.0 + interval[1])

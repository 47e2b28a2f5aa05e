"""The first question of the exact judge: by how much may the flow's load grow before the grain must move?"""

import math
from dataclasses import dataclass, fields
from enum import Enum
from typing import Any

import numpy as np

from incipient.arrays import Floats
from incipient.contact.exact.grasp import Grasp, Wrenches, grasp, wrenches
from incipient.contact.exact.support import TOLERANCE, Support, support
from incipient.contact.model import Load
from incipient.geometry.contacts import Contacts

NEARLY_ALL = 1e-6  # a share of the flow's load this near to one is looked at as all of it
NO_FORCE = 1e-8  # forces below it, relative to the largest, count as zero; so does room in a cone


class SafetyStatus(Enum):
    """Why the safety factor is what it is."""

    CRITICAL = "a larger multiple of the flow's load is not balanced"
    UNLIMITED = "contact forces balance the flow's load at any size"
    NO_FLOW = "there is no flow load, and the weight is held"
    AT_ONCE = "the weight is held, but no part of the flow's load"
    HELD_BY_FLOW = (
        "the weight alone is not held; with the flow's load at the factors of the interval it is"
    )
    UNHELD = "neither the weight alone nor any multiple of the flow's load with it is held"


class ConeState(Enum):
    """Where a contact force is in its friction cone."""

    UNLOADED = "no force"
    INSIDE = "inside the friction cone"
    EDGE = "on the edge of the friction cone"


@dataclass(frozen=True, eq=False)
class SafetyFactor:
    """The safety factor and the contact forces that show it.

    `value`: the largest s >= 0 such that forces in the friction cones balance weight + s times the flow's
    load; math.inf if there is no largest; 0 if the weight alone is not held. `interval`: the smallest and the
    largest s that are balanced, None if none is. `held`: whether 1 is in it. `contact_forces` (n, 3) on the
    grain balance the load at `factor`: the largest of the interval; if that is infinite 1, or twice the
    smallest if 1 is not in it; NaN, with zero forces, if there is no interval. `contact_states`: of these
    forces; `jams`: forces in the cones can balance one another, so contact forces have no bound; `residual`:
    how far equilibrium and cones are missed, relative to the largest force.
    """

    value: float
    status: SafetyStatus
    interval: tuple[float, float] | None
    held: bool
    contact_forces: Floats
    contact_states: tuple[ConeState, ...]
    factor: float
    jams: bool
    residual: float

    def to_dict(self) -> dict[str, Any]:
        """All of it as numbers, strings and lists for JSON; infinity and NaN as None."""
        plain = {item.name: getattr(self, item.name) for item in fields(self)}
        plain |= {"status": self.status.name, "wording": self.status.value}
        plain["contact_forces"] = self.contact_forces.tolist()
        plain["contact_states"] = [state.name for state in self.contact_states]
        for name in ("value", "factor"):
            plain[name] = plain[name] if math.isfinite(plain[name]) else None
        if self.interval is not None:
            plain["interval"] = [end if math.isfinite(end) else None for end in self.interval]
        return plain


def safety_factor(load: Load, contacts: Contacts, friction: float) -> SafetyFactor:
    """The largest s >= 0 such that forces in the friction cones balance weight + s (flow force, flow couple).

    At every contact the force on the grain has a part N >= 0 along the inward normal and a part along the
    surface of at most `friction` N; forces balance, and couples about the centre of mass. In the plane, and
    where friction is zero or infinite, this is a linear program, solved at a vertex; else a second-order cone
    program. Plane cases have third components of zero and couples along the third axis; any other plane
    through the centre of mass that holds contacts and load is recognised as well.

    Raises SceneError if friction is negative or not a number; it may be infinite.
    """
    held_by = grasp(load, contacts, friction)
    acting = wrenches(load, held_by.reach)
    carried = support(held_by)
    weight_held = acting.weight_size == 0.0 or carried.holds(acting.weight)
    found = balanced_interval(carried, acting, weight_held)
    interval, at_end = (None, None) if found is None else found
    value = interval[1] if interval is not None and weight_held else 0.0
    factor, local = _shown(held_by, carried, acting, interval, at_end)
    forces = held_by.forces(local if local is not None else np.zeros((len(held_by), 3)))
    return SafetyFactor(
        value=value,
        status=_status(interval, weight_held, acting),
        interval=interval,
        held=interval is not None
        and interval[0] <= 1.0 + TOLERANCE
        and interval[1] >= 1.0 - TOLERANCE,
        contact_forces=forces,
        contact_states=_states(held_by, local, acting.at(factor)[1]),
        factor=factor,
        jams=carried.can_jam(),
        residual=0.0 if local is None else _residual(held_by, acting, factor, local),
    )


def balanced_interval(
    carried: Support, acting: Wrenches, weight_held: bool
) -> tuple[tuple[float, float], Floats | None] | None:
    """The smallest and the largest factor that is balanced, and local forces (k, 3) at the largest if it is finite.

    None if there is no such factor. `weight_held`: whether contact forces balance the weight alone.
    """
    found = _upper(carried, acting, weight_held)
    low = None if found is None else _lower(carried, acting, weight_held)
    return None if found is None or low is None else ((low, found[0]), found[1])


def _upper(
    carried: Support, acting: Wrenches, weight_held: bool
) -> tuple[float, Floats | None] | None:
    """The largest factor that is balanced, with the local forces there if it is finite; None: there is none."""
    if acting.flow_size == 0.0:
        return (math.inf, None) if weight_held else None
    if acting.weight_size == 0.0:
        return (math.inf if carried.holds(acting.flow) else 0.0), None
    if weight_held and carried.holds(acting.flow):
        return math.inf, None
    if not weight_held and not carried.has_share(acting.flow, acting.weight):
        return None
    found = carried.largest_share(acting.flow, acting.weight)
    if found is None:
        return (0.0, None) if weight_held else None
    share, local = found
    if share >= 1.0 - NEARLY_ALL and carried.holds(acting.flow):
        return math.inf, None
    rest = max(1.0 - share, 1e-300)
    return share / rest * acting.weight_size / acting.flow_size, local * (acting.weight_size / rest)


def _lower(carried: Support, acting: Wrenches, weight_held: bool) -> float | None:
    """The smallest factor that is balanced, if one is; None if only an infinite one would."""
    if weight_held:
        return 0.0
    found = carried.largest_share(acting.weight, acting.flow)
    if found is None or found[0] <= TOLERANCE:
        return None
    return (1.0 - found[0]) / found[0] * acting.weight_size / acting.flow_size


def _shown(
    held_by: Grasp,
    carried: Support,
    acting: Wrenches,
    interval: tuple[float, float] | None,
    local: Floats | None,
) -> tuple[float, Floats | None]:
    """The factor at which contact forces are shown, and the local forces; NaN if nothing is balanced."""
    if interval is None:
        return math.nan, None
    low, high = interval
    if math.isfinite(high) and local is not None:
        return high, held_by.law.nearest(local)
    factor = high if math.isfinite(high) else (1.0 if low < 1.0 else 2.0 * low)
    wrench, size = acting.at(factor)
    found = carried.forces(wrench)
    return factor, None if found is None else held_by.law.nearest(found) * size


def _status(
    interval: tuple[float, float] | None, weight_held: bool, acting: Wrenches
) -> SafetyStatus:
    if interval is None:
        return SafetyStatus.UNHELD
    if not weight_held:
        return SafetyStatus.HELD_BY_FLOW
    if acting.flow_size == 0.0:
        return SafetyStatus.NO_FLOW
    if math.isinf(interval[1]):
        return SafetyStatus.UNLIMITED
    part = interval[1] * acting.flow_size
    return SafetyStatus.CRITICAL if part > TOLERANCE * acting.weight_size else SafetyStatus.AT_ONCE


def _states(held_by: Grasp, local: Floats | None, size: float) -> tuple[ConeState, ...]:
    """Where forces (k, 3) that balance a load of some size are in their cones, for each contact given."""
    if local is None:
        return (ConeState.UNLOADED,) * len(held_by.copy)
    sizes = np.linalg.norm(local, axis=1)
    edges, loaded = (
        held_by.law.room(local) <= NO_FORCE * sizes,
        sizes > NO_FORCE * max(size, sizes.max()),
    )
    states = [
        (ConeState.EDGE if edge else ConeState.INSIDE) if carries else ConeState.UNLOADED
        for edge, carries in zip(edges, loaded, strict=True)
    ]
    return tuple(states[i] for i in held_by.copy.tolist())


def _residual(held_by: Grasp, acting: Wrenches, factor: float, local: Floats) -> float:
    """The worst of force, couple over the unit of length, and cones, relative to load or largest force."""
    wrench, size = acting.at(factor)
    missed = np.abs(held_by.columns @ local.ravel() + size * wrench).max()
    return float(
        max(missed, -held_by.law.room(local).min()) / (max(size, np.abs(local).max()) or 1.0)
    )

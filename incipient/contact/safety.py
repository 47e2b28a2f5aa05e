"""Safety factor: the largest multiple of the flow's load that the contacts balance."""

import math
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import NamedTuple

import numpy as np

from incipient.arrays import Booleans, Floats, Integers
from incipient.contact.conic import FAILED, HELD, INTERVALS, TOLERANCE
from incipient.contact.friction import Law
from incipient.contact.problem import TINY, ContactProblem, Load
from incipient.errors import ConvergenceError
from incipient.geometry.contacts import Contacts

# Contact forces and cone margins below this, relative to the largest force, count as zero.
NO_FORCE = 1e-7


class SafetyStatus(Enum):
    """Reason for the value of the safety factor."""

    CRITICAL = "a larger multiple of the flow's load is not balanced"
    UNLIMITED = "contact forces balance the flow's load at any size"
    NO_FLOW = "there is no flow load, and the weight is held"
    NO_RESERVE = "the weight is held, but no fraction of the flow's load"
    HELD_BY_FLOW = (
        "the weight alone is not held; with the flow's load at the factors of the interval it is"
    )
    UNHELD = "neither the weight alone nor any multiple of the flow's load with it is held"


class ConeState(Enum):
    """Position of a contact force in its friction cone."""

    UNLOADED = "no force"
    INSIDE = "inside the friction cone"
    EDGE = "on the edge of the friction cone"


@dataclass(frozen=True, eq=False)
class SafetyFactor:
    """Safety factor and contact forces that attain it.

    `value`: the largest s >= 0 for which forces in the friction cones balance weight + s times the
    flow's load; infinite if unbounded, 0 if the weight alone is not held. `interval`: smallest and
    largest balanced s, or None. `contact_forces` (n, 3) balance the load at `factor`: the upper end
    of the interval or, if infinite, 1 or twice the lower end; NaN, with zero forces, without an
    interval. `residual`: violation of equilibrium and cones, relative to the largest force.
    """

    value: float
    status: SafetyStatus
    interval: tuple[float, float] | None
    held: bool
    contact_forces: Floats
    contact_states: tuple[ConeState, ...]
    factor: float
    residual: float
    problem: ContactProblem = field(repr=False)

    @cached_property
    def jams(self) -> bool:
        """Whether cone forces can balance one another and are unbounded."""
        return can_jam(self.problem)


def safety_factor(load: Load, contacts: Contacts, law: Law) -> SafetyFactor:
    """Maximise s >= 0 such that forces in the friction cones balance weight + s (flow force, flow torque).

    Raises SceneError for negative or undefined friction (above 1e6 it is computed as 1e6), ConvergenceError if
    the program is not solved.
    """
    return safety_of(ContactProblem.of(load, contacts, law))


def safety_of(problem: ContactProblem) -> SafetyFactor:
    """Safety factor of a single case; raises ConvergenceError."""
    balanced = intervals(problem)
    _require_answer(balanced.state)
    low, high, weight_held = balanced.low.item(), balanced.high.item(), balanced.state[0] == HELD
    interval, factor, local = (low, high), high, problem.local(balanced.multipliers)
    if math.isnan(low) or math.isinf(low):  # no finite multiple is balanced
        factor, local = math.nan, np.zeros_like(local)
    elif math.isinf(high):
        factor = 1.0 if low < 1.0 else 2.0 * low
        forces = forces_that_balance(problem, factor)
        local = np.zeros_like(local) if forces is None else forces
    local = problem.law.project(local)
    wrench, (size,) = problem.wrench(0.0 if math.isnan(factor) else factor)
    sizes = np.sqrt((local * local).sum(axis=2))
    unit = max(size, sizes.max())  # the load or the largest force
    missed = np.abs(problem.columns[0] @ local.ravel() + size * wrench[0]).max()
    return SafetyFactor(
        value=high if weight_held and not math.isnan(high) else 0.0,
        status=_status(problem, interval, weight_held),
        interval=None if math.isnan(low) else interval,
        held=bool(balanced.held[0]),
        contact_forces=problem.forces(local[0]),
        contact_states=cone_states(problem, local, sizes, unit),
        factor=factor,
        residual=0.0 if math.isnan(factor) else float(missed / (unit or 1.0)),
        problem=problem,
    )


def cone_states(
    problem: ContactProblem, local: Floats, sizes: Floats, unit: float
) -> tuple[ConeState, ...]:
    """States of the input contacts of a single case with cone forces (1, k, 3) of some sizes, relative to a unit."""
    # Without cohesion, which cone forces include.
    acting = np.linalg.norm(problem.forces(local[0]), axis=1) / problem.fraction
    at_edge = problem.law.margin(local) <= NO_FORCE * sizes
    places = (acting > NO_FORCE * unit) * (1 + at_edge[0, problem.copy])
    states = tuple(ConeState)
    return tuple(states[place] for place in places.tolist())


class Intervals(NamedTuple):
    """Smallest and largest balanced factors (n,), NaN if none, and states of the weights (n,).

    `multipliers` (n, h) of the columns balance the load at the largest factor, if finite.
    """

    low: Floats
    high: Floats
    state: Integers
    multipliers: Floats

    @classmethod
    def of(cls, columns: Floats, loads: Floats, linear: int) -> "Intervals":
        """Balance multiples of a flow, and a weight, `loads` (2, n, m), by columns (n, m, h).

        The first `linear` multipliers are non-negative, the others triples in unit cones.
        """
        sizes = np.linalg.norm(loads, axis=2)
        flow, weight = np.ascontiguousarray(loads / np.maximum(sizes, TINY)[:, :, None])
        low, high, state, multipliers = INTERVALS(columns, flow, weight, linear, rows=len(flow))
        flow_size, weight_size = sizes
        unit = np.where(weight_size > 0.0, weight_size, flow_size)
        ratio = np.where(flow_size > 0.0, unit / np.maximum(flow_size, TINY), 1.0)
        return cls(low * ratio, high * ratio, state, unit[:, None] * multipliers)

    @property
    def held(self) -> Booleans:
        return (self.low <= 1.0 + TOLERANCE) & (self.high >= 1.0 - TOLERANCE)


def intervals(problem: ContactProblem) -> Intervals:
    """Compute the balanced factors of n problems."""
    loads = problem.within(problem.wrenches[:, :2].swapaxes(1, 2)).transpose(2, 0, 1)
    return Intervals.of(problem.cone_columns, loads, problem.linear)


def factors_that_balance(columns: Floats, wrench: Floats, linear: int) -> Floats | None:
    """Multipliers (h,) of columns (m, h) that balance a wrench (m,): shortest or deepest inside; or None.

    As in `Intervals.of`. Raises ConvergenceError.
    """
    loads = np.stack([np.zeros_like(wrench), wrench])[:, None]
    balanced = Intervals.of(columns[None], loads, linear)
    _require_answer(balanced.state)
    return balanced.multipliers[0] if balanced.state[0] == HELD else None


def _require_answer(state: Integers) -> None:
    if state[0] == FAILED:
        raise ConvergenceError(
            "contacts: the interior-point method gives no answer; merge contacts near one another"
        )


def forces_that_balance(problem: ContactProblem, factor: float) -> Floats | None:
    """Local cone forces (1, k, 3) that balance a single case at a factor, or None."""
    wrench, size = problem.wrench(factor)
    target = problem.within(wrench[:, :, None])[0, :, 0]
    factors = factors_that_balance(problem.cone_columns[0], target, problem.linear)
    return None if factors is None else size[0] * problem.local(factors[None])


def can_jam(problem: ContactProblem) -> bool:
    """Whether non-zero cone forces of a single case can balance one another."""
    columns = problem.columns[0]
    inward = (columns[:, ::3].sum(axis=1) @ columns).reshape(-1, 3)
    cosine, sine, _ = problem.law.scaling[0]
    if (cosine * inward[:, 0] > sine * np.hypot(inward[:, 1], inward[:, 2])).all():
        return False  # all cone forces do positive work in one motion
    columns, step = problem.cone_columns[0], 1 if problem.linear else 3
    rows, target = np.vstack([columns, np.zeros(columns.shape[1])]), np.zeros(len(columns) + 1)
    rows[-1, ::step], target[-1] = 1.0, -1.0
    return factors_that_balance(rows, target, problem.linear) is not None


def _status(
    problem: ContactProblem, interval: tuple[float, float], weight_held: bool
) -> SafetyStatus:
    low, high = interval
    if math.isnan(low):
        return SafetyStatus.UNHELD
    if not weight_held:
        return SafetyStatus.HELD_BY_FLOW
    flow_size, weight_size = problem.sizes[0]
    if flow_size == 0.0:
        return SafetyStatus.NO_FLOW
    if math.isinf(high):
        return SafetyStatus.UNLIMITED
    held = high * flow_size > TOLERANCE * weight_size
    return SafetyStatus.CRITICAL if held else SafetyStatus.NO_RESERVE

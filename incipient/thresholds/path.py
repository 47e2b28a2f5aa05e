"""The load on a grain as the flow grows from rest, interpolated between computed flows.

The exact criterion is applied to the interpolated load over the flow's factor, c(f), which is smooth; the safety factor
need not be. Between two flows the grain counts as stable if it is so under every load within half of the change of c
from its chord: twice the deviation of a parabola with its vertex at one end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from ..arrays import Floats, extrapolated
from ..contact import Contacts, Load
from ..contact.friction import Law
from ..contact.robustness import safety_range
from ..contact.safety import safety_factor
from ..results.errorbars import sizes

SAMPLES = 6  # interpolated loads evaluated within an interval
BOUNDS = 0.05, 20.0  # of S in a root search, also for zero and infinity
ROOT = 1e-10  # relative error of a root of the interpolated load
STEP = 1e-3  # relative, of the derivative of the safety factor


def flow_of(load: Load) -> Floats:
    """Force and torque of the flow (6,)."""
    return np.concatenate([load.flow_force, load.flow_couple])


@dataclass(frozen=True, eq=False)
class LoadPath:
    """Interpolated loads of the flow by its factor.

    factors: (n,) ascending; loads: (n, instants, 6) force and torque over the factor, in steady flow at one instant
    rest:    the load without flow
    before:  the path of another mesh, from which differences are interpolated
    """

    factors: Floats
    loads: Floats
    rest: Load
    contacts: Contacts
    law: Law
    before: LoadPath | None = None

    def load(self, factor: float) -> Load:
        """The load, of several instants that which demands most of the contacts."""
        loads = self._instants(factor)
        return loads[0] if len(loads) == 1 else min(loads, key=self._safety_of)

    def _instants(self, factor: float) -> list[Load]:
        rest = self.rest.weight, self.rest.centre
        return [Load(flow[:3], flow[3:], *rest) for flow in factor * self.over_factor(factor)]

    def over_factor(self, factor: float) -> Floats:
        """The loads over the factor (instants, 6), from the parabola through the three nearest flows."""
        chosen, known, base = self._nearest(factor), self.loads, np.zeros(6)
        if self.before is not None:
            base = self.before.over_factor(factor)
            known = known - np.array([self.before.over_factor(other) for other in self.factors])
        return base + extrapolated(self.factors[chosen].tolist(), list(known[chosen]), factor)

    def _nearest(self, factor: float) -> list[int]:
        count = len(self.factors)
        low = int(np.clip(np.searchsorted(self.factors, factor) - 1, 0, max(count - 2, 0)))
        chosen = list(range(low, min(low + 2, count)))
        others = [i for i in (low - 1, low + 2) if 0 <= i < count]
        # Little beyond the fastest flow extrapolation is parabolic, farther linear.
        if others and factor <= 1.2 * self.factors[-1]:
            chosen.append(min(others, key=lambda i: abs(self.factors[i] - factor)))
        return chosen

    def safety(self, factor: float) -> float:
        return self._safety_of(self.load(factor))

    def _safety_of(self, load: Load) -> float:
        return safety_factor(load, self.contacts, self.law).value

    def loss(self, low: float, high: float) -> float | None:
        """The smallest factor from `low` (stable) to `high` without a stable grain; None: stable up to `high`."""
        samples = np.linspace(low, high, SAMPLES + 2)
        logarithms = [self._logarithm(factor) for factor in samples]
        lost = next((i for i, value in enumerate(logarithms) if i and value < 0.0), None)
        if lost is None:
            return None
        if logarithms[lost - 1] <= 0.0:
            return float(samples[lost - 1])
        bracket = samples[lost - 1], samples[lost]
        return float(brentq(self._logarithm, *bracket, xtol=ROOT * high, rtol=ROOT))

    def doubtful(self, low: float, high: float, end: float) -> float | None:
        """The factor up to `end` at which rest is least certain between the computed flows `low` and `high`.

        None if the grain is stable under all loads within the bound on c.
        """
        change = self.over_factor(high) - self.over_factor(low)
        bends = np.array([sizes(of_instant) for of_instant in change]) * np.any(self.loads, axis=0)
        least, doubtful = 1.0, None
        for factor in np.linspace(low, end, SAMPLES + 2)[1:-1].tolist():
            fraction = (factor - low) / (high - low)
            for load, bend in zip(self._instants(factor), bends, strict=True):
                # |c - chord| <= |c(b) - c(a)|/2 at the middle of the interval, for force and torque.
                errors = np.diag(factor * 2.0 * fraction * (1.0 - fraction) * bend)
                held = safety_range(load, self.contacts, self.law, errors).low
                if held <= least:
                    least, doubtful = held, factor
        return doubtful

    def steepness(self, factor: float) -> float:
        """-d log S / d log factor; infinite for a jump of S, and for S = 0 (rocking grain)."""
        low, high = (self.safety(factor * (1.0 + sign * STEP)) for sign in (-1.0, 1.0))
        if not (low > 0.0 and high > 0.0):
            return math.inf
        return math.log(low / high) / (2.0 * STEP)

    def _logarithm(self, factor: float) -> float:
        return math.log(np.clip(self.safety(factor), *BOUNDS))

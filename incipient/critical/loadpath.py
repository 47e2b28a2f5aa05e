"""The load on a grain as the flow grows from rest, between the flows that have been solved.

The load over the flow's factor, c(f), goes from that of Stokes flow, where the load is proportional to the factor, to
one that grows with the factor. It is smooth, and turns as inertia gains weight; the safety factor need be neither
smooth, finite nor monotone. So c is interpolated, and the exact judge asked about the load interpolated.

How much of the flow the grain could not hold, u = 1/S, is convex and positively homogeneous in the flow's load: a
change of the load by d changes it by at most sum |d_i| u(+-e_i), and within a box it is largest at a corner. With that
an interval between two flows is called held although nothing was solved inside, as long as c leaves the chord by no
more than half of what it changes by: twice as much as a parabola with its vertex at one end.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import brentq

from ..arrays import Floats
from ..contact import Contacts, Load
from ..contact.robustness import ErrorBox, safety_range
from ..contact.safety import SafetyFactor, safety_factor

SAMPLES = 6  # factors inside an interval at which the load interpolated is judged
# |c - chord| <= BEND |c(b) - c(a)| at the middle of an interval, for force and couple.
BEND = 0.5
LARGEST_LOGARITHM = (
    3.0  # of a safety factor while a root is looked for; infinity and zero count as that
)
NEAR_TOP = (
    1.2  # so far above the fastest flow the load is extrapolated by a parabola, beyond in a line
)
ROOT = 1e-10  # relative error of a root of the load interpolated


def flow_of(load: Load) -> Floats:
    """(6,) force and couple of the flow."""
    return np.concatenate([load.flow_force, load.flow_couple])


@dataclass(frozen=True, eq=False)
class LoadPath:
    """Loads of the flow over its factor, interpolated between factors.

    factors: (n,) ascending
    loads:   (n, 6) force and couple over the factor
    rest:    the load without flow; contacts, friction: what holds the grain
    before:  the path from another mesh; what is interpolated then is the difference
    """

    factors: Floats
    loads: Floats
    rest: Load
    contacts: Contacts
    friction: float
    before: LoadPath | None = None

    def load(self, factor: float) -> Load:
        """The load with the flow at a factor."""
        return self._with(factor * self.over_factor(factor))

    def _with(self, flow: Floats) -> Load:
        """The load with force and couple (6,) of the flow."""
        return Load(flow[:3], flow[3:], self.rest.weight, self.rest.centre)

    def over_factor(self, factor: float) -> Floats:
        """(6,) the load over the factor, by the parabola through the three nearest flows, or what there are."""
        if self.before is None:
            return self._interpolated(factor, self.loads)
        known = np.array([self.before.over_factor(one) for one in self.factors])
        return self.before.over_factor(factor) + self._interpolated(factor, self.loads - known)

    def _interpolated(self, factor: float, values: Floats) -> Floats:
        chosen, f, found = self._nearest(factor), self.factors, np.zeros(6)
        for i in chosen:
            found += (
                math.prod((factor - f[j]) / (f[i] - f[j]) for j in chosen if j != i) * values[i]
            )
        return found

    def _nearest(self, factor: float) -> list[int]:
        """Numbers of the flows on both sides, and of the nearest one besides."""
        count, above = len(self.factors), bisect_left(self.factors.tolist(), factor)
        low = min(max(above - 1, 0), max(count - 2, 0))
        chosen = list(range(low, min(low + 2, count)))
        others = [i for i in (low - 1, low + 2) if 0 <= i < count]
        if others and factor <= NEAR_TOP * self.factors[-1]:
            chosen.append(min(others, key=lambda i: abs(self.factors[i] - factor)))
        return chosen

    def judged(self, factor: float) -> SafetyFactor:
        """Safety factor of the load with the flow at a factor."""
        return safety_factor(self.load(factor), self.contacts, self.friction)

    def loss(self, low: float, high: float) -> float | None:
        """The first factor from `low`, which is held, to `high` from which on the load is not; None: it is held."""
        samples = np.linspace(low, high, SAMPLES + 2)
        values = np.array([self._logarithm(factor) for factor in samples])
        lost = np.flatnonzero(values[1:] < 0.0)
        if len(lost) == 0:
            return None
        first = int(lost[0])
        if values[first] <= 0.0:
            return float(samples[first])
        root = brentq(
            self._logarithm, samples[first], samples[first + 1], xtol=ROOT * high, rtol=ROOT
        )
        return float(root)

    def doubtful(self, low: float, high: float, end: float) -> float | None:
        """The factor up to `end` between two flows solved, `low` and `high`, at which rest is least sure; None: it is.

        Sure is rest where all loads as far from that interpolated as c may be bent are held.
        """
        change = self._change(low, high)
        worst, least = 1.0, None
        for factor in np.linspace(low, end, SAMPLES + 2)[1:-1].tolist():
            place = (factor - low) / (high - low)
            bent = BEND * 4.0 * place * (1.0 - place) * change
            lost = self._lost(self.over_factor(factor), bent, factor)
            if lost >= worst:
                worst, least = lost, factor
        return least

    def _change(self, low: float, high: float) -> Floats:
        """(6,) by how much the force changes from one factor to another, in any direction of it; and the couple."""
        difference = np.reshape(self.over_factor(high) - self.over_factor(low), (2, 3))
        return np.repeat(np.linalg.norm(difference, axis=1), 3) * np.any(self.loads, axis=0)

    def _lost(self, over: Floats, bent: Floats, factor: float) -> float:
        """An upper bound of u over all loads within `bent` of one; both over the factor."""
        simple = factor * (self._u(over) + float(bent @ self._loosest))
        if simple < 1.0:
            return simple
        low = safety_range(self._with(over), self.contacts, self.friction, ErrorBox.of(bent)).low
        return factor / low if low > 0.0 else np.inf

    def _u(self, flow: Floats) -> float:
        """1/S of a flow's load (6,); infinite where no part of it is held."""
        value = safety_factor(self._with(flow), self.contacts, self.friction).value
        return 1.0 / value if value > 0.0 else np.inf

    def steepness(self, factor: float) -> float:
        """-d log S / d log factor along the path; infinite where S jumps, or is zero as that of a grain that rocks."""
        step = 1e-3
        low, high = (self.judged(factor * (1.0 + sign * step)).value for sign in (-1.0, 1.0))
        if not (low > 0.0 and high > 0.0):
            return math.inf
        return math.log(low / high) / (2.0 * step)

    def _logarithm(self, factor: float) -> float:
        """log S, within bounds."""
        with np.errstate(divide="ignore"):
            return float(
                np.clip(np.log(self.judged(factor).value), -LARGEST_LOGARITHM, LARGEST_LOGARITHM)
            )

    @cached_property
    def _loosest(self) -> Floats:
        """(6,) the larger u of a unit load there and back along each axis; zero along those without load."""
        axes = np.eye(6) * np.any(self.loads, axis=0)
        return np.array([max(self._u(-axis), self._u(axis)) for axis in axes])

"""Critical Shields numbers of the grains of a bed, by their load coefficients and the exact judge, with their bars.

The Shields number is the bed stress over submerged specific weight and the grain's own diameter. Grains are compared by
`stress`, the same with the bed's median diameter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, percentile
from ..contact import Contacts
from ..contact.batch import Loads, judge_batch
from .deposition import DOWN
from .emulator import Emulator
from .full_runs import CREEPING, SHIELDS_RANGE, LoadCoefficients
from .pockets import Pocket

DRAWS = 40  # of the errors of all loads
STRENGTHS = (
    16  # Shields numbers, with inertia, at which a grain is judged; the threshold is interpolated
)
BEYOND = 1e-3  # how much more than critical a load is that shows the motion
SUBMERGED_WEIGHT = math.pi / 6.0  # of a sphere of diameter and submerged specific weight 1
PERCENTILES = (2.5, 97.5)


@dataclass(frozen=True, eq=False)
class Threshold:
    """The critical Shields number of a grain, draws (k,) of it within its errors, the motion, and by what."""

    pocket: Pocket
    shields: float
    draws: Floats
    mode: str
    is_computed: bool

    @property
    def bar(self) -> tuple[float, float]:
        """Between these are 95% of the draws; infinite where the grain may stay in any flow."""
        low, high = (float(percentile(self.draws, share)) for share in PERCENTILES)
        return low, high


@dataclass(frozen=True, eq=False)
class LoadErrors:
    """What is drawn: for each grain on its own the emulator's errors, for all alike those of the flow.

    correlation: of the emulator's errors; flow: errors (6,) of the runs as shares of the drag
    """

    correlation: Floats
    flow: Floats
    seed: int

    def of_emulator(self, number: int) -> Floats:
        """Standard deviations (DRAWS, 6) of a grain's errors, correlated."""
        drawn = np.random.default_rng([self.seed, 3, number]).standard_normal((DRAWS, 6))
        return np.asarray(drawn @ np.linalg.cholesky(self.correlation).T)

    def of_flow(self) -> Floats:
        """Errors (DRAWS, 6) as shares of the drag; those of all grains are the same."""
        # An error bar is taken as two standard deviations of what is drawn.
        drawn = np.random.default_rng([self.seed, 4]).standard_normal((DRAWS, 6))
        return np.asarray(0.5 * self.flow * drawn)


def thresholds(
    grains: Sequence[Pocket],
    median: float,
    friction: float,
    galileo: float | None,
    runs: Sequence[LoadCoefficients],
    emulator: Emulator,
    errors: LoadErrors,
) -> list[Threshold]:
    """Thresholds of grains: by their own run in creeping flow, else by the emulator."""
    computed = {one.number: one for one in runs} if galileo is None else {}
    strengths = np.geomspace(*SHIELDS_RANGE, STRENGTHS)
    features = []
    for grain in grains:
        # G d^2/nu = Shields number times the square of the grain's own Galileo number, which goes as d^1.5.
        squared = None if galileo is None else galileo**2 * (grain.diameter / median) ** 3
        numbers = [CREEPING] if squared is None else (strengths * squared).tolist()
        features += [features_of(grain, median, one) for one in numbers]
    shape = len(grains), -1, 6
    means, deviations = (part.reshape(shape) for part in emulator.predicted(np.array(features)))
    found = []
    for place, grain in enumerate(grains):
        own, ranges = means[place], deviations[place][:, None] * errors.of_emulator(grain.number)
        if grain.number in computed:
            own, ranges = computed[grain.number].values[None], np.zeros_like(ranges)
        flow = np.abs(own[:, :1])[:, None] * errors.of_flow()
        coefficients = np.concatenate([own[:, None], own[:, None] + ranges + flow], axis=1)
        shields = _critical(grain, coefficients, friction, None if galileo is None else strengths)
        mode = _mode(grain, own, float(shields[0]), friction, strengths)
        found.append(
            Threshold(grain, float(shields[0]), shields[1:], mode, grain.number in computed)
        )
    return found


def features_of(grain: Pocket, median: float, reynolds: float) -> Floats:
    """Features (7,) of a grain for the emulator."""
    return np.array([*grain.features, grain.diameter / median, math.log10(reynolds)])


def _critical(
    grain: Pocket, coefficients: Floats, friction: float, strengths: Floats | None
) -> Floats:
    """Critical Shields numbers (m,) by load coefficients (strengths or 1, m, 6)."""
    if strengths is None:
        return _factors(grain, coefficients[0], friction)
    loads = strengths[:, None, None] * coefficients
    factors = _factors(grain, loads.reshape(-1, 6), friction).reshape(loads.shape[:2])
    return np.array([_first_loss(strengths, column) for column in factors.T])


def _first_loss(strengths: Floats, factors: Floats) -> float:
    """The strength from which on the safety factor is below one; outside of those judged by proportion to the load."""
    lost = np.flatnonzero(factors < 1.0)
    if len(lost) == 0:
        return float(strengths[-1] * factors[-1])
    if lost[0] == 0:
        return float(strengths[0] * factors[0])
    first, second = (int(lost[0]) - 1, int(lost[0]))
    if not np.isfinite(factors[first]) or factors[second] <= 0.0:
        return float(strengths[second])
    above, below = math.log(factors[first]), math.log(factors[second])
    share = above / (above - below)
    return float(strengths[first] ** (1.0 - share) * strengths[second] ** share)


def _factors(grain: Pocket, loads: Floats, friction: float) -> Floats:
    """Safety factors (m,) of loads (m, 6), in units of diameter and submerged specific weight."""
    given = Loads(loads[:, :3], loads[:, 3:], SUBMERGED_WEIGHT * DOWN, np.zeros(3))
    return np.asarray(judge_batch(given, _contacts(grain), friction).factors)


def _contacts(grain: Pocket) -> Contacts:
    return Contacts(0.5 * grain.contacts.normals, grain.contacts.normals)


def _mode(
    grain: Pocket, coefficients: Floats, shields: float, friction: float, strengths: Floats
) -> str:
    """How the grain begins to move when the flow is a little faster than critical."""
    if not (math.isfinite(shields) and shields > 0.0):
        return "rest" if shields > 0.0 else "moves"
    own = (
        coefficients[0]
        if len(coefficients) == 1
        else coefficients[int(np.abs(strengths - shields).argmin())]
    )
    force = (1.0 + BEYOND) * shields * own
    load = Loads(force[None, :3], force[None, 3:], SUBMERGED_WEIGHT * DOWN, np.zeros(3))
    inertia = SUBMERGED_WEIGHT, 0.1 * SUBMERGED_WEIGHT * np.eye(3)
    found = judge_batch(load, _contacts(grain), friction, inertia)
    return found.labels[int(found.modes[0])]

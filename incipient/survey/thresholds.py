"""Critical Shields numbers of the grains of a bed with their bars, from load coefficients and the exact criterion.

The Shields number has the grain's own diameter, `stress` the bed's median diameter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, percentile
from ..contact.batch import Batch, Cases, judge_many
from ..contact.friction import FrictionCone
from .beds import DOWN
from .emulator import Emulator
from .full_runs import CREEPING, SHIELDS_RANGE, LoadCoefficients, relative_error
from .pockets import Pocket
from .request import FlowPast

DRAWS = 40  # of the errors of all loads
OF_EMULATOR, OF_FLOW = 3, 4  # seeds of errors
STRENGTHS = 16  # Shields numbers, with inertia, between which the threshold is interpolated
BEYOND = 1e-3  # relative excess over the critical load of the load that shows the motion
SUBMERGED_WEIGHT = math.pi / 6.0  # of a sphere of diameter and submerged specific weight 1
PERCENTILES = {"low": 2.5, "high": 97.5}


def range_of(drawn: Floats) -> dict[str, float]:
    """Range of 95% of draws (k,)."""
    return {end: float(percentile(drawn, share)) for end, share in PERCENTILES.items()}


@dataclass(frozen=True, eq=False)
class Threshold:
    """The critical Shields number of a grain, draws (k,) within its errors, the mode of motion, and the source."""

    pocket: Pocket
    shields: float
    draws: Floats
    mode: str
    is_computed: bool

    @property
    def bar(self) -> tuple[float, float]:
        """Range of 95% of the draws; infinite if the grain may stay in any flow."""
        low, high = range_of(self.draws).values()
        return low, high


def thresholds(
    grains: Sequence[Pocket],
    median: float,
    flow: FlowPast,
    runs: Sequence[LoadCoefficients],
    emulator: Emulator,
    seed: int = 0,
) -> list[Threshold]:
    """Thresholds of grains: by their own run in creeping flow, otherwise by the emulator.

    Errors of the emulator are independent for each grain, those of the flow common to all.
    """
    galileo = flow.galileo
    computed = {run.number: run for run in runs} if galileo is None else {}
    strengths = np.ones(1) if galileo is None else np.geomspace(*SHIELDS_RANGE, STRENGTHS)
    features = []
    for grain in grains:
        # G d^2/nu = Shields number times the square of the grain's own Galileo number, which goes as d^1.5.
        squared = CREEPING if galileo is None else galileo**2 * (grain.diameter / median) ** 3
        features += [features_of(grain, median, number * squared) for number in strengths.tolist()]
    shape = len(grains), -1, 6
    means, deviations = (part.reshape(shape) for part in emulator.predicted(np.array(features)))
    # An error bar of the runs, over the drag, is two standard deviations.
    of_flow = 0.5 * relative_error(runs) * _drawn(seed, OF_FLOW)
    correlated = np.linalg.cholesky(emulator.correlation).T
    critical = []
    for place, grain in enumerate(grains):
        own = means[place]
        ranges = deviations[place][:, None] * (_drawn(seed, OF_EMULATOR, grain.number) @ correlated)
        if is_computed := grain.number in computed:
            own, ranges = computed[grain.number].values[None], np.zeros_like(ranges)
        common = np.abs(own[:, :1])[:, None] * of_flow
        drawn = np.concatenate([own[:, None], own[:, None] + ranges + common], axis=1)
        law = flow.law(grain.diameter / median, SUBMERGED_WEIGHT)
        shields = _critical(grain, drawn, law, strengths)
        nearest = int(np.abs(strengths - shields[0]).argmin())
        mode = _mode(grain, own[nearest], float(shields[0]), law)
        critical.append(Threshold(grain, float(shields[0]), shields[1:], mode, is_computed))
    return critical


def _drawn(*seed: int) -> Floats:
    return np.random.default_rng(seed).standard_normal((DRAWS, 6))


def features_of(grain: Pocket, median: float, reynolds: float) -> Floats:
    """Features (7,) of a grain for the emulator: pocket, size, and the logarithm of the Reynolds number."""
    return np.array([*grain.features, grain.diameter / median, math.log10(reynolds)])


def _critical(grain: Pocket, coefficients: Floats, law: FrictionCone, strengths: Floats) -> Floats:
    loads = strengths[:, None, None] * coefficients
    factors = np.asarray(_judged(grain, loads.reshape(-1, 6), law).factors)
    return np.array(
        [_first_loss(strengths, column) for column in factors.reshape(loads.shape[:2]).T]
    )


def _first_loss(strengths: Floats, factors: Floats) -> float:
    """The strength from which on the safety factor is below 1; beyond both ends in proportion to the load."""
    lost = np.flatnonzero(factors < 1.0)
    if len(lost) == 0 or lost[0] == 0:
        end = 0 if len(lost) else -1
        return float(strengths[end] * factors[end])
    first, second = int(lost[0]) - 1, int(lost[0])
    if not np.isfinite(factors[first]) or factors[second] <= 0.0:
        return float(strengths[second])
    above, below = math.log(factors[first]), math.log(factors[second])
    fraction = above / (above - below)
    return float(strengths[first] ** (1.0 - fraction) * strengths[second] ** fraction)


def _mode(grain: Pocket, coefficients: Floats, shields: float, law: FrictionCone) -> str:
    if not (math.isfinite(shields) and shields > 0.0):
        return "rest" if shields > 0.0 else "moves"
    load = (1.0 + BEYOND) * shields * coefficients[None]
    verdicts = _judged(grain, load, law, with_mode=True)
    return verdicts.labels[int(verdicts.modes[0])]


def _judged(grain: Pocket, loads: Floats, law: FrictionCone, with_mode: bool = False) -> Batch:
    surface = 0.5 * grain.contacts.normals, grain.contacts.normals
    acting = loads[:, :3], loads[:, 3:], SUBMERGED_WEIGHT * DOWN, np.zeros(3)
    inert = (SUBMERGED_WEIGHT, 0.1 * SUBMERGED_WEIGHT * np.eye(3)) if with_mode else ()
    return judge_many(Cases(*surface, *acting, law, *inert)).complete()

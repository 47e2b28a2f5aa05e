"""Critical Shields numbers of the grains of a bed with their bars, from load coefficients and the exact criterion.

Coefficients of a grain without a run are those of an emulator, a Gaussian process over the surroundings of a grain.
Bars from five-fold cross-validation are widened until 95% of the errors are within 1.96 of them, by the order statistic
that holds for further runs (Vovk, Gammerman & Shafer 2005, *Algorithmic Learning in a Random World*): the largest of n
errors holds with a probability of n/(n + 1), so that 95% needs 19 runs.

The Shields number has the grain's own diameter, `stress` the bed's median diameter.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Floats, percentile
from ..contact.batch import Batch, Cases, judge_many
from ..contact.friction import FrictionCone
from .beds import DOWN
from .full_runs import CREEPING, SHIELDS_RANGE, LoadCoefficients, relative_error
from .pockets import Pocket
from .request import FlowPast

FEWEST, FOLDS = 8, 5  # runs of an emulator, and parts that they are cut into
NINETY_FIVE = 1.96
LEVEL, FOR_LEVEL = 0.95, 19  # probability with which bars hold; n with n/(n + 1) = LEVEL
OF_EMULATOR, OF_FLOW = 3, 4  # seeds of errors
SUBMERGED_WEIGHT = math.pi / 6.0  # of a sphere of diameter and submerged specific weight 1


@dataclass(frozen=True, eq=False)
class Emulator:
    """Predicts load coefficients (6,) from features.

    processes: a pipeline of scikit-learn for each coefficient
    widened: factor (6,) on the bars of each
    errors, bars: (n, 6) of the runs, cross-validated; bars of one standard deviation, widened
    """

    processes: tuple[Any, ...]
    widened: Floats
    errors: Floats
    bars: Floats

    @classmethod
    def of(cls, features: Floats, values: Floats) -> Emulator:
        """Fit runs: features (n, 7) as of `features_of`, and coefficients (n, 6)."""
        errors, bars = np.empty(values.shape), np.empty(values.shape)
        fold = np.random.default_rng(0).permutation(len(features)) % FOLDS
        for number in range(FOLDS):
            left, kept = fold == number, fold != number
            mean, bars[left] = _predicted(_fitted(features[kept], values[kept]), features[left])
            errors[left] = mean - values[left]
        # The order statistic below which a run to come is with a probability of 95%, or as near as so few runs allow.
        rank = min(math.ceil(LEVEL * (len(features) + 1)), len(features)) - 1
        widened = np.maximum(1.0, np.sort(np.abs(errors) / bars, axis=0)[rank] / NINETY_FIVE)
        return cls(_fitted(features, values), widened, errors, bars * widened)

    @property
    def level(self) -> float:
        """Probability with which bars of a grain without a run hold."""
        return min(LEVEL, len(self.errors) / (len(self.errors) + 1))

    def predicted(self, features: Floats) -> tuple[Floats, Floats]:
        means, deviations = _predicted(self.processes, features)
        return means, deviations * self.widened

    @property
    def correlation(self) -> Floats:
        scaled = self.errors / np.maximum(np.sqrt((self.errors**2).mean(axis=0)), 1e-300)
        # A tenth of the identity keeps the correlations of few errors positive definite.
        return np.asarray(0.9 * scaled.T @ scaled / len(scaled) + 0.1 * np.eye(scaled.shape[1]))


def _fitted(features: Floats, values: Floats) -> tuple[Any, ...]:
    from sklearn.base import clone
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, DotProduct, WhiteKernel
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    kernel = (
        ConstantKernel(0.5, (1e-3, 1e2)) * DotProduct(0.1, "fixed")
        + ConstantKernel(0.5, (1e-3, 1e2)) * RBF(2.0, (0.3, 30.0))
        + WhiteKernel(0.1, (1e-5, 1.0))
    )
    process = GaussianProcessRegressor(kernel, normalize_y=True, random_state=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        return tuple(
            make_pipeline(StandardScaler(), clone(process)).fit(features, column)
            for column in values.T
        )


def _predicted(processes: Sequence[Any], features: Floats) -> tuple[Floats, Floats]:
    columns = [process.predict(features, return_std=True) for process in processes]
    means, deviations = (np.column_stack(column) for column in zip(*columns, strict=True))
    return means, deviations


def designed(features: Floats, count: int) -> list[int]:
    """Indices of the first `count` of features (m, 7) to compute, beginning in the middle; more extend fewer.

    Each is the farthest one from those before it (Kennard & Stone 1969, Technometrics 11, 137).
    """
    spread = features.std(axis=0)
    scaled = (features - np.median(features, axis=0)) / np.where(spread > 1e-12, spread, 1.0)
    chosen = [int(np.linalg.norm(scaled, axis=1).argmin())]
    nearest = np.full(len(features), np.inf)
    while len(chosen) < min(count, len(features)):
        nearest = np.minimum(nearest, np.linalg.norm(scaled - scaled[chosen[-1]], axis=1))
        nearest[chosen[-1]] = -np.inf
        chosen.append(int(nearest.argmax()))
    return chosen[:count]


# -- thresholds ------------------------------------------------------------------------------------


def range_of(drawn: Floats, value: float) -> dict[str, float]:
    """Range of 95% of draws (k,), extended to the value without errors; infinite if a grain may stay in any flow."""
    low, high = float(percentile(drawn, 2.5)), float(percentile(drawn, 97.5))
    return {"low": min(low, value), "high": max(high, value)}


@dataclass(frozen=True, eq=False)
class Threshold:
    """The critical Shields number of a grain, draws (k,) within its errors, the mode of motion, and the source."""

    pocket: Pocket
    shields: float
    draws: Floats
    mode: str
    is_computed: bool


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
    # With inertia the threshold is interpolated between Shields numbers.
    strengths = np.ones(1) if galileo is None else np.geomspace(*SHIELDS_RANGE, 16)
    features = []
    for grain in grains:
        # G d^2/nu = Shields number times the square of the grain's own Galileo number, which goes as d^1.5.
        squared = CREEPING if galileo is None else galileo**2 * (grain.diameter / median) ** 3
        features += [features_of(grain, median, number * squared) for number in strengths.tolist()]
    predicted = emulator.predicted(np.array(features))
    means, deviations = (part.reshape(len(grains), -1, 6) for part in predicted)
    # An error bar of the runs, over the drag, is two standard deviations.
    of_flow = 0.5 * relative_error(runs) * _drawn(seed, OF_FLOW)
    correlated = np.linalg.cholesky(emulator.correlation).T
    critical = []
    for place, grain in enumerate(grains):
        own = means[place]
        ranges = deviations[place][:, None] * (_drawn(seed, OF_EMULATOR, grain.number) @ correlated)
        if is_computed := grain.number in computed:
            own, ranges = computed[grain.number].values[None], np.zeros_like(ranges)
        ranges = ranges + np.abs(own[:, :1])[:, None] * of_flow
        drawn = np.concatenate([own[:, None], own[:, None] + ranges], axis=1)
        law = flow.law(grain.diameter / median, SUBMERGED_WEIGHT)
        shields = _critical(grain, drawn, law, strengths)
        nearest = int(np.abs(strengths - shields[0]).argmin())
        mode = _mode(grain, own[nearest], float(shields[0]), law)
        critical.append(Threshold(grain, float(shields[0]), shields[1:], mode, is_computed))
    return critical


def _drawn(*seed: int) -> Floats:
    """Draws (40, 6) of the errors of all loads."""
    return np.random.default_rng(seed).standard_normal((40, 6))


def features_of(grain: Pocket, median: float, reynolds: float) -> Floats:
    """Features (7,) of a grain for the emulator: pocket, size, and the logarithm of the Reynolds number."""
    around = grain.protrusion, grain.exposure, grain.sheltered, grain.backed, grain.skew
    return np.array([*around, grain.diameter / median, math.log10(reynolds)])


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
    pair = [lost[0], lost[0] - 1]  # with ascending factors
    if not (np.isfinite(factors[pair]).all() and factors[lost[0]] > 0.0):
        return float(strengths[lost[0]])
    return float(np.exp(np.interp(0.0, np.log(factors[pair]), np.log(strengths[pair]))))


def _mode(grain: Pocket, coefficients: Floats, shields: float, law: FrictionCone) -> str:
    if not (math.isfinite(shields) and shields > 0.0):
        return "rest" if shields > 0.0 else "moves"
    # Just above, where it moves
    verdicts = _judged(grain, 1.001 * shields * coefficients[None], law, with_mode=True)
    return verdicts.labels[int(verdicts.modes[0])]


def _judged(grain: Pocket, loads: Floats, law: FrictionCone, with_mode: bool = False) -> Batch:
    surface = 0.5 * grain.contacts.normals, grain.contacts.normals
    acting = loads[:, :3], loads[:, 3:], SUBMERGED_WEIGHT * DOWN, np.zeros(3)
    inert = (SUBMERGED_WEIGHT, 0.1 * SUBMERGED_WEIGHT * np.eye(3)) if with_mode else ()
    return judge_many(Cases(*surface, *acting, law, *inert)).complete()

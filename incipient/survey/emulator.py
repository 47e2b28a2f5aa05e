"""Load coefficients of grains without a run: a Gaussian process over the surroundings of a grain.

Bars from five-fold cross-validation are widened until 95% of the errors are within 1.96 of them, by the order statistic
that holds for further runs (Vovk, Gammerman & Shafer 2005, *Algorithmic Learning in a Random World*): the largest of n
errors holds with a probability of n/(n + 1), so that 95% needs 19 runs.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Floats

FEWEST, FOLDS = 8, 5  # runs of an emulator, and parts that they are cut into
NINETY_FIVE = 1.96
LEVEL, FOR_LEVEL = 0.95, 19  # probability with which bars hold; n with n/(n + 1) = LEVEL


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
        """Fit runs: features (n, 7) as of `thresholds.features_of`, and coefficients (n, 6)."""
        errors, bars = np.empty(values.shape), np.empty(values.shape)
        fold = np.random.default_rng(0).permutation(len(features)) % FOLDS
        for number in range(FOLDS):
            left, kept = fold == number, fold != number
            mean, bars[left] = _predicted(_fitted(features[kept], values[kept]), features[left])
            errors[left] = mean - values[left]
        # The order statistic below which a run to come is with a probability of 95%, or as near as so few runs allow.
        rank = min(math.ceil(LEVEL * (len(features) + 1)), len(features)) - 1
        worst = np.sort(np.abs(errors) / bars, axis=0)[rank]
        widened = np.maximum(1.0, worst / NINETY_FIVE)
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

    linear = ConstantKernel(0.5, (1e-3, 1e2)) * DotProduct(0.1, "fixed")
    smooth = ConstantKernel(0.5, (1e-3, 1e2)) * RBF(2.0, (0.3, 30.0))
    kernel = linear + smooth + WhiteKernel(0.1, (1e-5, 1.0))
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
        away = np.linalg.norm(scaled - scaled[chosen[-1]], axis=1)
        nearest = np.minimum(nearest, away)
        nearest[chosen[-1]] = -np.inf
        chosen.append(int(nearest.argmax()))
    return chosen[:count]

"""Load coefficients of grains that were not computed: a Gaussian process over what is around a grain.

Its bars come from the runs themselves: they are cut into five parts, each is foretold by processes that were fitted to
the other four, and all bars are widened until 95% of these errors are within 1.96 of them, by the order statistic that
holds for runs to come as well (Vovk, Gammerman & Shafer 2005, *Algorithmic Learning in a Random World*). The largest of
n errors holds with a probability of n/(n + 1): 95% needs 19 runs.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from typing import Any

import numpy as np

from ..arrays import Floats, Integers
from ..errors import MissingError

FEWEST, FOLDS = 8, 5  # runs from which on there is an emulator; parts that they are cut into
NINETY_FIVE = 1.96
LEVEL, FOR_LEVEL = 0.95, 19  # probability with which bars hold; n with n/(n + 1) = LEVEL
FEATURES = (
    "protrusion",
    "exposure",
    "sheltered up the stream",
    "sheltered down the stream",
    "shelter left less right",
    "diameter over the median",
    "log10 of the Reynolds number",
)


@dataclass(frozen=True, eq=False)
class _Process:
    """A Gaussian process for one coefficient, its kernel with noise fitted; features are scaled.

    kernel: of scikit-learn, in units of `scale` squared
    """

    kernel: Any
    points: Floats
    values: Floats
    mean: float
    scale: float

    @property
    def covariance(self) -> Any:
        """The kernel without noise."""
        return self.kernel.k1

    @property
    def noise(self) -> float:
        """The variance of what features do not tell."""
        return float(self.kernel.k2.noise_level)

    @cached_property
    def _inverse(self) -> Floats:
        own = self.covariance(self.points, self.points) + (self.noise + 1e-10) * np.eye(
            len(self.points)
        )
        return np.asarray(np.linalg.inv(own))

    def predicted(self, at: Floats) -> tuple[Floats, Floats]:
        """Means and standard deviations (m,), noise included."""
        across = self.covariance(at, self.points)
        left = (
            self.covariance.diag(at)
            - np.einsum("ij,jk,ik->i", across, self._inverse, across)
            + self.noise
        )
        mean = self.mean + self.scale * across @ self._inverse @ self.values
        return mean, self.scale * np.sqrt(np.maximum(left, 1e-12))


@dataclass(frozen=True, eq=False)
class Emulator:
    """Foretells load coefficients (6,) by features; `widened` (6,) is the factor on the bars of each.

    errors, bars: (n, 6) of the runs, each foretold without the fifth of them to which it belongs; bars are one
        standard deviation, widened
    """

    processes: tuple[_Process, ...]
    widened: Floats
    middle: Floats
    spread: Floats
    used: np.ndarray
    errors: Floats
    bars: Floats

    @classmethod
    def of(cls, features: Floats, values: Floats) -> Emulator:
        """The emulator by runs: features (n, 7) as in FEATURES, and coefficients (n, 6).

        Raises MissingError without scikit-learn.
        """
        spread = features.std(axis=0)
        used = spread > 1e-9 * (1.0 + np.abs(features).max(axis=0))
        middle, spread = features.mean(axis=0), np.where(used, spread, 1.0)
        scaled = ((features - middle) / spread)[:, used]
        processes = tuple(_fitted(scaled, column) for column in values.T)
        errors, bars = np.empty(values.shape), np.empty(values.shape)
        fold = np.random.default_rng(0).permutation(len(scaled)) % FOLDS
        for number in range(FOLDS):
            left, kept = fold == number, fold != number
            for place, column in enumerate(values.T):
                mean, deviation = _fitted(
                    scaled[kept], column[kept], processes[place].kernel
                ).predicted(scaled[left])
                errors[left, place], bars[left, place] = mean - column[left], deviation
        # The order statistic below which a run to come is with a probability of 95%, or as much as so few tell.
        rank = min(int(np.ceil(LEVEL * (len(scaled) + 1))), len(scaled)) - 1
        worst = np.sort(np.abs(errors) / bars, axis=0)[rank]
        widened = np.maximum(1.0, worst / NINETY_FIVE)
        return cls(processes, widened, middle, spread, used, errors, bars * widened)

    @property
    def level(self) -> float:
        """The probability with which bars of a grain without a run hold."""
        return min(LEVEL, len(self.errors) / (len(self.errors) + 1))

    @staticmethod
    def require() -> None:
        """Raise MissingError without scikit-learn, before anything is computed."""
        _scikit_learn()

    def _scaled(self, features: Floats) -> Floats:
        return np.asarray(((features - self.middle) / self.spread)[:, self.used])

    def predicted(self, features: Floats) -> tuple[Floats, Floats]:
        """Coefficients (m, 6) and their standard deviations (m, 6) at features (m, 7)."""
        at = self._scaled(features)
        found = [process.predicted(at) for process in self.processes]
        means, deviations = (np.column_stack(column) for column in zip(*found, strict=True))
        return means, deviations * self.widened

    @property
    def correlation(self) -> Floats:
        """(6, 6) of the errors of all coefficients."""
        scales = np.maximum(np.sqrt((self.errors**2).mean(axis=0)), 1e-300)
        found = (self.errors / scales).T @ (self.errors / scales) / len(self.errors)
        # Few errors tell little of correlations: a tenth of none keeps them within what is possible.
        return np.asarray(0.9 * found + 0.1 * np.eye(len(found)))

    def variances_with(self, features: Floats, added: Floats) -> Floats:
        """Variances (m,) of the drag, without noise, at features (m, 7) if runs at others (k, 7) were added."""
        process, at = self.processes[0], self._scaled(features)
        points = np.vstack([process.points, self._scaled(added)])
        own = process.covariance(points, points) + (process.noise + 1e-10) * np.eye(len(points))
        across = process.covariance(at, points)
        left = process.covariance.diag(at) - np.einsum(
            "ij,jk,ik->i", across, np.linalg.inv(own), across
        )
        return np.asarray(np.maximum(left, 0.0) * process.scale**2)

    def most_wanted(self, features: Floats, count: int) -> Integers:
        """Which `count` of features (m, 7) to compute next: each the most uncertain once those before are known."""
        chosen: list[int] = []
        for _ in range(min(count, len(features))):
            variances = self.variances_with(features, features[chosen])
            variances[chosen] = -1.0
            chosen.append(int(variances.argmax()))
        return np.array(chosen, dtype=np.int64)


def _scikit_learn() -> tuple[Any, Any, Any]:
    """Its processes, kernels and warnings. Raises MissingError."""
    try:
        processes, exceptions = (
            import_module(f"sklearn.{name}") for name in ("gaussian_process", "exceptions")
        )
    except ImportError as error:
        raise MissingError(
            f"scikit-learn cannot be used ({error}): pip install 'incipient[survey]'"
        ) from None
    return processes.GaussianProcessRegressor, processes.kernels, exceptions.ConvergenceWarning


def _fitted(points: Floats, values: Floats, kernel: Any = None) -> _Process:
    """A process whose kernel is fitted by the largest likelihood: a linear part, a smooth one, and noise.

    kernel: where the search begins
    """
    regressor, kernels, unconverged = _scikit_learn()
    mean, scale = float(values.mean()), max(float(values.std()), 1e-12)
    target = (values - mean) / scale
    if kernel is None:
        linear = kernels.ConstantKernel(0.5, (1e-3, 1e2)) * kernels.DotProduct(0.1, "fixed")
        smooth = kernels.ConstantKernel(0.5, (1e-3, 1e2)) * kernels.RBF(2.0, (0.3, 30.0))
        kernel = linear + smooth + kernels.WhiteKernel(0.1, (1e-5, 1.0))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", unconverged)
        machine = regressor(kernel, random_state=0)
        machine.fit(points, target)
    fitted = machine.kernel_
    return _Process(fitted, points, target, mean, scale)


def designed(features: Floats, count: int) -> Integers:
    """Which `count` of features (m, 7) to compute first: far from one another, beginning in the middle.

    Each is the one farthest from those before it (Kennard & Stone 1969, Technometrics 11, 137).
    """
    spread = features.std(axis=0)
    scaled = (features - np.median(features, axis=0)) / np.where(spread > 1e-12, spread, 1.0)
    chosen = [int(np.linalg.norm(scaled, axis=1).argmin())] if len(features) and count else []
    away = np.full(len(features), np.inf)
    while len(chosen) < min(count, len(features)):
        away = np.minimum(away, np.linalg.norm(scaled - scaled[chosen[-1]], axis=1))
        away[chosen] = -1.0
        chosen.append(int(away.argmax()))
    return np.array(chosen, dtype=np.int64)


def runs_to_halve(emulator: Emulator, features: Floats, unknown: Sequence[int]) -> int:
    """How many more runs, each where the emulator is least sure, halve the mean bar of the drag over all grains.

    features (m, 7): of all grains; unknown: those without a run. A grain with a run has no bar of the emulator.
    """
    noise = emulator.processes[0].noise * emulator.processes[0].scale ** 2
    left = list(unknown)

    def bar(added: list[int]) -> float:
        """The sum of the bars that are left once some more grains have runs."""
        still = [one for one in left if one not in added]
        if not still:
            return 0.0
        return float(
            np.sqrt(emulator.variances_with(features[still], features[added]) + noise).sum()
        )

    order = [left[place] for place in emulator.most_wanted(features[left], len(left))]
    whole = bar([])
    low, high = 0, len(order)
    while low < high:  # the bar falls with every run
        middle = (low + high) // 2
        low, high = (low, middle) if bar(order[:middle]) <= 0.5 * whole else (middle + 1, high)
    return low

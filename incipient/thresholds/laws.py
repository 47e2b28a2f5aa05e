"""Laws of the factor on the velocity at a grain: fraction of time above a level, and rate of upcrossings.

With a Gaussian process y of variance 1 and the relative intensity I the factor is 1 + I y, or lognormal:
exp(s y - s^2/2), s^2 = log(1 + I^2). With the correlation 1 - (t/lambda)^2 at short times, y crosses z upwards
exp(-z^2/2)/(sqrt(2) pi lambda) times in unit time (Rice 1945, Bell Syst. Tech. J. 24, 46).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.integrate import trapezoid
from scipy.optimize import brentq
from scipy.stats import norm

from ..arrays import NO_EVENT, Floats
from ..errors import SceneError

SHORTEST = 20.0  # least duration of a series, in integral times


@dataclass(frozen=True)
class Gaussian:
    """The law of a factor that is a function of a Gaussian process.

    intensity: root mean square of the fluctuation over the mean
    microscale: lambda of the correlation 1 - (t/lambda)^2 at short times; None: not known
    """

    intensity: float
    lognormal: bool = True
    microscale: float | None = None
    known_range = (0.0, 1.0)  # of probabilities whose levels are known

    @cached_property
    def _deviation(self) -> float:
        return math.sqrt(math.log1p(self.intensity**2))

    def standard(self, level: float) -> float:
        if not self.lognormal:
            return (level - 1.0) / self.intensity
        if level <= 0.0:
            return -math.inf
        return math.log(level) / self._deviation + 0.5 * self._deviation

    def factor(self, standard: Floats) -> Floats:
        if not self.lognormal:
            return np.asarray(1.0 + self.intensity * standard)
        return np.asarray(np.exp(self._deviation * (standard - 0.5 * self._deviation)))

    def growth(self, strength: float) -> float:
        """Growth rate of a flow of mean `strength` at unit growth rate of the process.

        Relative to the present strength for a lognormal factor, otherwise to the scene's.
        """
        return self._deviation if self.lognormal else strength * self.intensity

    def exceeded(self, level: float) -> float:
        return float(norm.sf(self.standard(level)))

    def level(self, probability: float) -> float:
        return float(self.factor(norm.isf(probability)))

    def upcrossings(self, level: float) -> float | None:
        if self.microscale is None:
            return None
        crossings = math.exp(-0.5 * self.standard(level) ** 2)
        return crossings / (math.sqrt(2.0) * math.pi * self.microscale)

    def other(self) -> Gaussian:
        return Gaussian(self.intensity, not self.lognormal, self.microscale)


@dataclass(frozen=True, eq=False)
class Measured:
    """The law of a measured series, linear between its points.

    times, factors: (n,) the series, over its mean
    integral_time: of its correlation; None: computed, up to the first zero of the correlation

    Raises SceneError for a series that is too short for its integral time.
    """

    times: Floats
    factors: Floats
    integral_time: float | None = None

    def __post_init__(self) -> None:
        if self.duration < SHORTEST * self.integral:
            why = f"gusts.points: the series lasts {self.duration:.4g}, less than {SHORTEST:g} times its integral time"
            raise SceneError(f"{why} {self.integral:.4g}; give a longer one")

    @classmethod
    def of(cls, points: Floats, integral_time: float | None) -> Measured:
        times, speeds = points.T
        mean = trapezoid(speeds, times) / (times[-1] - times[0])
        return cls(times, speeds / mean, integral_time)

    @property
    def duration(self) -> float:
        return float(self.times[-1] - self.times[0])

    @cached_property
    def intensity(self) -> float:
        return math.sqrt(trapezoid((self.factors - 1.0) ** 2, self.times) / self.duration)

    @property
    def even(self) -> tuple[Floats, float]:
        """The series (n,) at equally spaced times, and their spacing."""
        times, step = np.linspace(self.times[0], self.times[-1], len(self.times), retstep=True)
        return np.interp(times, self.times, self.factors), float(step)

    @cached_property
    def integral(self) -> float:
        if self.integral_time is not None:
            return self.integral_time
        factors, step = self.even
        spectrum = np.abs(np.fft.rfft(factors - 1.0, 2 * len(factors))) ** 2
        correlation = np.fft.irfft(spectrum)[: len(factors)] / np.arange(len(factors), 0, -1)
        below = np.flatnonzero(correlation <= 0.0)
        kept = correlation[: below[0] if len(below) else None] / correlation[0]
        return step * float(kept.sum() - 0.5)

    @property
    def independent(self) -> float:
        return self.duration / (2.0 * self.integral)

    @property
    def known_range(self) -> tuple[float, float]:
        return 1.0 / self.independent, 1.0 - 1.0 / self.independent

    def exceeded(self, level: float) -> float:
        low, high = np.sort([self.factors[:-1], self.factors[1:]], axis=0) - level
        crosses = (low < 0.0) & (high > 0.0)
        above = np.where(crosses, high / np.where(crosses, high - low, 1.0), low + high > 0.0)
        return float(np.diff(self.times) @ above) / self.duration

    def level(self, probability: float) -> float:
        """Level exceeded with a probability. Raises SceneError outside the known range."""
        _require_known(probability, self.known_range, "series")
        low, high = float(self.factors.min()), float(self.factors.max())
        if self.exceeded(low) <= probability:  # the series has its minimum otherwise
            return low
        return float(
            brentq(lambda level: self.exceeded(level) - probability, low, high, xtol=1e-10)
        )

    def upcrossings(self, level: float) -> float:
        rises = (self.factors[:-1] <= level) & (self.factors[1:] > level)
        return float(np.count_nonzero(rises)) / self.duration

    def spread(self, probability: float) -> float:
        """Standard error of a fraction of the time."""
        if not 0.0 < probability < 1.0:
            return NO_EVENT / self.independent
        return math.sqrt(probability * (1.0 - probability) / self.independent)


@dataclass(frozen=True, eq=False)
class Events:
    """The law of counted gusts of constant strength, without motion in between.

    strengths, lengths: (n,) velocities over the mean, the strongest first, and their durations
    duration: of the record
    """

    strengths: Floats
    lengths: Floats
    duration: float

    @classmethod
    def of(cls, points: Floats, record: float) -> Events:
        strengths, lengths = points[np.argsort(-points[:, 0], kind="stable")].T
        return cls(strengths, lengths, record)

    @cached_property
    def _fractions(self) -> Floats:
        return np.cumsum(self.lengths) / self.duration

    @property
    def known_range(self) -> tuple[float, float]:
        return float(self._fractions[0]), float(self._fractions[-1])

    def exceeded(self, level: float) -> float:
        return float(self.lengths[self.strengths > level].sum()) / self.duration

    def level(self, probability: float) -> float:
        """Level exceeded with a probability. Raises SceneError outside the known range."""
        _require_known(probability, self.known_range, "events")
        return float(np.interp(probability, self._fractions, self.strengths))

    def upcrossings(self, level: float) -> float:
        return float(np.count_nonzero(self.strengths > level)) / self.duration

    def spread(self, probability: float) -> float:
        """Standard error of a fraction of the time, for independent gusts (Poisson)."""
        if not probability > 0.0:
            return NO_EVENT * float(self.lengths.mean()) / self.duration
        count = int(np.searchsorted(self._fractions, probability)) + 1
        return math.sqrt(float((self.lengths[:count] ** 2).sum())) / self.duration

    def moving(self, levels: Floats, durations: Floats, static: float) -> int:
        """Number of gusts that exceed one of the levels for its duration."""
        lasting = (self.strengths[:, None] > levels) & (self.lengths[:, None] >= durations)
        return int(np.count_nonzero(lasting.any(axis=1)))


def _require_known(probability: float, known: tuple[float, float], what: str) -> None:
    if not known[0] <= probability <= known[1]:
        why = f"probability {probability:g} is outside the range of the {what}, {known[0]:.2g} to {known[1]:.2g}"
        raise SceneError(f"gusts.points: {why}; give a longer record, or a law")


Law = Gaussian | Measured | Events

"""Laws of the factor on the velocity at a grain: fraction of time above a level, and rate of upcrossings.

With a Gaussian process y of variance 1 and the relative intensity I the factor is 1 + I y, or lognormal:
exp(s y - s^2/2), s^2 = log(1 + I^2). With the correlation 1 - (t/lambda)^2 at short times, y crosses z upwards
exp(-z^2/2)/(sqrt(2) pi lambda) times in unit time (Rice 1945, Bell Syst. Tech. J. 24, 46).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.integrate import trapezoid
from scipy.optimize import brentq
from scipy.stats import norm

from ..arrays import NO_EVENT, Floats
from ..errors import SceneError

SHORTEST = 20.0  # least duration of a series, in integral times
PER_MICROSCALE = 16  # points of a generated series
MOST_POINTS = 4_000_000
LENGTH = 20_000.0  # of a generated series, in integral times
LEVELS = 40  # strengths at which the curve of weakest gusts is sampled
SEED = 7
DIFFERENT = 1.25  # least ratio of the critical steady flows of different scenes


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


# -- gusts that last ------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class WeakestGusts:
    """Strengths of the weakest gusts that move a grain out of its pocket.

    durations, strengths, errors: (n,) the shortest first; strengths over the flow of the scene
    static: critical strength of a steady flow
    known:  whether all errors are known; unknown ones are zero
    """

    durations: Floats
    strengths: Floats
    errors: Floats
    static: float
    known: bool = True

    @classmethod
    def of(cls, stored: dict[str, Any]) -> WeakestGusts:
        """Parse the content of a gusts.json. Raises SceneError for less than two durations or other content."""
        try:
            points, static = stored["points"], float(stored["static"])
            known = all(point["error"] is not None for point in points)
            rows = [
                [float(point["duration"]), float(point["strength"]), float(point["error"] or 0.0)]
                for point in points
            ]
        except (KeyError, TypeError, ValueError):
            raise _refused("holds no gusts; repeat incipient gust") from None
        if len(rows) < 2:
            remedy = "search more with incipient gust --durations"
            raise _refused(f"has fewer than two durations; {remedy}")
        durations, strengths, errors = np.array(sorted(rows)).T
        if not (durations > 0.0).all() or not (strengths > errors).all():
            raise _refused("has a strength within its error; repeat incipient gust")
        return cls(durations, strengths, errors, static, known)

    def require_of(self, critical: float) -> None:
        if not critical / DIFFERENT < self.static < critical * DIFFERENT:
            why = f"there a steady flow moves the grain from {self.static:.3g} on, here from {critical:.3g}"
            raise _refused(f"{why}; search gusts of this scene with incipient gust")

    def needed(self, sign: float = 0.0) -> tuple[Floats, Floats]:
        """Strengths (m,), shifted by `sign` times their errors, and their durations (m,)."""
        strengths = self.strengths + sign * self.errors
        order = np.argsort(strengths)
        levels = np.geomspace(strengths.min(), strengths.max(), LEVELS)
        logarithms = np.log(strengths[order]), np.log(self.durations[order])
        return levels, np.exp(np.interp(np.log(levels), *logarithms))


def _refused(why: str) -> SceneError:
    return SceneError(f"gusts.json: {why}")


@dataclass(frozen=True, eq=False)
class Series:
    """Factor (n,) at equally spaced times, linear in between."""

    factors: Floats
    step: float

    @property
    def duration(self) -> float:
        return self.step * (len(self.factors) - 1)

    def moving(self, levels: Floats, durations: Floats, static: float) -> int:
        """Number of excursions above `static` that exceed one of the levels for its duration."""
        above = self.factors > static
        excursion, moving = np.cumsum(np.diff(above, prepend=False) & above), set[int]()
        for level, duration in zip(levels, durations, strict=True):
            above = self.factors > level
            edges = np.flatnonzero(np.diff(above.astype(np.int8), prepend=0, append=0))
            lasting = (edges[1::2] - edges[::2]) * self.step >= duration
            moving.update(excursion[edges[::2][lasting]].tolist())
        return len(moving)


def series_of(law: Law, integral_time: float | None) -> Series | Events:
    """The series of a law, measured or generated, or its events. Raises SceneError without its time scales."""
    if isinstance(law, Events):
        return law
    if isinstance(law, Measured):
        return Series(*law.even)
    if law.microscale is None or integral_time is None:
        why = "is missing, which determines the duration of gusts; give it and gusts.microscale"
        raise SceneError(f"gusts.integral_time: {why}")
    if integral_time < math.sqrt(2.0) * law.microscale:
        why = f"is {integral_time:.3g}, less than the microscale {law.microscale:.3g} times the square root of two"
        raise SceneError(f"gusts.integral_time: {why}; give both as numbers, or no gusts that last")
    step = law.microscale / PER_MICROSCALE
    count = int(min(LENGTH * integral_time / step, MOST_POINTS))
    root = math.sqrt(max(integral_time**2 - 2.0 * law.microscale**2, 0.0))
    squares = (2.0 * np.pi * np.fft.rfftfreq(count, step)) ** 2
    first, second = (
        1.0 + squares * (0.5 * (integral_time + sign * root)) ** 2 for sign in (1.0, -1.0)
    )
    spectrum = 1.0 / (first * second)
    spectrum[0] = 0.0
    noise = np.random.default_rng(SEED).standard_normal((2, len(spectrum)))
    values = np.fft.irfft(np.sqrt(spectrum) * (noise[0] + 1j * noise[1]), count)
    return Series(law.factor(values * math.sqrt(count**2 / (4.0 * spectrum.sum()))), step)


@dataclass(frozen=True)
class RateOfLasting:
    """Rate of gusts that last long enough; low, high: from their errors and their number in the series."""

    rate: float
    low: float
    high: float

    def words(self) -> str:
        return f"{self.rate:.3g} ({self.low:.2g} to {self.high:.2g}) of them long enough"


def rate_of_lasting(
    series: Series | Events, weakest: WeakestGusts, strength: float
) -> RateOfLasting:
    """The rate in a mean flow of a strength over the scene's."""
    counts = []
    for sign in (0.0, -1.0, 1.0):
        levels, durations = weakest.needed(sign)
        static = min(weakest.static, float(levels[0]))
        counts.append(series.moving(levels / strength, durations, static / strength))
    low, high = min(counts), max(counts)
    least, most = max(low - math.sqrt(low), 0.0), high + math.sqrt(high) if high else NO_EVENT
    return RateOfLasting(*(count / series.duration for count in (counts[0], least, most)))

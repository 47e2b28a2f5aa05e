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
from scipy.stats import norm

from ..arrays import NO_EVENT, Floats
from ..errors import SceneError

SHORTEST = 20.0  # least duration of a series, in integral times
PIECES = 4  # of constant factor between two points of a series
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

    def spread(self, probability: float) -> float:
        return 0.0


@dataclass(frozen=True, eq=False)
class Record:
    """The law of a factor that is constant over successive pieces of time: a series, or counted gusts.

    factors, lengths: (n,) factor on the mean velocity and duration of each piece; zero where nothing moves
    independent: number of independent samples
    known_range: of probabilities whose levels are known
    name, words: of the data, and what is assumed of it
    """

    factors: Floats
    lengths: Floats
    independent: float = math.inf
    known_range: tuple[float, float] = (0.0, 1.0)
    name: str = "series"
    words: str = ""

    @cached_property
    def duration(self) -> float:
        return float(self.lengths.sum())

    @cached_property
    def _sorted(self) -> tuple[Floats, Floats]:
        """Fractions of time (n,) with at least a factor, and these factors, the largest first."""
        order = np.argsort(-self.factors, kind="stable")
        return np.cumsum(self.lengths[order]) / self.duration, self.factors[order]

    def exceeded(self, level: float) -> float:
        return float(self.lengths[self.factors > level].sum()) / self.duration

    def level(self, probability: float) -> float:
        """Level exceeded with a probability. Raises SceneError outside the known range."""
        least, most = self.known_range
        if not least <= probability <= most:
            outside = f"is outside the range of the {self.name}, {least:.2g} to {most:.2g}"
            raise SceneError(
                f"gusts.points: probability {probability:g} {outside}; "
                "give a longer record, or a law"
            )
        return float(np.interp(probability, *self._sorted))

    def upcrossings(self, level: float) -> float:
        above = self.factors > level
        return float(np.count_nonzero(above[1:] & ~above[:-1])) / self.duration

    def spread(self, probability: float) -> float:
        """Standard error of a fraction of the time."""
        if not 0.0 < probability < 1.0:
            return NO_EVENT / self.independent
        return math.sqrt(probability * (1.0 - probability) / self.independent)

    def moving(self, levels: Floats, durations: Floats, static: float) -> int:
        """Number of excursions above `static` that exceed one of the levels for its duration."""
        above, times = self.factors > static, np.append(0.0, np.cumsum(self.lengths))
        excursion, moving = np.cumsum(np.diff(above, prepend=False) & above), set[int]()
        for level, duration in zip(levels, durations, strict=True):
            edges = np.flatnonzero(np.diff(self.factors > level, prepend=False, append=False))
            lasting = times[edges[1::2]] - times[edges[::2]] >= duration * (1.0 - 1e-9)
            moving.update(excursion[edges[::2][lasting]].tolist())
        return len(moving)


def measured(points: Floats, integral_time: float | None) -> Record:
    """The record of a series of times and velocities, linear in between.

    integral_time: of its correlation; None: computed, up to the first zero of the correlation

    Raises SceneError for a series that is too short for its integral time.
    """
    times, speeds = points.T
    duration = float(times[-1] - times[0])
    factors = speeds / (trapezoid(speeds, times) / duration)
    integral = _integral_time(times, factors) if integral_time is None else integral_time
    if duration < SHORTEST * integral:
        raise SceneError(
            f"gusts.points: the series lasts {duration:.4g}, less than {SHORTEST:g} times its "
            f"integral time {integral:.4g}; give a longer one"
        )
    middles = (np.arange(PIECES) + 0.5) / PIECES
    intensity = math.sqrt(trapezoid((factors - 1.0) ** 2, times) / duration)
    independent = duration / (2.0 * integral)
    samples = f"integral time {integral:.3g}, {independent:.0f} samples"
    return Record(
        (factors[:-1, None] + np.diff(factors)[:, None] * middles).ravel(),
        np.repeat(np.diff(times) / PIECES, PIECES),
        independent,
        (1.0 / independent, 1.0 - 1.0 / independent),
        words="the velocity over its mean follows the series in all mean flows: "
        f"intensity {intensity:.3g}, {samples}",
    )


def _integral_time(times: Floats, factors: Floats) -> float:
    even, step = np.linspace(times[0], times[-1], len(times), retstep=True)
    fluctuation = np.interp(even, times, factors) - 1.0
    spectrum = np.abs(np.fft.rfft(fluctuation, 2 * len(even))) ** 2
    correlation = np.fft.irfft(spectrum)[: len(even)] / np.arange(len(even), 0, -1)
    below = np.flatnonzero(correlation <= 0.0)
    kept = correlation[: below[0] if len(below) else None] / correlation[0]
    return float(step * (kept.sum() - 0.5))


def events(points: Floats, duration: float) -> Record:
    """The record of gusts of constant strength, counted in a duration, without motion in between."""
    strengths, lengths = points[np.argsort(-points[:, 0], kind="stable")].T
    known = np.cumsum(lengths)
    # A Poisson number of lengths has the variance of the sum of their squares.
    lasting = float((np.cumsum(lengths**2) / known).max())
    still = (duration - known[-1]) / len(points)
    return Record(
        np.column_stack([np.zeros(len(points)), strengths]).ravel(),
        np.column_stack([np.full(len(points), still), lengths]).ravel(),
        duration / lasting,
        (float(known[0] / duration), float(known[-1] / duration)),
        "events",
        "the gusts relative to the mean velocity are those counted, in all mean flows: "
        f"{len(points)} in a time of {duration:g}, without motion between them",
    )


Law = Gaussian | Record


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
    def of(cls, stored: Any) -> WeakestGusts:
        """Parse the content of a gusts.json. Raises SceneError for less than two durations or other content."""
        try:
            points, static = stored["points"], float(stored["static"])
            known = all(point["error"] is not None for point in points)
            rows = [
                [float(point["duration"]), float(point["strength"]), float(point["error"] or 0.0)]
                for point in points
            ]
        except (KeyError, TypeError, ValueError):
            raise _refused(
                "holds no gusts with a threshold of steady flow; repeat incipient gust"
            ) from None
        if len(rows) < 2:
            raise _refused(
                "has fewer than two durations; search more with incipient gust --durations"
            )
        durations, strengths, errors = np.array(sorted(rows)).T
        if not (durations > 0.0).all() or not (strengths > errors).all():
            raise _refused("has a strength within its error; repeat incipient gust")
        return cls(durations, strengths, errors, static, known)

    def require_of(self, critical: float) -> None:
        if not critical / DIFFERENT < self.static < critical * DIFFERENT:
            raise _refused(
                f"there a steady flow moves the grain from {self.static:.3g} on, here from {critical:.3g}; "
                "search gusts of this scene with incipient gust"
            )

    def notes(self) -> list[str]:
        shortest, longest = self.durations[[0, -1]]
        unsearched = (
            f"gusts shorter than {shortest:g} and longer than {longest:g}, which were not searched, count only in the "
            "upper ends of the rates of lasting gusts"
        )
        unknown = "ranges of the rates of lasting gusts exclude errors of the weakest gusts, which have no error bars"
        return [unsearched] if self.known else [unsearched, unknown]

    def needed(self, sign: float = 0.0) -> tuple[Floats, Floats]:
        """Strengths (m,), shifted by `sign` times their errors, and their durations (m,)."""
        strengths = self.strengths + sign * self.errors
        order = np.argsort(strengths)
        levels = np.geomspace(strengths.min(), strengths.max(), 40)
        logarithms = np.log(strengths[order]), np.log(self.durations[order])
        return levels, np.exp(np.interp(np.log(levels), *logarithms))


def _refused(why: str) -> SceneError:
    return SceneError(f"gusts.json: {why}")


def record_of(law: Law, integral_time: float | None) -> Record:
    """The record of a law, given or generated. Raises SceneError without its time scales."""
    if isinstance(law, Record):
        return law
    if law.microscale is None or integral_time is None:
        raise SceneError(
            "gusts.integral_time: is missing, which determines the duration of gusts; "
            "give it and gusts.microscale"
        )
    step = law.microscale / 16
    # 20,000 integral times, if memory allows.
    count = int(min(20_000.0 * integral_time / step, 4_000_000))
    root = math.sqrt(max(integral_time**2 - 2.0 * law.microscale**2, 0.0))
    squares = (2.0 * np.pi * np.fft.rfftfreq(count, step)) ** 2
    first, second = (
        1.0 + squares * (0.5 * (integral_time + sign * root)) ** 2 for sign in (1.0, -1.0)
    )
    spectrum = 1.0 / (first * second)
    spectrum[0] = 0.0
    noise = np.random.default_rng(7).standard_normal((2, len(spectrum)))
    values = np.fft.irfft(np.sqrt(spectrum) * (noise[0] + 1j * noise[1]), count)
    factors = law.factor(values * math.sqrt(count**2 / (4.0 * spectrum.sum())))
    return Record(factors, np.full(count, step))


@dataclass(frozen=True)
class RateOfLasting:
    """Rate of gusts that last long enough; low, high: from their errors, their number, and durations not searched."""

    rate: float
    low: float
    high: float

    def words(self) -> str:
        return f"{self.rate:.3g} ({self.low:.2g} to {self.high:.2g}) of them long enough"


def rate_of_lasting(record: Record, weakest: WeakestGusts, strength: float) -> RateOfLasting:
    """The rate in a mean flow of a strength over the scene's."""
    counts = []
    for sign in (0.0, -1.0, 1.0):
        levels, durations = weakest.needed(sign)
        static = min(weakest.static, float(levels[0]))
        if sign < 0.0:  # shorter or longer gusts than those searched may also move the grain
            levels = np.append(levels, [levels[-1], static])
            durations = np.append(durations, [0.0, durations[0]])
        counts.append(record.moving(levels / strength, durations, static / strength))
    low, high = min(counts), max(counts)
    least, most = max(low - math.sqrt(low), 0.0), high + math.sqrt(high) if high else NO_EVENT
    return RateOfLasting(*(count / record.duration for count in (counts[0], least, most)))

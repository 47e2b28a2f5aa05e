"""Gusts that last long enough to move a grain out of its pocket, in a series of the factor of the velocity.

Such a gust exceeds a strength for the duration of the weakest gust of that strength (`gusts`). Gaussian series have the
correlation (T1 exp(-t/T1) - T2 exp(-t/T2))/(T1 - T2), of integral time T1 + T2 and microscale sqrt(2 T1 T2) (Sawford
1991, Phys. Fluids A 3, 1577).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import NO_EVENT, Floats
from ..errors import SceneError
from .laws import Events, Law, Measured

PER_MICROSCALE = 16  # points of a generated series
MOST_POINTS = 4_000_000
LENGTH = 20_000.0  # of a generated series, in integral times
LEVELS = 40  # strengths at which the curve of weakest gusts is sampled
SEED = 7
DIFFERENT = 1.25  # least ratio of the critical steady flows of different scenes


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

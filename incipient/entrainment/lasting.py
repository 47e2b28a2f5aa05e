"""Gusts that last long enough to move a grain out of its pocket, in a series of the factor of the velocity.

A gust moves it if the velocity stays above a strength for as long as the weakest gust of that strength has to last
(`critical.gusts`). Series of Gaussian laws are made by their spectrum: the correlation of y is
(T1 exp(-t/T1) - T2 exp(-t/T2))/(T1 - T2), with the integral time T1 + T2 and the microscale sqrt(2 T1 T2)
(Sawford 1991, Phys. Fluids A 3, 1577).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Floats
from ..errors import SceneError
from .laws import NONE_FOUND, Events, Law, Measured

PER_MICROSCALE = 16  # points of a series that is made
MOST_POINTS = 4_000_000
LENGTH = 20_000.0  # of it, in integral times
LEVELS = 40  # strengths between those of the curve
SEED = 7
DIFFERENT = (
    1.25  # factor between critical steady flows from which on they are those of different scenes
)


@dataclass(frozen=True, eq=False)
class WeakestGusts:
    """Strengths of the weakest gusts that move a grain out of its pocket, by their duration.

    durations, strengths, errors: (n,) the shortest first; of strengths over the flow of the scene
    static: strength from which a steady flow moves it
    known:  whether all errors are; those that are not are zero
    """

    durations: Floats
    strengths: Floats
    errors: Floats
    static: float
    known: bool = True

    @classmethod
    def of(cls, stored: dict[str, Any]) -> WeakestGusts:
        """Reads them from what a gusts.json holds.

        Raises SceneError where it has less than two durations, or holds something else.
        """
        try:
            errors = [one["error"] for one in stored["points"]]
            rows = [
                [
                    float(one["duration"]),
                    float(one["strength"]),
                    0.0 if error is None else float(error),
                ]
                for one, error in zip(stored["points"], errors, strict=True)
            ]
            static = float(stored["static"])
        except (KeyError, TypeError, ValueError):
            raise SceneError(
                "gusts.json: holds no gusts; search them anew with incipient gust"
            ) from None
        if len(rows) < 2:
            raise SceneError(
                "gusts.json: has less than two durations; search more with incipient gust --durations"
            )
        durations, strengths, found = np.array(sorted(rows)).T
        if not (durations > 0.0).all() or not (strengths > found).all():
            raise SceneError(
                "gusts.json: has a strength within its error; search it anew with incipient gust"
            )
        return cls(durations, strengths, found, static, None not in errors)

    def require_of(self, critical: float) -> None:
        """Raise SceneError where they are those of a flow that moves the grain at another strength than `critical`."""
        if not critical / DIFFERENT < self.static < critical * DIFFERENT:
            why = f"there a steady flow moves the grain from {self.static:.3g} on, here from {critical:.3g}"
            raise SceneError(f"gusts.json: {why}; search gusts of this scene with incipient gust")

    def needed(self, sign: float = 0.0) -> tuple[Floats, Floats]:
        """Strengths (m,), larger ones in proportion to their errors by `sign`, and how long each has to last (m,)."""
        strengths = self.strengths + sign * self.errors
        low, high = float(strengths.min()), float(strengths.max())
        levels = np.geomspace(low, high, LEVELS)
        order = np.argsort(strengths)
        durations = np.exp(
            np.interp(np.log(levels), np.log(strengths[order]), np.log(self.durations[order]))
        )
        return levels, durations


@dataclass(frozen=True, eq=False)
class Course:
    """A series of the factor at times that are equally far apart, straight in between."""

    factors: Floats
    step: float

    @classmethod
    def of(cls, law: Law, integral_time: float | None) -> Course | Events:
        """The series of a law, measured or made, or the events; raises SceneError where its times are not known."""
        if isinstance(law, Events):
            return law
        if isinstance(law, Measured):
            count = len(law.times)
            even = np.linspace(law.times[0], law.times[-1], count)
            return cls(np.interp(even, law.times, law.factors), law.duration / (count - 1))
        if law.microscale is None or integral_time is None:
            raise SceneError(
                "gusts.integral_time: is missing, by which gusts last; give it and gusts.microscale"
            )
        if integral_time < math.sqrt(2.0) * law.microscale:
            why = f"is {integral_time:.3g}, less than the microscale {law.microscale:.3g} times the square root of two"
            raise SceneError(
                f"gusts.integral_time: {why}; give both as numbers, or no gusts that last"
            )
        step = law.microscale / PER_MICROSCALE
        count = int(min(LENGTH * integral_time / step, MOST_POINTS))
        return cls(law.factor(_gaussian_series(count, step, integral_time, law.microscale)), step)

    @property
    def duration(self) -> float:
        """How long it is."""
        return self.step * (len(self.factors) - 1)

    def moving(self, levels: Floats, durations: Floats, static: float) -> int:
        """Number of excursions above `static` that stay above one of the levels as long as its duration."""
        excursion = np.cumsum(
            np.diff(self.factors > static, prepend=False) & (self.factors > static)
        )
        found: set[int] = set()
        for level, duration in zip(levels, durations, strict=True):
            above = self.factors > level
            edges = np.flatnonzero(np.diff(above.astype(np.int8), prepend=0, append=0))
            starts, ends = edges[::2], edges[1::2]
            lasting = (ends - starts) * self.step >= duration
            found.update(excursion[starts[lasting]].tolist())
        return len(found)


@dataclass(frozen=True)
class RateOfLasting:
    """How often a gust comes in unit time that lasts long enough.

    rate: in the series; low, high: by the errors of the weakest gusts and the number of gusts that were found
    """

    rate: float
    low: float
    high: float

    def words(self) -> str:
        """Rate and range for a reader."""
        return f"{self.rate:.3g} ({self.low:.2g} to {self.high:.2g}) of them long enough"


def rate_of_lasting(
    course: Course | Events, weakest: WeakestGusts, strength: float
) -> RateOfLasting:
    """The rate in a mean flow of a strength over the scene's. Not collective."""
    counts = []
    for sign in (0.0, -1.0, 1.0):
        levels, durations = weakest.needed(sign)
        static = min(weakest.static, float(levels[0]))
        counts.append(course.moving(levels / strength, durations, static / strength))
    low, high = min(counts), max(counts)
    least, most = max(low - math.sqrt(low), 0.0), high + math.sqrt(high) if high else NONE_FOUND
    return RateOfLasting(*(one / course.duration for one in (counts[0], least, most)))


def _gaussian_series(count: int, step: float, integral_time: float, microscale: float) -> Floats:
    """(count,) values of variance one of the process with the given times, the same in each call."""
    root = math.sqrt(max(integral_time**2 - 2.0 * microscale**2, 0.0))
    times = [0.5 * (integral_time + sign * root) for sign in (1.0, -1.0)]
    angular = 2.0 * np.pi * np.fft.rfftfreq(count, step)
    spectrum = 1.0 / ((1.0 + (angular * times[0]) ** 2) * (1.0 + (angular * times[1]) ** 2))
    spectrum[0] = 0.0
    noise = np.random.default_rng(SEED).standard_normal((2, len(angular)))
    values = np.fft.irfft(np.sqrt(spectrum) * (noise[0] + 1j * noise[1]), count)
    return np.asarray(values * math.sqrt(count**2 / (4.0 * spectrum.sum())))

"""The sections [flow.gust] and [gusts], the latter for `incipient entrainment`."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np

from .points import FromFile, file_key
from .section import NotNegative, Pairs, Positive, Rule, key, rises

RISE = 0.1  # of the duration: default rise and fall time of a top-hat
# Laws of data, and the least number of points of a series, and of gusts that were counted.
FEWEST = {"measured": 100, "events": 20}
GIVEN = (*FEWEST,)
NEAR_WALL, MODEL = "near-wall", "model"
ENDLESS = (
    "is given without microscale: an exponential correlation, whose upcrossings are infinitely many",
    "also give gusts.microscale",
)


class Gust(FromFile):
    """Factor on the flow over time: 1 before and after the gust, `strength` at its maximum."""

    may_be_absent = True
    rules = (
        Rule("file", lambda s: s.shape == "points" and not s.points,
             "neither file nor points is given", "give one of them"),
        Rule("points", lambda s: s.shape == "points" and (len(s.points) < 2 or not rises(s.points)),
             "are fewer than two, or their times do not increase", "give two or more, sorted by time, or a file"),
        Rule("points", lambda s: s.shape != "points" and s.points,
             'are not read with shape = "{s.shape}"', 'set shape = "points"'),
        Rule("rise", lambda s: s.rise is not None and s.shape != "top-hat",
             'is read only with shape = "top-hat"', "leave it out"),
        Rule("rise", lambda s: s.rise is not None and s.rise > s.duration,
             "is {s.rise:g}, more than the duration", "reduce it"),
    )  # fmt: skip

    shape: Literal["top-hat", "cosine", "points"] = key(
        "Shape over time: a plateau with smooth ramps, a raised cosine, or given points",
        "top-hat",
    )
    start: NotNegative = key("Start of the gust [time]", 0.0)
    duration: Positive = key(
        "Duration; of a top-hat from the start of its rise to the start of its fall [time]", 1.0
    )
    strength: NotNegative = key("Maximum of the factor on the flow [-]", 2.0)
    rise: Positive | None = key(
        "Rise and fall time of a top-hat; default: a tenth of the duration [time]",
        None,
        examples=[0.1],
    )
    file: str | None = file_key("CSV file of time, factor,", "points", "gust.csv")
    points: Pairs = key(
        'With shape = "points": time after the start and factor, linear in between [time, -]', ()
    )

    @property
    def rising(self) -> float:
        return RISE * self.duration if self.rise is None else self.rise

    def knots(self) -> np.ndarray:
        if self.shape == "points":
            return self.start + np.array([time for time, _ in self.points])
        whole = self.duration + (self.rising if self.shape == "top-hat" else 0.0)
        sides = np.concatenate([[0.0, 1.0], np.linspace(0.0, self.rising / whole, 5)])
        return self.start + whole * np.unique(
            np.concatenate([sides, 1.0 - sides, np.linspace(0.0, 1.0, 9)])
        )

    def factor(self, time: float) -> float:
        since = time - self.start
        if self.shape == "points":
            times, factors = zip(*self.points, strict=True)
            return float(np.interp(since, times, factors))
        return 1.0 + (self.strength - 1.0) * self._height(since)

    def _height(self, since: float) -> float:
        if self.shape == "cosine":
            return (
                0.5 - 0.5 * math.cos(2.0 * math.pi * since / self.duration)
                if 0.0 < since < self.duration
                else 0.0
            )
        return _smooth(since / self.rising) - _smooth((since - self.duration) / self.rising)


def _smooth(share: float) -> float:
    return 0.5 - 0.5 * math.cos(math.pi * min(max(share, 0.0), 1.0))


def _of_data(s: Any) -> list[str]:
    keys = ("intensity", "microscale", *(("integral_time",) if s.law == "events" else ()))
    return [key for key in keys if s.law in GIVEN and getattr(s, key) is not None][:1]


def _flat(s: Any) -> bool:
    speeds = [speed for _, speed in s.points]
    return s.law == "measured" and (not math.fsum(speeds) > 0.0 or min(speeds) == max(speeds))


def _too_short(s: Any) -> bool:
    return (
        None not in (s.integral_time, s.microscale)
        and s.integral_time < math.sqrt(2.0) * s.microscale
    )


class Gusts(FromFile):
    """Random factor with mean 1 on the velocity at the grain."""

    fewest, may_be_absent = 1, True
    rules = (
        Rule("points", lambda s: s.law not in GIVEN and s.points,
             'are not read with law = "{s.law}"', 'set law = "measured" or "events"'),
        Rule("intensity", lambda s: s.law not in GIVEN and s.intensity is None,
             "is missing", 'give a number, "near-wall" or "model"'),
        Rule("{v}", _of_data, 'follows from the data with law = "{s.law}"', "leave it out"),
        Rule("points", lambda s: s.law in GIVEN and len(s.points) < FEWEST[s.law] and (len(s.points), FEWEST[s.law]),
             "are {v[0]}", "give {v[1]} or more, or a file"),
        Rule("points", lambda s: s.law == "events" and min(map(min, s.points)) <= 0.0,
             "have a strength or duration that is not above zero", "leave it out"),
        Rule("record", lambda s: s.law == "events" and s.record is None,
             "is missing: the duration in which the events were counted", "give it"),
        Rule("record", lambda s: s.law != "events" and s.record is not None,
             'is read only with law = "events"', "leave it out"),
        Rule("record",
             lambda s: s.record is not None and (total := math.fsum(d for _, d in s.points)) > s.record and total,
             "is {s.record:g}, less than the total duration of the events, {v:g}",
             "enlarge it, or merge events that overlap"),
        Rule("points", lambda s: s.law == "measured" and not rises(s.points),
             "their times do not increase", "sort them by time, each once"),
        Rule("points", _flat, "have no mean above zero, or no fluctuation", "give velocities downstream"),
        Rule("depth", lambda s: s.depth is not None and s.intensity != NEAR_WALL,
             'is read only with intensity = "near-wall"', "leave it out"),
        Rule("integral_time", lambda s: s.law not in GIVEN and s.integral_time is not None and s.microscale is None,
             *ENDLESS),
        Rule("integral_time", lambda s: s.law not in GIVEN and _too_short(s),
             "is {s.integral_time:g}, less than the microscale times the square root of two",
             "enlarge it, or reduce gusts.microscale"),
    )  # fmt: skip

    law: Literal["lognormal", "normal", "measured", "events"] = key(
        "Distribution of the factor; measured: of a time series; events: of counted gusts",
        "lognormal",
    )
    intensity: Positive | Literal["near-wall", "model"] | None = key(
        "Turbulence intensity relative to the mean velocity at the grain [-]; near-wall: from a law of the wall "
        "region; model: from k of the inflow",
        None,
        examples=[0.3],
    )
    depth: Positive | None = key(
        'Depth of the flow, for intensity = "near-wall"; default: much larger than the grain [length]',
        None,
        examples=[20.0],
    )
    microscale: Positive | None = key(
        "Microscale lambda of the correlation 1 - (t/lambda)^2 at short times, for rates [time]",
        None,
        examples=[0.5],
    )
    integral_time: Positive | None = key(
        "Integral time scale, for gusts that last long enough; a measured series has its own [time]",
        None,
        examples=[2.0],
    )
    record: Positive | None = key(
        'With law = "events": duration of the record [time]', None, examples=[600.0]
    )
    file: str | None = file_key(
        "CSV file of time, velocity, or of strength, duration,", "points", "velocity.csv"
    )
    points: Pairs = key(
        'With law = "measured": time and velocity at the grain, in any unit [time, -]; with "events": velocity over '
        "its mean, and duration of the gust [-, time]",
        (),
    )

"""The section [flow.gust]."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from .points import FromFile, file_key
from .section import NotNegative, Pairs, Positive, Rule, key, rises

RISE = 0.1  # of the duration: default rise and fall time of a top-hat


class Gust(FromFile):
    """Factor on the flow over time: 1 before and after the gust, `strength` at its maximum."""

    may_be_absent = True
    rules = (
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

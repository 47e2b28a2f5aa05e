"""A gust: a factor of the time that multiplies the base flow."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from .points import file_key, read_points, with_file_read
from .section import NotNegative, Pair, Positive, Section, key

RISE = 0.1  # of the duration: the time in which a top-hat rises, and falls, where none is given


class Gust(Section):
    """A factor that multiplies the flow in time: 1 before and after a gust, `strength` in it."""

    shape: Literal["top-hat", "cosine", "points"] = key(
        "Course in time: a plateau with smooth sides, half a cosine wave, or given points",
        "top-hat",
    )
    start: NotNegative = key("Time at which the gust begins [time]", 0.0)
    duration: Positive = key(
        "Duration; of a top-hat from the start of its rise to that of its fall [time]", 1.0
    )
    strength: NotNegative = key("Largest factor of the flow, relative to the flow without [-]", 2.0)
    rise: Positive | None = key(
        "Time in which a top-hat rises, and in which it falls; by default a tenth of the duration [time]",
        None,
        examples=[0.1],
    )
    file: str | None = file_key("CSV file of time, factor,", "points", "gust.csv")
    points: Annotated[tuple[Pair, ...], Field(strict=False)] = key(
        'With shape = "points": time after the start and factor, straight between [time, -]', ()
    )

    @model_validator(mode="before")
    @classmethod
    def _read(cls, data: Any, info: ValidationInfo) -> Any:
        """Replace the file by its points."""
        if not isinstance(data, dict) or data.get("shape") != "points":
            return data
        return with_file_read(
            "Gust", "points", data, info, lambda path: {"points": _course(path)}, "give one of them"
        )

    @model_validator(mode="after")
    def _is_whole(self) -> Gust:
        if self.shape == "points":
            times = [time for time, _ in self.points]
            if len(times) < 2 or any(later <= earlier for earlier, later in pairwise(times)):
                raise self.refused(
                    "points", "their times do not rise", "give two or more, one after the other"
                )
        elif self.points:
            raise self.refused(
                "points", f'are not read with shape = "{self.shape}"', 'set shape = "points"'
            )
        if self.rise is not None and (self.shape != "top-hat" or self.rise > self.duration):
            why = (
                f"is {self.rise:g}, more than the duration"
                if self.shape == "top-hat"
                else 'is read only with shape = "top-hat"'
            )
            raise self.refused("rise", why, "reduce it or leave it out")
        return self

    @property
    def rising(self) -> float:
        """The time in which a top-hat rises."""
        return RISE * self.duration if self.rise is None else self.rise

    def knots(self) -> np.ndarray:
        """Times (n,) that show its whole course."""
        if self.shape == "points":
            return self.start + np.array([time for time, _ in self.points])
        whole = self.duration + (self.rising if self.shape == "top-hat" else 0.0)
        sides = np.concatenate([[0.0, 1.0], np.linspace(0.0, self.rising / whole, 5)])
        return self.start + whole * np.unique(
            np.concatenate([sides, 1.0 - sides, np.linspace(0.0, 1.0, 9)])
        )

    def factor(self, time: float) -> float:
        """What the flow is multiplied by at a time."""
        since = time - self.start
        if self.shape == "points":
            times, factors = zip(*self.points, strict=True)
            return float(np.interp(since, times, factors))
        return 1.0 + (self.strength - 1.0) * self._height(since)

    def _height(self, since: float) -> float:
        """Between 0 before and after, and 1 at its highest."""
        if self.shape == "cosine":
            return (
                0.5 - 0.5 * math.cos(2.0 * math.pi * since / self.duration)
                if 0.0 < since < self.duration
                else 0.0
            )
        return _smooth(since / self.rising) - _smooth((since - self.duration) / self.rising)


def _smooth(share: float) -> float:
    """A smooth rise from 0 to 1 between 0 and 1, level at both ends."""
    return 0.5 - 0.5 * math.cos(math.pi * min(max(share, 0.0), 1.0))


def _course(path: Path) -> list[Any]:
    return read_points(path, 2, "Gust")

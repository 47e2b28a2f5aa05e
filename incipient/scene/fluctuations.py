"""Velocity fluctuations about the mean, for the probability that a grain moves: `incipient entrainment`."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from .messages import either, shown
from .points import file_key, read_points, with_file_read
from .section import SMALLEST, Pair, Positive, Section, contradiction, is_number, key

FEWEST, FEWEST_EVENTS = 100, 20  # points of a measured series; gusts that were counted
GIVEN = ("measured", "events")  # laws of data
NEAR_WALL, MODEL = "near-wall", "model"
ENDLESS = (
    "is given without microscale: an exponential correlation, whose upcrossings are infinitely many",
    "give gusts.microscale, too",
)


class Gusts(Section):
    """A random factor, of mean one, that multiplies the velocity at the grain."""

    law: Literal["lognormal", "normal", "measured", "events"] = key(
        "Distribution of the factor; measured: that of a series; events: of gusts that were counted",
        "lognormal",
    )
    intensity: Positive | Literal["near-wall", "model"] | None = key(
        "Root mean square of the velocity's fluctuation over its mean at the grain [-]; near-wall: by a law of the "
        "wall region; model: by the inflow's k",
        None,
        examples=[0.3],
    )
    depth: Positive | None = key(
        'Depth of the flow, for intensity = "near-wall"; by default much more than the grain\'s size [length]',
        None,
        examples=[20.0],
    )
    microscale: Positive | Literal["model"] | None = key(
        "Time lambda of the correlation 1 - (t/lambda)^2 at short times, for rates [time]; model: by the inflow",
        None,
        examples=[0.5],
    )
    integral_time: Positive | Literal["model"] | None = key(
        "Integral of the correlation over time, for gusts that have to last; a measured series has its own [time]; "
        "model: by the inflow",
        None,
        examples=[2.0],
    )
    record: Positive | None = key(
        'With law = "events": duration of the record [time]', None, examples=[600.0]
    )
    file: str | None = file_key(
        "CSV file of time, velocity, or of strength, duration,", "points", "velocity.csv"
    )
    points: Annotated[tuple[Pair, ...], Field(strict=False)] = key(
        'With law = "measured": time and velocity at the grain, in any unit [time, -]; with "events": velocity over '
        "its mean, and how long it stayed as high [-, time]",
        (),
    )

    @field_validator("intensity", "microscale", "integral_time", mode="before")
    @classmethod
    def _is_a_size(cls, value: Any, info: ValidationInfo) -> Any:
        words = (NEAR_WALL, MODEL) if info.field_name == "intensity" else (MODEL,)
        if value is None or value in words or (is_number(value) and SMALLEST <= value < math.inf):
            return value
        raise contradiction(f"is {shown(value)}", f"give a number above zero, or {either(words)}")

    @model_validator(mode="before")
    @classmethod
    def _read(cls, data: Any, info: ValidationInfo) -> Any:
        """Replace the file by its points."""
        if not isinstance(data, dict) or data.get("law") not in GIVEN:
            return data
        return with_file_read("Gusts", "points", data, info, _series, "give one of them")

    @model_validator(mode="after")
    def _is_whole(self) -> Gusts:
        if self.law in GIVEN:
            self._check_data()
        elif self.points or self.file:
            raise self.refused(
                "points",
                f'are not read with law = "{self.law}"',
                'set law = "measured" or "events"',
            )
        elif self.intensity is None:
            raise self.refused("intensity", "is missing", 'give a number, "near-wall" or "model"')
        if (self.law == "events") != (self.record is not None):
            why, remedy = "is missing, the time in which the events came", "give it"
            if self.record is not None:
                why, remedy = 'is read only with law = "events"', "leave it out"
            raise self.refused("record", why, remedy)
        if self.depth is not None and self.intensity != NEAR_WALL:
            raise self.refused("depth", 'is read only with intensity = "near-wall"', "leave it out")
        if self.law not in GIVEN and self.integral_time is not None:
            self._check_times(self.integral_time)
        return self

    def _check_data(self) -> None:
        of_events = self.law == "events"
        for name in ("intensity", "microscale", *(("integral_time",) if of_events else ())):
            if getattr(self, name) is not None:
                raise self.refused(
                    name, f'is that of the data with law = "{self.law}"', "leave it out"
                )
        if self.integral_time == MODEL:
            raise self.refused(
                "integral_time", "is that of the series with a measured law", "leave it out"
            )
        if len(self.points) < (fewest := FEWEST_EVENTS if of_events else FEWEST):
            raise self.refused("points", f"are {len(self.points)}", f"give {fewest} or more")
        (self._check_events if of_events else self._check_series)()

    def _check_events(self) -> None:
        lasted = math.fsum(duration for _, duration in self.points)
        if min(map(min, self.points)) <= 0.0:
            raise self.refused(
                "points", "have a strength or duration that is not above zero", "leave it out"
            )
        if self.record is not None and lasted > self.record:
            why = f"is {self.record:g}, less than the {lasted:g} that the events last together"
            raise self.refused("record", why, "enlarge it, or merge events that overlap")

    def _check_series(self) -> None:
        times, speeds = zip(*self.points, strict=True)
        if any(later <= earlier for earlier, later in pairwise(times)):
            raise self.refused("points", "their times do not rise", "give one after the other")
        if not math.fsum(speeds) > 0.0 or min(speeds) == max(speeds):
            raise self.refused(
                "points", "have no mean above zero, or no fluctuation", "give velocities downstream"
            )

    def _check_times(self, integral: float | str) -> None:
        if self.microscale is None:
            raise self.refused("integral_time", *ENDLESS)
        if isinstance(integral, str) or isinstance(self.microscale, str):
            return
        if integral < math.sqrt(2.0) * self.microscale:
            why = f"is {integral:g}, less than the microscale times the square root of two"
            raise self.refused("integral_time", why, "enlarge it, or reduce gusts.microscale")


def _series(path: Path) -> dict[str, Any]:
    return {"points": read_points(path, 1, "Gusts")}

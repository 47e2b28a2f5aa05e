"""The section [gusts]: velocity fluctuations, for `incipient entrainment`."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator

from .messages import either
from .points import FromFile, file_key
from .section import SMALLEST, Pairs, Positive, Rule, allowed, is_number, key, rises

# Laws of data, and the least number of points of a series, and of gusts that were counted.
FEWEST = {"measured": 100, "events": 20}
GIVEN = (*FEWEST,)
NEAR_WALL, MODEL = "near-wall", "model"
ENDLESS = (
    "is given without microscale: an exponential correlation, whose upcrossings are infinitely many",
    "also give gusts.microscale",
)


def _size(*words: str) -> BeforeValidator:
    return allowed(
        lambda value: (
            value in (None, *words) or (is_number(value) and SMALLEST <= value < math.inf)
        ),
        f"give a number above zero, or {either(words)}",
    )


Intensity = Annotated[Positive | Literal["near-wall", "model"] | None, _size(NEAR_WALL, MODEL)]
ModelTime = Annotated[Positive | Literal["model"] | None, _size(MODEL)]


def _of_data(s: Any) -> list[str]:
    keys = ("intensity", "microscale", *(("integral_time",) if s.law == "events" else ()))
    return [key for key in keys if s.law in GIVEN and getattr(s, key) is not None][:1]


def _flat(s: Any) -> bool:
    speeds = [speed for _, speed in s.points]
    return s.law == "measured" and (not math.fsum(speeds) > 0.0 or min(speeds) == max(speeds))


def _too_short(s: Any) -> bool:
    times = (s.integral_time, s.microscale)
    return not any(isinstance(t, str) or t is None for t in times) and (
        s.integral_time < math.sqrt(2.0) * s.microscale
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
        Rule("integral_time", lambda s: s.law == "measured" and s.integral_time == MODEL,
             "follows from the series with a measured law", "leave it out"),
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
    intensity: Intensity = key(
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
    microscale: ModelTime = key(
        "Microscale lambda of the correlation 1 - (t/lambda)^2 at short times, for rates [time]; "
        "model: from the inflow",
        None,
        examples=[0.5],
    )
    integral_time: ModelTime = key(
        "Integral time scale, for gusts that last long enough; a measured series has its own [time]; "
        "model: from the inflow",
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

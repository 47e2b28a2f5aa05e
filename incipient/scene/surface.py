"""The section [surface]."""

from __future__ import annotations

from itertools import product
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from .domain import Domain
from .expression import Expression
from .points import FromFile, file_key
from .section import NotNegative, Pair, Pairs, Positive, Rule, Section, formula, key, rises

Station = float | Pair
FREE = "free-surface"


class Wave(Section):
    """Second-order Stokes wave that enters a channel with the base flow."""

    amplitude: Positive = key(
        "Amplitude of the first harmonic of the elevation, half of the wave's height [length]",
        examples=[0.01],
    )
    period: Positive = key("Period in the frame of the bed [time]", examples=[5.0])


class Surface(FromFile):
    """The free surface, at the top of the domain if at rest."""

    may_be_absent = True
    rules = (
        Rule("points", lambda s: s.points and s.elevation != "0",
             "are given with a formula for the elevation", "leave one of them out"),
        Rule("points", lambda s: len(s.points) == 1 or not rises(s.points),
             "do not increase in x", "give two or more points sorted by x, each x once"),
    )  # fmt: skip

    elevation: Annotated[str, formula("xy")] = key(
        "Formula in x, in 3-D also y: height above the still level [length]", "0"
    )
    file: str | None = file_key("CSV file of x, elevation", "points", "elevation.csv")
    points: Pairs = key(
        "In 2-D, instead of the formula: x and elevation, linear in between [length]", ()
    )
    stations: Annotated[tuple[Station, ...], Field(strict=False)] = key(
        "Positions x, in 3-D [x, y], of elevations in the history; default: a few",
        (),
    )
    bottom: Literal["no-slip", "slip"] = key("Level bottom, without [bed]", "no-slip")
    wave: Wave | None = key(
        "Wave that enters with the base flow",
        None,
        examples=[{"amplitude": 0.01, "period": 5.0}],
    )
    outflow: Literal["open", "wall"] = key(
        "Right end of a channel; open: still level beyond it; wall: closed", "open"
    )
    sponge: NotNegative = key(
        "Length of the sponge layer at the right end of a channel [length]", 0.0
    )

    @property
    def given(self) -> str:
        """The key of the elevation."""
        return "points" if self.points else "elevation"

    def height(self, x: np.ndarray) -> np.ndarray:
        if self.points:
            return np.interp(x[0], *np.transpose(self.points))
        return Expression(self.elevation)(x)

    def places(self) -> list[tuple[float, ...]]:
        return [station if isinstance(station, tuple) else (station,) for station in self.stations]


def stations_of(surface: Surface | None, domain: Domain) -> list[tuple[float, ...]]:
    """Positions of reported elevations; by default five from end to end, in 3-D three by three."""
    stations = () if surface is None else surface.places()
    along = 5 if domain.gdim == 2 else 3
    evenly = (
        [low + (high - low) * i / (along - 1) for i in range(along)] for low, high in domain.spans
    )
    return list(stations) or list(product(*evenly))

"""The free surface of a scene: the section [surface]."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from .domain import Domain
from .expression import Expression
from .points import FromFile, file_key, read_points
from .section import NotNegative, Pair, Positive, Rule, Section, formula, key, rises

Station = float | Annotated[tuple[float, float], Field(strict=False)]
FREE = "free-surface"


class Wave(Section):
    """A wave that a wave maker lets into a channel: Stokes's, of second order, on the base flow."""

    amplitude: Positive = key(
        "Amplitude of the first harmonic of the elevation, half of the wave's height [length]",
        examples=[0.01],
    )
    period: Positive = key("Period as seen from the bed [time]", examples=[5.0])


class Surface(FromFile):
    """The free surface, which at rest lies at the top of the domain."""

    rules = (
        Rule("points", lambda s: s.points and s.elevation != "0",
             "are given beside a formula for the elevation", "leave one of them out"),
        Rule("points", lambda s: len(s.points) == 1 or not rises(s.points),
             "do not ascend in x", "give two or more points sorted by x, each x once"),
    )  # fmt: skip

    elevation: Annotated[str, formula("xy")] = key(
        "Formula in x, in 3-D also y: height above the still level [length]", "0"
    )
    file: str | None = file_key("CSV file of x, elevation", "points", "elevation.csv")
    points: Annotated[tuple[Pair, ...], Field(strict=False)] = key(
        "In 2-D, instead of the formula: x and elevation, straight between [length]", ()
    )
    stations: Annotated[tuple[Station, ...], Field(strict=False)] = key(
        "Positions x, in 3-D [x, y], whose elevations are columns of the history; without: a few",
        (),
    )
    bottom: Literal["no-slip", "slip"] = key("A level bottom without [bed]", "no-slip")
    ends: Literal["wall", "no-slip"] = key(
        "wall: the fluid slides along both ends; no-slip: it sticks, the surface is pinned", "wall"
    )
    wave: Wave | None = key(
        "A wave that comes in with the base flow",
        None,
        examples=[{"amplitude": 0.01, "period": 5.0}],
    )
    outflow: Literal["open", "wall"] = key(
        "Right end of a channel; open: the still level lies beyond it; wall: it is closed", "open"
    )
    sponge: NotNegative = key(
        "Length before the right end of a channel in which waves die out [length]", 0.0
    )
    pressure: Annotated[str, formula("txy")] = key(
        "Formula in x, y and t: pressure above, over the fluid's density [length^2/time^2]", "0"
    )

    @classmethod
    def is_needed(cls, data: dict[str, Any]) -> bool:
        """At rest it is level."""
        return False

    @classmethod
    def read(cls, path: Path, data: dict[str, Any]) -> dict[str, Any]:
        """Places and elevations."""
        return {"points": read_points(path, 2, "Surface")}

    def height(self, x: np.ndarray) -> np.ndarray:
        """Elevations (n,) above the still level at time zero, at places (3, n). Not collective."""
        if self.points:
            return np.interp(x[0], *np.transpose(self.points))
        return Expression(self.elevation)(x)

    def places(self) -> list[tuple[float, ...]]:
        """The stations' horizontal coordinates."""
        return [one if isinstance(one, tuple) else (one,) for one in self.stations]


def stations_of(surface: Surface | None, domain: Domain) -> list[tuple[float, ...]]:
    """Positions of reported elevations: the stations; by default five from end to end, in 3-D three by three."""
    stations = () if surface is None else surface.places()
    along = 5 if domain.gdim == 2 else 3
    evenly = (
        [low + (high - low) * i / (along - 1) for i in range(along)] for low, high in domain.spans
    )
    return list(stations) or list(product(*evenly))

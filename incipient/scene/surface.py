"""The free surface of a scene: what a user writes about it."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from .domain import Domain
from .expression import Expression
from .points import read_points
from .section import NotNegative, Pair, Positive, Section, key, require_formula

Station = float | Annotated[tuple[float, float], Field(strict=False)]
_VARIABLES = {"elevation": "xy", "pressure": "txy"}
FREE = "free-surface"


class Wave(Section):
    """A wave that a wave maker lets into a channel: Stokes's, of second order, on the base flow."""

    amplitude: Positive = key(
        "Amplitude of the first harmonic of the elevation, half of the wave's height [length]",
        examples=[0.01],
    )
    period: Positive = key("Period as seen from the bed [time]", examples=[5.0])


class Surface(Section):
    """The free surface, which at rest lies at the top of the domain."""

    elevation: str = key("Formula in x, in 3-D also y: height above the still level [length]", "0")
    file: str | None = key(
        "CSV file of x, elevation relative to the scene; the resolved scene has points instead",
        None,
        examples=["elevation.csv"],
    )
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
    pressure: str = key(
        "Formula in x, y and t: pressure above, over the fluid's density [length^2/time^2]", "0"
    )

    @model_validator(mode="before")
    @classmethod
    def _read(cls, data: Any, info: ValidationInfo) -> Any:
        """Replace a file by its points, so that the scene no longer depends on where it was read."""
        if not isinstance(data, dict) or not isinstance(data.get("file"), str):
            return data
        path = Path((info.context or {}).get("directory", "."), data["file"])
        return {k: v for k, v in data.items() if k != "file"} | {
            "points": read_points(path, 2, "Surface")
        }

    @field_validator("elevation", "pressure")
    @classmethod
    def _is_a_formula(cls, text: str, info: ValidationInfo) -> str:
        require_formula(text, _VARIABLES[str(info.field_name)])
        return text

    @model_validator(mode="after")
    def _is_given_once(self) -> Surface:
        if self.points and self.elevation != "0":
            raise self.refused(
                "points", "are given beside a formula for the elevation", "leave one of them out"
            )
        rising = all(a[0] < b[0] for a, b in zip(self.points[:-1], self.points[1:], strict=True))
        if len(self.points) == 1 or not rising:
            raise self.refused(
                "points", "do not ascend in x", "give two or more points sorted by x, each x once"
            )
        return self

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
    given = () if surface is None else surface.places()
    along = 5 if domain.gdim == 2 else 3
    evenly = (
        [low + (high - low) * i / (along - 1) for i in range(along)] for low, high in domain.spans
    )
    return list(given) or list(product(*evenly))

"""SI units: the section [units] of a scene, and what one of the scene's units is (see `scaling`)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from ..arrays import SMALLEST
from .messages import either
from .section import Positive, Rule, Section, allowed, is_number, key

_ONE_LENGTH = 'give one of them, as in length = "mm"'
METRES = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0}


Length = Annotated[
    Literal["um", "mm", "cm", "m"] | Positive | None,
    allowed(
        lambda value: (
            value is None or value in METRES or (is_number(value) and SMALLEST <= value < math.inf)
        ),
        f"give metres above zero, or {either([*METRES])}",
    ),
]


class Units(Section):
    """What the scene's units are in SI; Reynolds number, gravity and the grain's density follow."""

    rules = (
        Rule("length", lambda s: s.length is not None and s.diameter is not None,
             "is given beside diameter", _ONE_LENGTH),
        Rule("length", lambda s: s.length is None and s.diameter is None,
             "is missing, and diameter as well", _ONE_LENGTH),
    )  # fmt: skip

    length: Length = key(
        "The scene's unit of length, also that of files of grain and bed; a number is in metres",
        None,
        examples=["mm"],
    )
    diameter: Positive | None = key(
        "Nominal diameter, if no length: of the sphere of the grain's volume, in 2-D of the disc of its area [m]",
        None,
        examples=[1e-3],
    )
    viscosity: Positive = key("Kinematic viscosity [m^2/s]", 1.0e-6)
    fluid_density: Positive = key("Density of the fluid [kg/m^3]", 1000.0)
    grain_density: Positive = key("Density of the grain [kg/m^3]", 2650.0)
    gravity: Positive = key("Gravitational acceleration [m/s^2]", 9.81)
    shear_rate: Positive | None = key("What flow.rate is [1/s]", None, examples=[1.0])
    velocity: Positive | None = key(
        "What flow.velocity is, of a log-law flow.shear_velocity [m/s]", None, examples=[0.01]
    )

    def metres(self, grain: Any) -> float:
        """What one of the scene's units of length is [m]."""
        if self.diameter is not None:
            return self.diameter / nominal_diameter(grain)
        return METRES[self.length] if isinstance(self.length, str) else float(self.length or 0.0)


@dataclass(frozen=True)
class Scales:
    """What one of the scene's units is in SI: length [m], time [s], density [kg/m^3]."""

    length: float
    time: float
    density: float
    gdim: int

    @property
    def velocity(self) -> float:
        """[m/s]."""
        return self.length / self.time

    @property
    def stress(self) -> float:
        """[Pa]."""
        return self.density * self.velocity**2

    @property
    def force(self) -> float:
        """[N], in 2-D [N/m]."""
        return self.stress * self.length ** (self.gdim - 1)

    @property
    def couple(self) -> float:
        """[N m], in 2-D [N]."""
        return self.force * self.length


def nominal_diameter(grain: Any) -> float:
    """The diameter [length] of the sphere of a grain's volume, in 2-D of the disc of its area."""
    if grain.gdim == 2:
        return math.sqrt(4.0 * grain.volume / math.pi)
    return float((6.0 * grain.volume / math.pi) ** (1.0 / 3.0))

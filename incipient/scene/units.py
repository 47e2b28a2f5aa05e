"""SI units: the section [units] of a scene, and what one of the scene's units is (see `scaling`)."""

import math
from dataclasses import dataclass
from typing import Any

from .section import Positive, Section, key


class Units(Section):
    """What the scene's units are in SI; Reynolds number, gravity and the grain's density follow."""

    diameter: Positive = key(
        "Nominal diameter: of the sphere of the grain's volume, in the plane the disc of its area [m]",
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
        """[N], in the plane [N/m]."""
        return self.stress * self.length ** (self.gdim - 1)

    @property
    def couple(self) -> float:
        """[N m], in the plane [N]."""
        return self.force * self.length


def nominal_diameter(grain: Any) -> float:
    """The diameter [length] of the sphere of a grain's volume, in the plane of the disc of its area."""
    if grain.gdim == 2:
        return math.sqrt(4.0 * grain.volume / math.pi)
    return float((6.0 * grain.volume / math.pi) ** (1.0 / 3.0))

"""The section [units], and the dimensionless scene that follows from it.

The unit of length L0 is `length`, or `diameter` over the grain's nominal diameter in scene units; of velocity V0 =
velocity / flow.velocity; of time, for shear flow, T0 = flow.rate / shear_rate, with L0 = V0 T0.

    Re = V L / nu,    gravity.acceleration = g T0^2 / L0,    body.density = rho_s / rho_f.

The unit of force is rho_f V0^2 L0^2, in 2-D rho_f V0^2 L0 per unit depth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from .section import Positive, Rule, Section, key

if TYPE_CHECKING:
    from .model import Scene

_ONE_LENGTH = 'give one of them, as in length = "mm"'
METRES = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0}


class Units(Section):
    """SI values of the scene's units; Reynolds number, gravity and the grain's density follow."""

    rules = (
        Rule("length", lambda s: s.length is not None and s.diameter is not None,
             "is given with diameter", _ONE_LENGTH),
        Rule("length", lambda s: s.length is None and s.diameter is None,
             "is missing, and diameter as well", _ONE_LENGTH),
    )  # fmt: skip

    length: Positive | Literal["um", "mm", "cm", "m"] | None = key(
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
    shear_rate: Positive | None = key("SI value of flow.rate [1/s]", None, examples=[1.0])
    velocity: Positive | None = key(
        "SI value of flow.velocity, for a log law of flow.shear_velocity [m/s]",
        None,
        examples=[0.01],
    )

    def metres(self, grain: Any) -> float:
        if self.diameter is not None:
            return self.diameter / nominal_diameter(grain)
        return METRES[self.length] if isinstance(self.length, str) else float(self.length or 0.0)


@dataclass(frozen=True)
class Scales:
    """SI values of the scene's units: length [m], time [s], density [kg/m^3]."""

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
    def torque(self) -> float:
        """[N m], in 2-D [N]."""
        return self.force * self.length


def nominal_diameter(grain: Any) -> float:
    """Diameter of the sphere of equal volume, in 2-D of the disc of equal area."""
    if grain.gdim == 2:
        return math.sqrt(4.0 * grain.volume / math.pi)
    return float((6.0 * grain.volume / math.pi) ** (1.0 / 3.0))


def scales_of(scene: Scene) -> Scales:
    """Scales of a scene with a grain and units."""
    units: Any = scene.units
    length, stated = units.metres(scene.grain), scene.flow.reference_velocity(1.0)
    speed = getattr(units, scene.flow.scaled_by)
    time = stated / speed if scene.flow.scaled_by == "shear_rate" else length * stated / speed
    return Scales(length, time, units.fluid_density, scene.gdim)


def derived(scene: Scene) -> dict[tuple[str, str], float]:
    """Values of a scene's keys (section, key) that follow from its units."""
    units: Any = scene.units
    scales, size = scales_of(scene), scene.reference_velocity * scene.reference_length
    return {
        ("fluid", "reynolds"): size * scales.velocity * scales.length / units.viscosity,
        ("gravity", "acceleration"): units.gravity * scales.time**2 / scales.length,
        ("body", "density"): units.grain_density / units.fluid_density,
    }

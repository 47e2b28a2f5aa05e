"""The section [units], and the dimensionless scene that follows from it.

The unit of length L0 is `length`, or `diameter` over the grain's nominal diameter in scene units; of velocity V0 =
velocity / flow.velocity; of time, for shear flow, T0 = flow.rate / shear_rate, with L0 = V0 T0.

    Re = V L / nu,    gravity.acceleration = g T0^2 / L0,    body.density = rho_s / rho_f.

The unit of force is rho_f V0^2 L0^2, in 2-D rho_f V0^2 L0 per unit depth.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import ValidationError

from ..arrays import SMALLEST
from .messages import either, problem, refusal
from .section import Positive, Rule, Section, allowed, is_number, key

if TYPE_CHECKING:
    from .model import Scene

_ONE_LENGTH = 'give one of them, as in length = "mm"'
_SAME = 1e-9  # relative difference allowed between a value of the scene and its units
_ANY = {"reynolds": 1.0, "acceleration": 1.0, "density": 2.0}  # until they are known
_FILLED = (("fluid", "reynolds"), ("gravity", "acceleration"), ("body", "density"))
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
    """SI values of the scene's units; Reynolds number, gravity and the grain's density follow."""

    rules = (
        Rule("length", lambda s: s.length is not None and s.diameter is not None,
             "is given with diameter", _ONE_LENGTH),
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


def scales_of(scene: Scene, units: Units) -> Scales:
    """Scales of a scene. Raises ValidationError without a grain or with an inconsistent speed of the flow."""
    if scene.body is None:
        raise _refused(
            "units", "are those of a scene with a grain, and there is none", "add a section [body]"
        )
    kind, shear = scene.flow.kind, scene.flow.scaled_by == "shear_rate"
    needed, other = ("shear_rate", "velocity") if shear else ("velocity", "shear_rate")
    speed = getattr(units, needed)
    if speed is None:
        raise _refused(f"units.{needed}", f'is missing, which the flow "{kind}" needs', "add it")
    if getattr(units, other) is not None:
        raise _refused(f"units.{other}", f'is not of the flow "{kind}"', f"give {needed} only")
    length = units.metres(scene.grain)
    stated = scene.flow.reference_velocity(1.0)
    time = stated / speed if shear else length * stated / speed
    return Scales(length, time, units.fluid_density, scene.gdim)


def with_units(data: dict[str, Any], checked: Callable[[dict[str, Any]], Scene]) -> dict[str, Any]:
    """Data of a scene completed from its units; `checked` makes the scene of data without units.

    Raises ValidationError for an invalid scene, or one that contradicts its units.
    """
    try:
        units = Units.model_validate(data["units"])
    except ValidationError:  # which is reported when the whole scene is checked
        return _filled(data, _ANY)
    if _get(data.get("body"), "mass") is not None:
        raise _refused("body.mass", "is given with [units]", "leave one of them out")
    scene = checked({**_filled(data, _ANY), "units": None})
    scales, speed, length = (
        scales_of(scene, units),
        scene.reference_velocity,
        scene.reference_length,
    )
    derived = {
        "reynolds": speed * scales.velocity * length * scales.length / units.viscosity,
        "acceleration": units.gravity * scales.time**2 / scales.length,
        "density": units.grain_density / units.fluid_density,
    }
    for section, name in _FILLED:
        stated = _get(data.get(section), name)
        if isinstance(stated, int | float) and abs(stated / derived[name] - 1.0) > _SAME:
            why = f"is {stated:g}, but [units] makes it {derived[name]:g}"
            raise _refused(f"{section}.{name}", why, "leave it out")
    return _filled(data, derived)


def _filled(data: dict[str, Any], values: dict[str, float]) -> dict[str, Any]:
    filled = dict(data)
    for section, name in _FILLED:
        part = data.get(section)
        if _get(part, name) is not None:
            continue
        if isinstance(part, Section):
            filled[section] = part.model_copy(update={name: values[name]})
        elif isinstance(part, dict) or (part is None and section == "gravity"):
            filled[section] = {**(part or {}), name: values[name]}
    return filled


def _get(section: Any, key: str) -> Any:
    return section.get(key) if isinstance(section, dict) else getattr(section, key, None)


def _refused(key: str, why: str, remedy: str) -> ValidationError:
    return refusal(problem(key, why, remedy), between=True)

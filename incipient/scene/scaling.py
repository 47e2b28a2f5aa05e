"""The dimensionless scene that follows from SI units, and its scales.

Lengths of the scene are in units of L0 = length, or diameter / nominal diameter in the scene, velocities in units of
V0 = velocity / flow.velocity; of shear flow times are in units of T0 = flow.rate / shear_rate, and V0 = L0 / T0.
With them

    Re = V L / nu,    gravity.acceleration = g T0^2 / L0,    body.density = rho_s / rho_f,

V and L being those of the Reynolds number in SI units. Forces are in units of rho_f V0^2 L0^2, in 2-D of
rho_f V0^2 L0 per unit depth.
"""

from collections.abc import Callable
from typing import Any

from pydantic import ValidationError

from .messages import problem, refusal
from .model import SceneSections
from .section import Section
from .units import Scales, Units

_SAME = 1e-9  # relative: what a scene may say beside what follows from its units
_ANY = {"reynolds": 1.0, "acceleration": 1.0, "density": 2.0}  # until they are known


def scales_of(scene: SceneSections, units: Units) -> Scales:
    """The scales of a scene with a grain.

    Raises ValidationError if there is no grain, or the flow's speed is not given as the flow needs it.
    """
    if scene.body is None:
        raise _refused(
            "units", "are those of a scene with a grain, and there is none", "add a section [body]"
        )
    kind, shear = scene.flow.kind, scene.flow.kind == "shear"
    needed, other = ("shear_rate", "velocity") if shear else ("velocity", "shear_rate")
    speed = getattr(units, needed)
    if speed is None:
        raise _refused(f"units.{needed}", f'is missing, which the flow "{kind}" needs', "add it")
    if getattr(units, other) is not None:
        raise _refused(f"units.{other}", f'is not of the flow "{kind}"', f"give {needed} only")
    length = units.metres(scene.grain)
    stated = scene.flow.rate if scene.flow.kind == "shear" else scene.reference_velocity
    time = stated / speed if shear else length * stated / speed
    return Scales(length, time, units.fluid_density, scene.gdim)


def with_units(
    data: dict[str, Any], checked: Callable[[dict[str, Any]], SceneSections]
) -> dict[str, Any]:
    """The data of a scene with what follows from its units, which it may also have.

    Args:
        checked: the scene of data without units.

    Raises ValidationError if the scene is wrong, or says something else than its units.
    """
    try:
        units = Units.model_validate(data["units"])
    except ValidationError:  # which is reported when the whole scene is checked
        return _filled(data, _ANY)
    if _get(data.get("body"), "mass") is not None:
        raise _refused("body.mass", "is given beside [units]", "leave one of them out")
    scene = checked({**_filled(data, _ANY), "units": None})
    scales, speed, length = (
        scales_of(scene, units),
        scene.reference_velocity,
        scene.reference_length,
    )
    made = {
        "reynolds": speed * scales.velocity * length * scales.length / units.viscosity,
        "acceleration": units.gravity * scales.time**2 / scales.length,
        "density": units.grain_density / units.fluid_density,
    }
    for section, key in _FILLED:
        given = _get(data.get(section), key)
        if isinstance(given, int | float) and abs(given / made[key] - 1.0) > _SAME:
            why = f"is {given:g}, but [units] makes it {made[key]:g}"
            raise _refused(f"{section}.{key}", why, "leave it out")
    return _filled(data, made)


_FILLED = (("fluid", "reynolds"), ("gravity", "acceleration"), ("body", "density"))


def _filled(data: dict[str, Any], values: dict[str, float]) -> dict[str, Any]:
    """Data with values for what they do not say of Reynolds number, gravity and density."""
    filled = dict(data)
    for section, key in _FILLED:
        part = data.get(section)
        if _get(part, key) is not None:
            continue
        if isinstance(part, Section):
            filled[section] = part.model_copy(update={key: values[key]})
        elif isinstance(part, dict) or (part is None and section == "gravity"):
            filled[section] = {**(part or {}), key: values[key]}
    return filled


def _get(section: Any, key: str) -> Any:
    return section.get(key) if isinstance(section, dict) else getattr(section, key, None)


def _refused(key: str, why: str, remedy: str) -> ValidationError:
    return refusal("Scene", [problem(key, why, remedy)], between=True)

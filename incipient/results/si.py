"""Flow and loads in SI units, of scenes that say what their units are, as data and in words."""

from typing import Any

import numpy as np

from ..planning.flow_setup import WITH_BED_STRESS, Setup
from ..scene import Scene
from ..scene.units import nominal_diameter
from .loads import couple_words, force_words

# Numbers of a flow, with their units and names for a reader.
FLOW = {
    "shear_rate": ("1/s", "shear rate"),
    "velocity": ("m/s", "velocity"),
    "bed_stress": ("Pa", "stress on the bed"),
    "shear_velocity": ("m/s", "shear velocity"),
}


def in_si(
    scene: Scene,
    factor: float = 1.0,
    force: np.ndarray | None = None,
    couple: np.ndarray | None = None,
) -> dict[str, Any] | None:
    """The flow of a scene, made faster by a factor, and loads (3,) on its grain in SI units; None without [units].

    `units`: what one of the scene's units of length [m], time [s], velocity [m/s], stress [Pa], force [N] and torque
    [N m] is, the last two in 2-D per unit depth, as loads are; `bed_stress`: of the undisturbed flow at its
    datum. Not collective.
    """
    scales, units = scene.scales, scene.units
    if scales is None or units is None:
        return None
    names = ("length", "time", "velocity", "stress", "force", "couple")
    found: dict[str, Any] = {
        "dimension": scene.gdim,
        "units": {name: getattr(scales, name) for name in names},
        "nominal_diameter": scales.length * nominal_diameter(scene.grain),
    }
    for name in ("shear_rate", "velocity"):
        if getattr(units, name) is not None:
            found[name] = factor * getattr(units, name)
    if scene.flow.kind in WITH_BED_STRESS:
        found["bed_stress"] = scales.stress * Setup(scene).bed_stress(factor)
        found["shear_velocity"] = float(np.sqrt(found["bed_stress"] / scales.density))
    if force is not None and couple is not None:
        found |= {
            "force": (scales.force * force).tolist(),
            "couple": (scales.couple * couple).tolist(),
        }
    if scene.time is not None:
        found["end"] = scales.time * scene.time.end
    return found


def si_lines(found: dict[str, Any] | None) -> list[str]:
    """The lines of a result in SI units, as `in_si` gives them; none without."""
    if found is None:
        return []
    flow = [f"{name} {found[key]:.4g} {unit}" for key, (unit, name) in FLOW.items() if key in found]
    head = f"nominal diameter {found['nominal_diameter']:.4g} m"
    lines = [f"{'in SI units':<20}{', '.join([head, *flow])}"]
    if "force" in found:
        gdim = found["dimension"]
        force, couple = (
            force_words(found["force"], gdim, ".4g"),
            couple_words(found["couple"], gdim, ".4g"),
        )
        units = ("N/m", "N") if gdim == 2 else ("N", "N m")
        lines.append(f"{'':<20}force of the flow {force} {units[0]}, torque {couple} {units[1]}")
    if "end" in found:
        unit = found["units"]["time"]
        lines.append(f"{'':<20}ends after {found['end']:.4g} s; one unit of time is {unit:.4g} s")
    return lines

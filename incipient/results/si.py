"""Flow and loads in SI units, of scenes that say what their units are, as data and in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..planning.flow_setup import WITH_BED_STRESS, Setup
from ..scene import Scene
from ..scene.units import nominal_diameter
from .quantity import load_words

# Numbers of a flow, with their units and names for a reader.
FLOW = {
    "shear_rate": ("1/s", "shear rate"),
    "velocity": ("m/s", "velocity"),
    "bed_stress": ("Pa", "stress on the bed"),
    "shear_velocity": ("m/s", "shear velocity"),
}
UNITS = {"force": ("N/m", "N"), "torque": ("N", "N m")}  # in 2-D per unit depth, and in 3-D
OF_FLOW = ("force", "torque")  # loads of the flow as a whole; all others are details


def in_si(scene: Scene, factor: float = 1.0) -> dict[str, Any] | None:
    """The flow of a scene, made faster by a factor, in SI units; None without [units]. Not collective.

    `units`: what one of the scene's units of length [m], time [s], velocity [m/s], stress [Pa], force [N] and torque
    [N m] is, the last two in 2-D per unit depth, as loads are; `bed_stress`: of the undisturbed flow at its
    datum.
    """
    scales, units = scene.scales, scene.units
    if scales is None or units is None:
        return None
    scalars = {name: getattr(scales, name) for name in ("length", "time", "velocity", "stress")}
    found: dict[str, Any] = {
        "dimension": scene.gdim,
        "units": scalars | {"force": scales.force, "torque": scales.torque},
        "nominal_diameter": scales.length * nominal_diameter(scene.grain),
    }
    for name in ("shear_rate", "velocity"):
        if getattr(units, name) is not None:
            found[name] = factor * getattr(units, name)
    if scene.flow.kind in WITH_BED_STRESS:
        found["bed_stress"] = scales.stress * Setup(scene).bed_stress(factor)
        found["shear_velocity"] = float(np.sqrt(found["bed_stress"] / scales.density))
    if scene.time is not None:
        found["end"] = scales.time * scene.time.end
    return found


def with_loads(found: dict[str, Any] | None, loads: Mapping[str, Any]) -> dict[str, Any] | None:
    """What `in_si` gives, with loads (3,) by names that end in force or torque."""
    if found is None:
        return None
    scaled = {n: found["units"][_unit(n)] * np.asarray(load) for n, load in loads.items()}
    return found | {name: vector.tolist() for name, vector in scaled.items()}


def si_rows(found: Mapping[str, Any]) -> list[tuple[str, Any, str]]:
    """Name, value and unit of the grain, the flow and the end of the run."""
    rows: list[tuple[str, Any, str]] = [("nominal diameter", found["nominal_diameter"], "m")]
    rows += [(name, found[key], unit) for key, (unit, name) in FLOW.items() if key in found]
    return rows + ([("end", found["end"], "s")] if "end" in found else [])


def si_loads(found: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Name, components in words and unit of loads on the grain."""
    names, gdim = [name for name in found if _unit(name) in UNITS], found["dimension"]
    return [
        (name, load_words(found[name], _unit(name), gdim, ".4g"), UNITS[_unit(name)][gdim - 2])
        for name in names
    ]


def si_lines(found: Mapping[str, Any] | None) -> list[str]:
    """The lines of a result in SI units, as `in_si` gives them; none without."""
    if found is None:
        return []
    numbers = ", ".join(f"{name} {value:.4g} {unit}" for name, value, unit in si_rows(found))
    loads = ", ".join(
        f"{name} {words} {unit}" for name, words, unit in si_loads(found) if name in OF_FLOW
    )
    lines = [f"{'in SI units':<20}{numbers}"]
    lines += [f"{'':<20}{loads} of the flow"] if loads else []
    unit = found["units"]["time"]
    return lines + ([f"{'':<20}one unit of time is {unit:.4g} s"] if "end" in found else [])


def _unit(name: str) -> str:
    return name.rpartition("_")[2]

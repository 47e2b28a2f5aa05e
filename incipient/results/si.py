"""Flow and loads in SI units, for scenes with [units]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from ..scene import Scene
from ..scene.units import nominal_diameter
from ..setup.setup import Setup
from .quantity import OutputQuantity, labelled, screen_lines, words_of

HEADING = "In SI units"
# The flow and the grain.
SI = tuple(
    OutputQuantity(
        f"si.{name}", words, unit, column and f"{name}_si", heading=HEADING, line="in SI units"
    )
    for name, words, unit, column in (
        ("nominal_diameter", "nominal diameter", "m", ""),
        ("shear_rate", "shear rate", "1/s", "column"),
        ("velocity", "velocity", "m/s", "column"),
        ("bed_stress", "stress on the bed", "Pa", "column"),
        ("shear_velocity", "shear velocity", "m/s", "column"),
        ("end", "end", "s", ""),
    )
)
UNITS = {"force": ("N/m", "N"), "torque": ("N", "N m")}  # in 2-D per unit depth, and in 3-D


def in_si(scene: Scene, factor: float = 1.0) -> dict[str, Any] | None:
    """The flow of a scene, multiplied by a factor, in SI units; None without [units].

    `units`: the scene's units of length [m], time [s], velocity [m/s], stress [Pa], force [N] and torque [N m], the
    last two in 2-D per unit depth; `bed_stress`: of the undisturbed flow at its datum.
    """
    scales, units = scene.scales, scene.units
    if scales is None or units is None:
        return None
    values: dict[str, Any] = {
        "dimension": scene.gdim,
        "units": {name: value for name, value in asdict(scales).items() if name != "density"},
        "nominal_diameter": scales.length * nominal_diameter(scene.grain),
    }
    if scene.flow.kind != "log-law":  # whose velocity is the shear velocity
        values[scene.flow.scaled_by] = factor * getattr(units, scene.flow.scaled_by)
    if scene.flow.stresses_bed:
        values["bed_stress"] = scales.stress * Setup(scene).bed_stress(factor)
        values["shear_velocity"] = float(np.sqrt(values["bed_stress"] / scales.density))
    if scene.time is not None:
        values["end"] = scales.time * scene.time.end
    return values


def with_loads(values: dict[str, Any] | None, loads: Mapping[str, Any]) -> dict[str, Any] | None:
    """Values of `in_si` with loads (3,), whose names end in force or torque."""
    if values is None:
        return None
    units = values["units"]
    return values | {
        name: (units[_unit(name)] * np.asarray(load)).tolist() for name, load in loads.items()
    }


def si_loads(values: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Label, components as text and unit of loads on the grain."""
    names, gdim = [name for name in values if _unit(name) in UNITS], values["dimension"]
    return [
        (name, words_of(values[name], _unit(name), gdim, ".4g"), UNITS[_unit(name)][gdim - 2])
        for name in names
    ]


def si_lines(values: Mapping[str, Any] | None) -> list[str]:
    """Values of `in_si` as lines of text."""
    if values is None:
        return []
    loads = ", ".join(
        f"{name} {words} {unit}"
        for name, words, unit in si_loads(values)
        if name in UNITS  # the total loads; all others are details
    )
    lines = screen_lines(SI, {"si": values}) + labelled(
        "", *([f"{loads} of the flow"] if loads else [])
    )
    unit = values["units"]["time"]
    return lines + labelled("", *([f"one unit of time is {unit:.4g} s"] if "end" in values else []))


def _unit(name: str) -> str:
    return name.rpartition("_")[2]

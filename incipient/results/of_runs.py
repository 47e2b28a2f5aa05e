"""The quantities of runs: loads, flow and verdict."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from .quantity import OutputQuantity, at

# Parts of force and torque in results, with their labels.
_PARTS = {
    "flow": "flow, without buoyancy",
    "computed": "flow as computed, without corrections",
    "surface_integral": "flow as a surface integral, a check",
    "buoyancy": "buoyancy",
    "weight": "weight",
    "total": "total",
}


def _load(unit: str, part: str) -> OutputQuantity:
    words = _PARTS[part] if unit == "force" else f"torque of the {_PARTS[part]}"
    load = OutputQuantity(f"{unit}.{part}", words, unit, heading=unit)
    short = "" if unit == "force" else "torque"
    if part == "flow":
        short += " about the centre of mass" if short else ""
        error, line = f"error_bars.{unit}", "force of the flow"
        return replace(load, column=unit, error=error, line=line, short=short)
    if part == "computed":
        return replace(load, line="as computed", short=short, unlike=f"{unit}.flow")
    return load


def _viscous(unit: str, run: Any) -> Any:
    """Viscous part (3,) of a computed load, or None. Collective."""
    if run.probe is None:
        return None
    resultant = run.probe.viscous_resultant()
    return resultant.force if unit == "force" else resultant.torque


def _pressure(unit: str, stored: Mapping[str, Any]) -> Any:
    """Pressure part: surface integral less the viscous part; or None."""
    whole, viscous = (at(stored, f"{unit}.{part}") for part in ("surface_integral", "viscous"))
    return None if whole is None else whole - viscous


def _rotation(stored: Mapping[str, Any]) -> list[float] | None:
    quaternion = at(stored, "grain.quaternion")
    if quaternion is None:
        return None
    from scipy.spatial.transform import Rotation  # takes long to import, for 3-D alone

    turned: list[float] = Rotation.from_quat(np.roll(quaternion, -1)).as_rotvec().tolist()
    return turned


def _parts(unit: str) -> Iterator[OutputQuantity]:
    for part in ("pressure", "viscous"):
        yield OutputQuantity(
            f"{unit}.{part}",
            f"{part} part of the {'' if unit == 'force' else 'torque as a '}surface integral, not corrected",
            unit,
            column=f"{part}_{unit}",
            heading=unit,
            line=f"{part} part",
            short="" if unit == "force" else "torque",
            detail=True,
            measure=partial(_viscous, unit) if part == "viscous" else None,
            derive=partial(_pressure, unit) if part == "pressure" else None,
        )


OVER_BED = "flow over the bed"
# Extreme velocities on the centrelines of a lid-driven box, in the order of their errors; upward: v2, in 3-D v3.
EXTREMES = (
    ("minimum of v1",),
    ("maximum of v2", "maximum of v3"),
    ("minimum of v2", "minimum of v3"),
)


def _on_centreline(place: int, name: str) -> tuple[OutputQuantity, OutputQuantity]:
    value = OutputQuantity(
        f"centrelines.{name}.value",
        name,
        error=f"error_bars.centreline.{place}",
        heading="other numbers",
        line=name,
        short="",
    )
    return value, OutputQuantity(f"centrelines.{name}.position", "at", line=name)


def _safety(stored: Mapping[str, Any]) -> tuple[float, float] | None:
    bar = at(stored, "error_bars.safety_factor")
    if bar is None:
        return None
    low, high = (math.inf if bar[end] is None else bar[end] for end in ("low", "high"))
    return low, high


LOADS = (
    *(_load(unit, part) for part in _PARTS for unit in ("force", "torque")),
    *_parts("force"),
    *_parts("torque"),
    *(
        OutputQuantity(
            f"coefficients.{name}",
            name,
            column=name,
            heading="other numbers",
            line="coefficients",
        )
        for name in ("drag", "lift", "moment")
    ),
    *(
        OutputQuantity(f"coefficients.{name}", name.replace("_", " "), heading="other numbers")
        for name in ("reference_velocity", "reference_length")
    ),
    OutputQuantity(
        "grain.size", "size of the grain", "length", column="grain_size", heading="other numbers"
    ),
    OutputQuantity("grain.centre", "centre of the grain", "length", column="centre"),
    OutputQuantity("grain.angle", "rotation of the grain", "rad", column="rotation"),
    OutputQuantity(
        "grain.rotation", "rotation of the grain", "rad", column="rotation", derive=_rotation
    ),
)

FLOW = (
    OutputQuantity("plan.numbers.shields", "Shields number", column="flow_shields", line=OVER_BED),
    OutputQuantity("plan.numbers.shear_reynolds", "shear Reynolds number", line=OVER_BED),
    *(
        one
        for place, names in enumerate(EXTREMES)
        for name in names
        for one in _on_centreline(place, name)
    ),
    *(
        OutputQuantity(
            f"separated.0.{end}",
            f"x at which the flow along the bed {does}",
            "length",
            column,
            error=f"error_bars.separated.{end}",
            heading="other numbers",
        )
        for end, (does, column) in enumerate(
            (("separates", "separation"), ("reattaches", "reattachment"))
        )
    ),
)

VERDICT = (
    OutputQuantity("verdict.mode", "mode", column="mode"),
    OutputQuantity("verdict.moves", "moves", column="moves"),
    OutputQuantity(
        "verdict.safety_factor",
        "safety factor",
        column="safety_factor",
        ends=_safety,
        unbounded=True,
    ),
    OutputQuantity("error_bars.safety_factor.certain", "certain", column="certain"),
    OutputQuantity("verdict.judges.criteria.wording", "the paper's criteria", column="paper"),
)

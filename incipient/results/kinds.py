"""The kinds of results that commands write, and their quantities: of runs loads, flow and verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from .quantity import OutputQuantity, at

CRITICAL = "critical numbers"  # heading of a page
# Captions of the pictures of runs, each of which has some of them, by name.
OF_RUNS = {
    "verdict": "The verdict: forces on the grain and at its contacts",
    "flow": "Speed and streamlines",
    "pressure": "Pressure",
    "elevation": "The free surface from above",
    "vorticity": "Vorticity",
    "traction": "Traction of the fluid on the grain",
    "trajectory": "Path of the grain",
    "walls": "y+ and friction along the walls",
    "mesh": "The mesh",
}


@dataclass(frozen=True)
class ResultKind:
    """One kind of results.

    name: of its record NAME.json and of its page's template; title: of a page without any
    tables: other files beside the record; pictures: those that are always drawn
    has_scene: whether the directory contains the scene
    quantities: in tables of sweeps and on pages; those of runs are defined by their effects
    """

    name: str
    title: str
    tables: tuple[str, ...] = ()
    pictures: tuple[str, ...] = ()
    has_scene: bool = False
    quantities: tuple[OutputQuantity, ...] = ()

    @property
    def record(self) -> str:
        return f"{self.name}.json"

    @property
    def files(self) -> set[str]:
        return {self.record, *self.tables, *self.pictures}


def _kind(name: str, title: str, *tables: str, **more: Any) -> ResultKind:
    return ResultKind(name, title, tables, (f"{name}.png",), **more)


def _scene_probability(end: str) -> OutputQuantity:
    column = f"probability{'' if end == 'probability' else f'_{end}'}"
    return OutputQuantity(f"scene.{end}", "probability of motion", column=column)


def _ends_of(name: str) -> Callable[[Mapping[str, Any]], tuple[float, float] | None]:
    """Ends of the error bar of a critical number, if both are finite."""

    def ends(stored: Mapping[str, Any]) -> tuple[float, float] | None:
        known = at(stored, f"ranges.{name}")
        return None if known is None or None in known else (known[0], known[1])

    return ends


_bounded = partial(OutputQuantity, unbounded=True, heading=CRITICAL)
_THRESHOLD = (
    OutputQuantity("mode", "mode of incipient motion", column="mode"),
    _bounded(
        "factor",
        "critical flow over that of the scene",
        column="factor",
        ends=_ends_of("factor"),
    ),
    OutputQuantity("computed", "critical flow for the load without corrections", heading=CRITICAL),
    _bounded("shields", "critical Shields number", column="shields", ends=_ends_of("shields")),
    _bounded(
        "shields_nominal",
        "critical Shields number with the nominal diameter",
        column="shields_nominal",
    ),
    _bounded(
        "reynolds",
        "critical Reynolds number of the scene",
        column="reynolds",
        ends=_ends_of("reynolds"),
    ),
    _bounded(
        "shear_reynolds",
        "shear Reynolds number u* d/ν",
        column="shear_reynolds",
        ends=_ends_of("shear_reynolds"),
    ),
    OutputQuantity("reason", "why there is no critical flow", column="note"),
)
_GUST = (
    OutputQuantity(
        "strength", "critical strength", column="strength", error="error", unbounded=True
    ),
    *(OutputQuantity(name, name, column=name) for name in ("held", "leaves", "impulse", "runs")),
)
_ENTRAINMENT = (
    OutputQuantity("threshold.mode", "mode of incipient motion", column="mode"),
    OutputQuantity("threshold.shields", "Shields number of steady flow", column="shields"),
    *map(_scene_probability, ("probability", "low", "high")),
    OutputQuantity("scene.rate", "upcrossings per unit time", column="rate"),
)

RUN = ResultKind(
    "result",
    "",
    ("history.csv", "contacts.csv", "fields", "fields.xdmf", "surface", "surface.xdmf"),
    ("flow.png", "pressure.png", "mesh.png"),
    has_scene=True,
)
THRESHOLD = _kind("threshold", "Critical flow", has_scene=True, quantities=_THRESHOLD)
GUSTS = _kind("gusts", "Critical gusts", "gusts.csv", has_scene=True, quantities=_GUST)
ENTRAINMENT = _kind(
    "entrainment",
    "Motion in a fluctuating flow",
    "entrainment.csv",
    has_scene=True,
    quantities=_ENTRAINMENT,
)
COST = _kind("cost", "What accuracy costs", "cost.csv", has_scene=True)
SURVEY = _kind("survey", "A bed of grains", "grains.csv", "spheres.csv", "survey.vtp")
POSES = _kind("poses", "A grain in many poses", "poses.csv")
JUDGEMENT = _kind("judgement", "A case")
PILE = ResultKind("pile", "Several grains")  # without a picture
SERIES = _kind("series", "A series of loads", "series.csv")
KINDS = (RUN, THRESHOLD, GUSTS, ENTRAINMENT, SURVEY, POSES, JUDGEMENT, PILE, SERIES, COST)


def quantities_of(kind: ResultKind, stored: Mapping[str, Any]) -> tuple[OutputQuantity, ...]:
    """Quantities of a result as plain data, except of runs."""
    quantiles = (at(stored, "quantiles") or ()) if kind is ENTRAINMENT else ()
    return kind.quantities + tuple(
        OutputQuantity(
            f"quantiles.{number}.shields",
            f"Shields number of the probability {one['probability']:g}",
            column=f"shields_at_{one['probability']:g}",
            error=f"quantiles.{number}.error",
        )
        for number, one in enumerate(quantiles)
    )


# -- quantities of runs ----------------------------------------------------------------------------

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

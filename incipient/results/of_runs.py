"""Output quantities of runs: loads, flow, verdict, path of a grain, walls."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from .quantity import OutputQuantity, at, ends_at

WORKS = ("flow", "gravity", "friction", "impact")  # what does work on a grain on its bed


def _load(unit: str, part: str, words: str, **more: Any) -> OutputQuantity:
    words = f"torque of the {words}" if unit == "torque" else words
    return OutputQuantity(f"{unit}.{part}", words, unit, heading=unit, **more)


def _viscous(unit: str, run: Any) -> Any:
    """Viscous part (3,) of a computed load, or None. Collective."""
    return None if run.probe is None else getattr(run.probe.surface_resultant(viscous=True), unit)


def _pressure(unit: str, stored: Mapping[str, Any]) -> Any:
    """Pressure part: surface integral less the viscous part; or None."""
    whole, viscous = (at(stored, f"{unit}.{part}") for part in ("surface_integral", "viscous"))
    return None if whole is None else np.subtract(whole, viscous).tolist()


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


def _of_separation(key: str, heading: str) -> Iterator[OutputQuantity]:
    """Both ends of the longest interval of reverse flow along the bed."""
    names = (("separates", "separation"), ("reattaches", "reattachment"))
    for end, (does, column) in enumerate(names):
        yield OutputQuantity(
            f"{key}.{end}",
            f"x at which the flow along the bed {does}",
            "length",
            column,
            error=f"error_bars.separated.{end}",
            heading=heading,
        )


LOADS = (
    *(
        _load(
            unit,
            "flow",
            "flow, without buoyancy",
            column=unit,
            error=f"error_bars.{unit}",
            line="force of the flow",
            short=short,
        )
        for unit, short in (("force", ""), ("torque", "torque about the centre of mass"))
    ),
    *(
        _load(
            unit,
            "computed",
            "flow as computed, without corrections",
            line="as computed",
            short=short,
            unlike=f"{unit}.flow",
        )
        for unit, short in (("force", ""), ("torque", "torque"))
    ),
    *(
        _load(unit, part, words)
        for part, words in (
            ("surface_integral", "flow as a surface integral, a check"),
            ("buoyancy", "buoyancy"),
            ("weight", "weight"),
            ("total", "total"),
        )
        for unit in ("force", "torque")
    ),
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
        quantity
        # Extreme velocities on the centrelines of a lid-driven box, in the order of their errors; v3 in 3-D.
        for place, names in enumerate(
            (
                ("minimum of v1",),
                ("maximum of v2", "maximum of v3"),
                ("minimum of v2", "minimum of v3"),
            )
        )
        for name in names
        for quantity in _on_centreline(place, name)
    ),
    *_of_separation("separated.0", "other numbers"),
)

VERDICT = (
    OutputQuantity("verdict.mode", "mode", column="mode"),
    OutputQuantity("verdict.moves", "moves", column="moves"),
    OutputQuantity(
        "verdict.safety_factor",
        "safety factor",
        column="safety_factor",
        ends=partial(ends_at, "error_bars.safety_factor"),
        unbounded=True,
    ),
    OutputQuantity("verdict.first_motion", "would have moved at", "time", column="would_move"),
    OutputQuantity("error_bars.safety_factor.certain", "certain", column="certain"),
    OutputQuantity("verdict.judges.criteria.wording", "the paper's criteria", column="paper"),
)

PATH = "path of the grain"  # heading of a page
_path = partial(OutputQuantity, heading=PATH)


OF_PATH = (
    _path("trajectory.ended.by", "ended by", column="ended", line="path"),
    _path("trajectory.ended.time", "time at the end", "time", line="path", short="at t ="),
    _path("trajectory.place", "position", "length", line="position", short=""),
    _path("trajectory.angle", "turned by", "rad", line="position", short="turned by [rad]"),
    _path("trajectory.quaternion", "orientation, a quaternion", line="position", detail=True),
    _path(
        "trajectory.velocity", "velocity", "velocity", column="velocity", line="velocity", short=""
    ),
    _path("trajectory.spin", "spin", "rad/time", column="spin", line="velocity", short="spin"),
    _path("trajectory.on_bed.mode", "mode at the end", column="does", line="on its bed"),
    _path("trajectory.on_bed.first_motion", "first motion", "time", column="first_motion"),
    _path("trajectory.on_bed.left_pocket", "left its pocket", "time", column="left_pocket"),
    _path(
        "trajectory.on_bed.force",
        "force of contact",
        "force",
        line="on its bed",
        short="force of contact",
    ),
    *(
        _path(
            f"trajectory.on_bed.works.{name}", f"work of {name}", "energy", line="works", short=name
        )
        for name in WORKS
    ),
    *(
        _path(
            f"trajectory.interface_iterations.{key}",
            f"iterations of flow and grain a step, {words}",
            line="interface",
            short=short,
            detail=True,
        )
        for key, words, short in (
            ("mean", "on average", "iterations a step"),
            ("most", "at most", "at most"),
        )
    ),
    _path(
        "trajectory.new_meshes",
        "new meshes",
        derive=lambda stored: len(at(stored, "trajectory.remeshings") or ()),
        line="interface",
        detail=True,
    ),
)


def _of_friction(stored: Mapping[str, Any]) -> tuple[float, float] | None:
    """Error bar of C_f, which scales with the square of u*."""
    error, walls = at(stored, "error_bars.shear_velocity.0"), stored["turbulence"]
    if error is None or not walls["at_outflow"]:
        return None
    relative, friction = error / walls["at_outflow"], walls["friction"]
    return friction * max(1.0 - relative, 0.0) ** 2, friction * (1.0 + relative) ** 2


def _roughness_reynolds(stored: Mapping[str, Any]) -> float | None:
    walls = stored.get("turbulence")
    if walls is None or not walls["roughness"]:
        return None
    return walls["shear_velocity"] * walls["roughness"] / walls["viscosity"]


_at_walls = partial(OutputQuantity, heading="at the walls", line="turbulence")
OF_WALLS = (
    _at_walls("turbulence.least", "least y+ of the walls", short="y+ from", column="y_plus_min"),
    _at_walls("turbulence.largest", "largest y+ of the walls", short="to", column="y_plus_max"),
    _at_walls(
        "turbulence.roughness_reynolds",
        "roughness Reynolds number u* k_s/nu",
        short="u* k_s/nu",
        derive=_roughness_reynolds,
    ),
    _at_walls(
        "turbulence.at_outflow",
        "shear velocity u* at the outflow",
        short="u* at the outflow",
        column="bed_shear_velocity",
        error="error_bars.shear_velocity.0",
    ),
    _at_walls(
        "turbulence.friction",
        "friction C_f at the outflow",
        short="C_f",
        column="friction",
        ends=_of_friction,
    ),
    _at_walls(
        "turbulence.shear_velocity",
        "shear velocity u* along the walls, mean",
        short="mean u* along the walls",
        error="error_bars.shear_velocity.1",
    ),
    *_of_separation("turbulence.separated", "at the walls"),
    OutputQuantity("turbulence.spread", "spread of the loads", column="load_spread"),
)


def _largest_of_cells(run: Any) -> float | None:
    from ..fluid.derived import measured_cell_reynolds

    return measured_cell_reynolds(run.fluid) if run.fluid.model.inertia else None


# In the order of results and columns.
QUANTITIES: tuple[OutputQuantity, ...] = (
    *VERDICT,
    OutputQuantity(
        "measured_cell_reynolds",
        "largest Reynolds number of a cell",
        heading="other numbers",
        measure=_largest_of_cells,
    ),
    *(*LOADS, *FLOW, *OF_PATH, *OF_WALLS),
)

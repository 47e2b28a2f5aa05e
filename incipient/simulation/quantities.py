"""Output quantities of runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ..coupled import WORKS
from ..results.kinds import FLOW, LOADS, VERDICT
from ..results.quantity import OutputQuantity, at

if TYPE_CHECKING:
    from .state import Run

PATH = "path of the grain"  # heading of a page


def _path(key: str, words: str, unit: str = "", **more: Any) -> OutputQuantity:
    return OutputQuantity(f"trajectory.{key}", words, unit, heading=PATH, **more)


def _new_meshes(stored: Mapping[str, Any]) -> int:
    return len(at(stored, "trajectory.remeshings") or ())


OF_PATH = (
    _path("ended.by", "ended by", column="ended", line="path"),
    _path("ended.time", "time at the end", "time", line="path", short="at t ="),
    _path("place", "position", "length", line="position", short=""),
    _path("angle", "turned by", "rad", line="position", short="turned by [rad]"),
    _path("quaternion", "orientation, a quaternion", line="position", detail=True),
    _path("velocity", "velocity", "velocity", column="velocity", line="velocity", short=""),
    _path("spin", "spin", "rad/time", column="spin", line="velocity", short="spin"),
    _path("on_bed.mode", "mode at the end", column="does", line="on its bed"),
    _path("on_bed.first_motion", "first motion", "time", column="first_motion"),
    _path("on_bed.left_pocket", "left its pocket", "time", column="left_pocket"),
    _path("on_bed.force", "force of contact", "force", line="on its bed", short="force of contact"),
    *(
        _path(f"on_bed.works.{name}", f"work of {name}", "energy", line="works", short=name)
        for name in WORKS
    ),
    *(
        _path(
            f"interface_iterations.{key}",
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
    _path("new_meshes", "new meshes", derive=_new_meshes, line="interface", detail=True),
)


def _of_shear_velocity(stored: Mapping[str, Any]) -> tuple[float, float] | None:
    error, u = at(stored, "error_bars.shear_velocity.0"), stored["turbulence"]["at_outflow"]
    return None if error is None or not u else (max(u - error, 0.0), u + error)


def _of_friction(stored: Mapping[str, Any]) -> tuple[float, float] | None:
    """Error bar of C_f, which scales with the square of u*."""
    ends, walls = _of_shear_velocity(stored), stored["turbulence"]
    if ends is None:
        return None
    low, high = (walls["friction"] * (end / walls["at_outflow"]) ** 2 for end in ends)
    return low, high


def _roughness_reynolds(stored: Mapping[str, Any]) -> float | None:
    walls = stored.get("turbulence") or {"roughness": 0.0}
    if not walls["roughness"]:
        return None
    return walls["shear_velocity"] * walls["roughness"] / walls["viscosity"]


def _at_walls(key: str, words: str, short: str, column: str = "", **more: Any) -> OutputQuantity:
    return OutputQuantity(
        f"turbulence.{key}",
        words,
        column=column,
        heading="at the walls",
        line="turbulence",
        short=short,
        **more,
    )


OF_WALLS = (
    _at_walls("least", "least y+ of the walls", "y+ from", "y_plus_min"),
    _at_walls("largest", "largest y+ of the walls", "to", "y_plus_max"),
    _at_walls(
        "roughness_reynolds",
        "roughness Reynolds number u* k_s/nu",
        "u* k_s/nu",
        derive=_roughness_reynolds,
    ),
    _at_walls(
        "at_outflow",
        "shear velocity u* at the outflow",
        "u* at the outflow",
        "bed_shear_velocity",
        ends=_of_shear_velocity,
    ),
    _at_walls("friction", "friction C_f at the outflow", "C_f", "friction", ends=_of_friction),
    _at_walls(
        "shear_velocity",
        "shear velocity u* along the walls, mean",
        "mean u* along the walls",
        error="error_bars.shear_velocity.1",
    ),
    *(
        OutputQuantity(
            f"turbulence.separated.{end}",
            f"x at which the flow along the bed {does}",
            "length",
            column,
            error=f"error_bars.separated.{end}",
            heading="at the walls",
        )
        for end, (does, column) in enumerate(
            (("separates", "separation"), ("reattaches", "reattachment"))
        )
    ),
    OutputQuantity("turbulence.spread", "spread of the loads", column="load_spread"),
)


def _largest_of_cells(run: Run) -> float | None:
    from ..fluid.derived import measured_cell_reynolds

    return measured_cell_reynolds(run.fluid) if run.fluid.model.inertia else None


CELL_REYNOLDS = OutputQuantity(
    "measured_cell_reynolds",
    "largest Reynolds number of a cell",
    heading="other numbers",
    measure=_largest_of_cells,
)
# In the order of results.
QUANTITIES: tuple[OutputQuantity, ...] = (
    *(CELL_REYNOLDS, *LOADS, *VERDICT, *FLOW, *OF_PATH, *OF_WALLS),
)

"""Free or prescribed motion of a grain in the flow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...results.quantity import OutputQuantity, at

PATH = "path of the grain"  # heading of a page
WORKS = ("flow", "gravity", "friction", "impact")  # what does work on a grain on its bed


def _path(key: str, words: str, unit: str = "", **more: Any) -> OutputQuantity:
    return OutputQuantity(f"trajectory.{key}", words, unit, heading=PATH, **more)


def _new_meshes(stored: Mapping[str, Any]) -> int:
    return len(at(stored, "trajectory.remeshings") or ())


QUANTITIES = (
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

"""Free or prescribed motion of a grain in the flow."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from ...body.state import BodyState
from ...planning.effects import Decision
from ...results.left_out import Omission
from ...results.quantity import OutputQuantity, at
from ...setup.setup import Setup
from ..effect import Solved
from ..run_part import Stage

if TYPE_CHECKING:
    from ...restart import Checkpoint
    from .part import MovingGrain


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


def moving_grain(setup: Setup, stage: Stage, kept: Checkpoint | None) -> MovingGrain | None:
    """The part of a moving grain, at the start or in the state of a checkpoint, or None. Collective."""
    if not setup.scene.moves:
        return None
    body = None if kept is None else kept.body
    state = None if body is None else BodyState.unpacked(body.made_for)
    assert setup.scene.body is not None
    if setup.scene.body.touches:
        from .on_bed import GrainOnBed

        return GrainOnBed(setup, stage, state)
    from .part import MovingGrain

    return MovingGrain(setup, stage, state)


def without_motion(solved: Solved, decision: Decision) -> Iterator[Omission]:
    """What is said of a held grain that would move."""
    verdict = solved.verdict or {}
    since, rocking = verdict.get("first_motion"), verdict.get("rocking")
    if since is None:
        return
    does = "moves" if rocking is None or rocking["leaves"] else "rocks"
    pose = "" if rocking is None else "; this time and the history are judged in the first pose"
    how = f"the grain {does} from t = {since:.4g} on, but was held{pose}"
    yield Omission(decision.name, None, how, False)

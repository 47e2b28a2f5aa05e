"""Hard cases that stop in the middle, and the same run resumed from its checkpoint with what stopped it changed."""

from __future__ import annotations

import os
import signal
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI
from scenes import CARRIED

import incipient
from incipient.errors import IncipientError
from incipient.progress import Silent
from incipient.restart import read
from incipient.results.result import Result
from incipient.scene.file import loads

# The ellipse in the cavity, heavy: it sinks to the bottom.
SINKING = (
    *("body.density=5", "body.centre=[1.5, 1.2]", "gravity.acceleration=10", "fluid.reynolds=5"),
    *("time.end=20", "contact.friction=0"),
)
# A box whose lid gets faster and faster, beyond what coarse cells can bear without stabilisation.
FASTER = """
[domain]
kind = "box"
length = 1.0
height = 1.0
top = "stream"
[fluid]
reynolds = 10000
scale = "flow"
[flow]
kind = "expression"
components = ["16*x**2*(1 - x)**2*y**8*0.2*t**2", "0"]
velocity = 1.0
[time]
end = 10.0
step = 0.5
[numerics]
mesh_size = 6.0
[output]
fields = false
"""


@dataclass(frozen=True)
class HardCase:
    """A scene, what stops it in the middle, and what it is resumed with; `steps` after which a signal stops it."""

    name: str
    scene: str
    common: tuple[str, ...]
    stopping: tuple[str, ...]
    remedy: tuple[str, ...]
    steps: int | None = None


@dataclass(frozen=True)
class Resumed:
    """How a case stopped, when, and how it went on: times, steps, and the difference from the whole run.

    difference: of the last place relative to the grain's size, or without a grain of the velocity relative to it
    """

    stopped: str
    kept: float
    end: float
    whole_end: float
    difference: float


CASES = {
    case.name: case
    for case in (
        HardCase(
            "new mesh too coarse beside the lid",
            *(CARRIED, (), ("numerics.mesh_size=8",), ("numerics.mesh_size=2",)),
        ),
        HardCase(
            "sinking until contact, gap made smaller",
            *(CARRIED, SINKING, ("contact.gap=0.1",), ("contact.gap=0.05",)),
        ),
        HardCase(
            "adaptive steps far too small, stopped by a signal",
            *(CARRIED, ("time.end=0.5",), ("time.tolerance=1e-13",), ("time.tolerance=1e-3",), 12),
        ),
        HardCase(
            "lid ever faster, plain coarse cells",
            *(FASTER, (), ('numerics.stabilisation="off"',)),
            ('numerics.stabilisation="on"', 'numerics.convection="extrapolated"'),
        ),
    )
}


def resumed(name: str, directory: Path) -> Resumed:
    """Let a case stop, resume it with the remedy, and compare with the run that had that from the start."""
    case, cut = CASES[name], directory / "cut"
    stopped = _stopped(case, cut)
    kept = read(cut / "checkpoint.h5", MPI.COMM_SELF).time
    end = incipient.resume(cut, case.remedy)
    assert end.status == "complete"
    whole = incipient.run(_scene(case, case.remedy), directory / "whole")
    return Resumed(stopped, kept, _time(end), _time(whole), _difference(end, whole))


def _scene(case: HardCase, settings: tuple[str, ...]) -> incipient.Scene:
    return loads(case.scene, overrides=(*case.common, *settings))


def _stopped(case: HardCase, directory: Path) -> str:
    """Run the case until it stops; why it did."""
    voice = Silent() if case.steps is None else _Signalling(case.steps)
    try:
        result = incipient.run(_scene(case, case.stopping), directory, voice=voice)
    except IncipientError as error:
        return str(error).partition("; t = ")[0].partition("; resume with")[0]
    ended = result.to_dict()["trajectory"]["ended"]
    assert ended["by"] == "contact"
    return f"meets the {ended['nearest']}"


class _Signalling(Silent):
    """Sends this process SIGTERM after so many steps, as a batch system does at the end of its time."""

    def __init__(self, steps: int):
        self._left = steps

    def advance(self, time: float, end: float) -> None:
        self._left -= 1
        if self._left == 0:
            os.kill(os.getpid(), signal.SIGTERM)


def _time(result: Result) -> float:
    if result.trajectory is not None:
        return float(result.trajectory["ended"]["time"])
    return float(result.scene["time"]["end"])


def _difference(one: Result, other: Result) -> float:
    if one.trajectory is not None and other.trajectory is not None and one.grain is not None:
        way = np.subtract(one.trajectory["place"], other.trajectory["place"])
        return float(np.linalg.norm(way)) / one.grain["size"]
    values, expected = (result.velocity.x.array for result in (one, other))
    return float(np.linalg.norm(values - expected) / np.linalg.norm(expected))

"""Hard cases that stop in the middle, and the same run resumed from its checkpoint with what stopped it changed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI
from scenes import CARRIED

import incipient
from incipient.errors import IncipientError
from incipient.restart import read
from incipient.scene.file import loads

# The ellipse in the cavity, heavy: it sinks to the bottom.
SINKING = (
    *("body.density=5", "body.centre=[1.5, 1.2]", "gravity.acceleration=10", "fluid.reynolds=5"),
    *("time.end=20", "contact.friction=0"),
)
# By name: settings of both runs, what stops one in the middle, and what it is resumed with.
CASES = {
    "new mesh too coarse beside the lid": (
        (),
        ("numerics.mesh_size=8",),
        ("numerics.mesh_size=2",),
    ),
    "sinking until contact, gap made smaller": (
        SINKING,
        ("contact.gap=0.1",),
        ("contact.gap=0.05",),
    ),
}


@dataclass(frozen=True)
class Resumed:
    """How a case stopped, when, and how it went on: times, and the last place's difference from the whole run.

    difference: relative to the grain's size
    """

    stopped: str
    kept: float
    end: float
    whole_end: float
    difference: float


def resumed(name: str, directory: Path) -> Resumed:
    """Let a case stop, resume it with the remedy, and compare with the run that had that from the start."""
    (common, stopping, remedy), cut = CASES[name], directory / "cut"
    try:
        ended = incipient.run(loads(CARRIED, overrides=(*common, *stopping)), cut).trajectory[
            "ended"
        ]
        stopped = f"meets the {ended['nearest']}"
    except IncipientError as error:
        stopped = str(error).partition("; the state at t = ")[0]
    kept = read(cut / "checkpoint.h5", MPI.COMM_SELF).time
    end = incipient.resume(cut, remedy)
    whole = incipient.run(loads(CARRIED, overrides=(*common, *remedy)), directory / "whole")
    times = (float(one.trajectory["ended"]["time"]) for one in (end, whole))
    way = np.subtract(end.trajectory["place"], whole.trajectory["place"])
    return Resumed(stopped, kept, *times, float(np.linalg.norm(way)) / end.grain["size"])

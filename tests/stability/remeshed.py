"""A run that remeshes as often as it is told to."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from mpi4py import MPI

from incipient.scene.file import loads
from incipient.simulation import simulate

SCENE = """
[domain]
kind = "box"
length = 4.0
height = 4.0
[fluid]
reynolds = 20.0
scale = "flow"
[flow]
kind = "lid"
[body]
shape = "ellipse"
semi_axes = [0.5, 0.3]
centre = [1.5, 2.5]
density = 1.0
motion = "free"
[time]
end = {end}
step = 0.1
start = "stokes"
[numerics]
mesh_size = 1.4
error_bars = false
remesh_below = {below}
"""


@dataclass(frozen=True)
class Remeshed:
    """Where the grain ended, its size, how often it was meshed anew, the largest change of energy by that."""

    place: tuple[float, ...]
    size: float
    count: int
    energy: float


def remeshed_run(below: float, steps: int = 20) -> Remeshed:
    """So many steps of an ellipse carried by a driven cavity."""
    result = simulate(loads(SCENE.format(below=below, end=0.1 * steps), Path()), MPI.COMM_WORLD)
    told = result.to_dict()["trajectory"]
    changes = [one["energy"] for one in told["remeshings"]]
    return Remeshed(tuple(told["place"]), 1.0, len(changes), max(changes, default=0.0))

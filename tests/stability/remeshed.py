"""A run that remeshes as often as it is told to."""

from __future__ import annotations

from dataclasses import dataclass

from mpi4py import MPI
from scenes import CARRIED

from incipient.scene.file import loads
from incipient.simulation.simulate import simulate


@dataclass(frozen=True)
class Remeshed:
    """Where the grain ended, its size, how often it was meshed anew, the largest change of energy by that."""

    place: tuple[float, ...]
    size: float
    count: int
    energy: float


def remeshed_run(below: float, steps: int = 20) -> Remeshed:
    """So many steps of an ellipse carried by a driven cavity."""
    changes = (
        *("body.centre=[1.5, 2.5]", "numerics.mesh_size=1.4"),
        *(f"numerics.remesh_below={below}", f"time.end={0.1 * steps}"),
    )
    result = simulate(loads(CARRIED, overrides=changes), MPI.COMM_WORLD)
    told = result.to_dict()["trajectory"]
    changes = [one["energy"] for one in told["remeshings"]]
    return Remeshed(tuple(told["place"]), 1.0, len(changes), max(changes, default=0.0))

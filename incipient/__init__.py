"""Does a rigid grain resting on a rigid bed in a viscous flow begin to move, how, and with what margin?

A scene goes in, a verdict comes out::

    import incipient
    result = incipient.run(incipient.load("demos/scenes/grain_on_bed.toml"), "results/grain")
    print(result.text())

Scenes are also built from the classes of `incipient.scene`. Importing this package is cheap: the finite
element library is loaded when something is computed.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .errors import ConvergenceError, IncipientError, MeshError, OutputError, SceneError
from .plan import Plan, make_plan
from .scene import Scene, load

if TYPE_CHECKING:
    from mpi4py import MPI

    from .progress import Silent
    from .result import Result

__all__ = [
    "ConvergenceError",
    "IncipientError",
    "MeshError",
    "OutputError",
    "Plan",
    "Scene",
    "SceneError",
    "load",
    "make_plan",
    "run",
]


def run(
    scene: Scene,
    directory: Path | str | None = None,
    comm: MPI.Comm | None = None,
    voice: Silent | None = None,
) -> Result:
    """Simulate a scene and judge its grain. Collective over `comm` (default: all ranks).

    Args:
        scene: what to simulate.
        directory: where to write the resolved scene, result.json, history and fields; None writes nothing.
        voice: told what is going on; default: nobody.

    Raises:
        IncipientError: on all ranks, one line; what was computed before it stays in the directory.
    """
    from mpi4py import MPI as mpi

    from .simulation import simulate

    comm = comm or mpi.COMM_WORLD
    if directory is None:
        return simulate(scene, comm, None, voice)
    from .output.directory import ResultDirectory

    return simulate(scene, comm, ResultDirectory(Path(directory), comm), voice)

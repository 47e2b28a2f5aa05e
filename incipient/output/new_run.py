"""Runs of scenes, which leave a directory behind if one is named."""

from __future__ import annotations

from pathlib import Path

from ..accuracy.run import run_scene
from ..interrupt import one_at_a_time
from ..parallel import Comm, world
from ..progress import Silent
from ..results.result import Result
from ..scene import Scene
from ..simulation.recorder import Recorder
from .directory import ResultDirectory
from .lock import locked


@one_at_a_time
def run(
    scene: Scene,
    directory: Path | str | None = None,
    comm: Comm | None = None,
    voice: Silent | None = None,
    overwrite: bool = False,
) -> Result:
    """Simulate a scene and judge its grain. Collective over `comm` (default: all ranks).

    With `numerics.accuracy` mesh and order are chosen to reach it (docs/explanation/errors.md). When the run has its
    mesh, an
    earlier one in the directory makes room: it is removed, or moved to a numbered neighbour if it can be resumed.

    Args:
        scene: what to simulate.
        directory: where to write the resolved scene, result.json, history and fields; None writes nothing.
        voice: reports progress; default: none.
        overwrite: remove the earlier run even if it can be resumed.

    Raises:
        IncipientError: on all ranks, one line; what was computed before it stays in the directory.
    """
    comm = comm or world()
    if directory is None:
        return run_scene(scene, comm, Recorder(), voice)
    directory = Path(directory)
    with locked(directory, comm, make=True):
        return run_scene(scene, comm, ResultDirectory(directory, comm, overwrite=overwrite), voice)

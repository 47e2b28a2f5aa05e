"""Does a rigid grain resting on a rigid bed in a viscous flow begin to move, how, and with what margin?

A scene goes in, a verdict comes out::

    import incipient
    result = incipient.run(incipient.load("demos/scenes/grain_on_bed.toml"), "results/grain")
    print(result.text())

Scenes are also built from the classes of `incipient.scene`. Importing this package is cheap: the finite
element library is loaded when something is computed.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import (
    ConvergenceError,
    IncipientError,
    Interrupted,
    MeshError,
    MissingError,
    OutputError,
    SceneError,
)

if TYPE_CHECKING:
    from mpi4py import MPI

    from .critical.outcome import Threshold
    from .effects.plan import make_plan
    from .planning.plan import Plan
    from .progress import Silent
    from .results.result import Result
    from .scene import Scene, load
    from .simulation.recorder import Recorder

__all__ = [
    "ConvergenceError",
    "IncipientError",
    "Interrupted",
    "MeshError",
    "MissingError",
    "OutputError",
    "Plan",
    "Scene",
    "SceneError",
    "load",
    "make_plan",
    "report",
    "resume",
    "run",
    "threshold",
]

# Loaded when they are asked for: the judge of forces from elsewhere needs no scenes, and nothing that these need.
_LATER = {"Plan": "planning.plan", "make_plan": "effects.plan", "Scene": "scene", "load": "scene"}


def __getattr__(name: str) -> Any:
    if name in _LATER:
        return getattr(import_module(f".{_LATER[name]}", __name__), name)
    if name in ("scene", "planning"):
        return import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def run(
    scene: Scene,
    directory: Path | str | None = None,
    comm: MPI.Comm | None = None,
    voice: Silent | None = None,
    overwrite: bool = False,
) -> Result:
    """Simulate a scene and judge its grain. Collective over `comm` (default: all ranks).

    With `numerics.accuracy` mesh and order are chosen to reach it (docs/accuracy.md). When the run has its mesh, an
    earlier one in the directory makes room: it is removed, or moved to a numbered neighbour if it can be resumed.

    Args:
        scene: what to simulate.
        directory: where to write the resolved scene, result.json, history and fields; None writes nothing.
        voice: told what is going on; default: nobody.
        overwrite: remove the earlier run even if it can be resumed.

    Raises:
        IncipientError: on all ranks, one line; what was computed before it stays in the directory.
    """
    from .parallel import world
    from .simulation.recorder import Unrecorded

    comm = comm or world()
    if directory is None:
        return _simulated(scene, comm, Unrecorded(), voice)
    from .output.directory import ResultDirectory
    from .output.lock import locked

    directory = Path(directory)
    with locked(directory, comm, make=True):
        return _simulated(scene, comm, ResultDirectory(directory, comm, overwrite=overwrite), voice)


def _simulated(scene: Scene, comm: MPI.Comm, recorder: Recorder, voice: Silent | None) -> Result:
    from .simulation.simulate import simulate

    if scene.numerics.accuracy is None:
        return simulate(scene, comm, recorder, voice)
    from .adaptive.run import run_to_accuracy

    return run_to_accuracy(scene, comm, recorder, voice)


def resume(
    directory: Path | str,
    overrides: Sequence[str] = (),
    comm: MPI.Comm | None = None,
    voice: Silent | None = None,
) -> Result:
    """Go on with a run that was cut short, from the checkpoint in its directory. Collective over `comm`.

    The number of ranks need not be that of the run. History and fields go on where the checkpoint was written; fields
    that cannot be read are put aside. Until there is a new result the earlier one stays.

    Args:
        directory: the directory of the run.
        overrides: such as ``"time.end=20"``; what may change is in `restart.reopening`.
        voice: where progress is reported; see `run`.

    Raises:
        IncipientError: as `run`; and when the checkpoint is missing, damaged, incomplete, of another version or
            of another scene, or when there is nothing left to compute.
    """
    from .output.directory import ResultDirectory
    from .output.lock import locked
    from .output.reopening import reopened
    from .parallel import world
    from .simulation.simulate import simulate

    comm, directory = comm or world(), Path(directory)
    with locked(directory, comm):
        scene, kept = reopened(directory, overrides, comm)
        return simulate(scene, comm, ResultDirectory(directory, comm, kept), voice, kept)


def threshold(
    scene: Scene,
    directory: Path | str | None = None,
    comm: MPI.Comm | None = None,
    voice: Silent | None = None,
) -> Threshold:
    """Find the flow at which a scene's grain first moves as it grows from rest. Collective over `comm`.

    Args:
        scene: a grain that rests on a bed, in a steady flow.
        directory: where to write threshold.json and the resolved scene; None writes nothing. The critical flow is
            written as soon as it is known, before its error bars are.
        voice: told of every flow that is solved; default: nobody.

    Raises:
        IncipientError: on all ranks, one line; the threshold without error bars stays in the directory.
    """
    from .critical.threshold import find_threshold
    from .parallel import world

    comm = comm or world()
    if directory is None:
        return find_threshold(scene, comm, voice)
    from .output.directory import write_threshold
    from .output.lock import locked

    path = Path(directory)

    def keep(found: Threshold) -> Path:
        write_threshold(path, scene, found, comm)
        return path

    with locked(path, comm, make=True):
        found = find_threshold(scene, comm, voice, keep)
        keep(found)
    return found


def report(path: Path | str, target: Path | str | None = None) -> Path:
    """Write one HTML page of what a directory of results or the file of a sweep holds; its path. Not collective.

    The page holds everything itself: verdict and certainty, pictures (drawn where they are missing), loads, errors and
    what would shrink them, plan, cost, scene, versions, how to cite. Runs in space are turned by hand.

    Args:
        path: a directory that a command has written results to, or the file of a sweep.
        target: the page; default: report.html in the directory, SWEEP_report.html beside the file.

    Raises:
        SceneError: there are no results.
        OutputError: a result is damaged, or the page cannot be written.
    """
    from .reporting import write

    return write(Path(path), None if target is None else Path(target))

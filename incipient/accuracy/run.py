"""The run of a scene with its error bars, to a requested accuracy."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TYPE_CHECKING

from ..errors import IncipientError
from ..interrupt import Interruption, told_where_kept
from ..parallel import Comm
from ..progress import Silent
from ..results.errorbars import ErrorBars
from ..results.result import Result
from ..scene import Scene
from ..simulation.assemble import completed, outcome
from ..simulation.recorder import Recorder
from ..simulation.simulate import solved
from ..simulation.state import Run

if TYPE_CHECKING:
    from ..restart import Checkpoint


def run_scene(
    scene: Scene,
    comm: Comm,
    recorder: Recorder | None = None,
    voice: Silent | None = None,
    checkpoint: Checkpoint | None = None,
) -> Result:
    """Run a scene from plan to verdict with its error bars, from the start or from a checkpoint. Collective.

    With `numerics.accuracy` meshes are refined; the recorder receives the last run. Raises IncipientError on all ranks.
    """
    recorder = recorder or Recorder()
    if scene.numerics.accuracy is None or checkpoint is not None:
        with solved(scene, comm, recorder, voice, checkpoint) as run:
            return finished(run, recorder)
    from .searches import DualWeighted, InTime, Uniform

    steady = Uniform if scene.is_averaged else DualWeighted
    search = steady if scene.time is None else InTime
    with Interruption(comm) if recorder.keeps else nullcontext():
        result: Result = search(scene, comm, recorder, voice or Silent()).result()
        return result


def finished(run: Run, recorder: Recorder) -> Result:
    """Compute verdict and error bars, and record the result. Collective.

    The result is first recorded without error bars: estimates may take as long as the run. A failed estimate is
    reported in the result. Raises Interrupted with the directory of the result.
    """
    result = outcome(run)
    estimated = run.scene.numerics.error_bars
    with told_where_kept(recorder.provisional(result), run.comm) if estimated else nullcontext():
        result = completed(run, result, *_bars(run, result))
    recorder.finish(result)
    return result


def _bars(run: Run, result: Result) -> tuple[ErrorBars | None, str]:
    if not run.scene.has_error_bars:
        return None, run.scene.no_error_bars
    # Runs without error bars import none of it.
    from .errorbars import error_bars

    with run.stage("error bars"):
        try:
            return error_bars(run, result.force, result.torque), ""
        except IncipientError as error:
            return None, f"not computed: {error}"

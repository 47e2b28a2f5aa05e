"""The run of a scene with its error bars, to a requested accuracy."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TYPE_CHECKING

from ..interrupt import Interruption
from ..parallel import Comm
from ..progress import Silent
from ..results.result import Result
from ..scene import Scene
from ..simulation.simulate import solved
from ..simulation.state import Recorder
from .finish import finished

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
    from .searches import Compared, DualWeighted

    search = Compared if scene.is_averaged or scene.time is not None else DualWeighted
    with Interruption(comm) if recorder.keeps else nullcontext():
        result: Result = search(scene, comm, recorder, voice or Silent()).result()
        return result

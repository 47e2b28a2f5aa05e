"""Runs a scene with `numerics.accuracy` on meshes, orders and steps of the program's choice."""

from __future__ import annotations

from contextlib import nullcontext

from ..interrupt import Interruption
from ..parallel import Comm
from ..progress import Silent
from ..results.result import Result
from ..scene import Scene
from ..simulation.recorder import Recorder
from .balancing import Balancing
from .refinement import Refinement
from .uniform import UniformRefinement


def run_to_accuracy(
    scene: Scene, comm: Comm, recorder: Recorder | None = None, voice: Silent | None = None
) -> Result:
    """Run a scene with `numerics.accuracy` on meshes of the program's choice. Collective over `comm`.

    The recorder is handed the last run; it may begin again. Raises IncipientError if no mesh could be solved on.
    """
    steady = UniformRefinement if scene.is_averaged else Refinement
    search = steady if scene.time is None else Balancing
    recorder = recorder or Recorder()
    with Interruption(comm) if recorder.keeps else nullcontext():
        seeking = search(scene, comm, recorder, voice or Silent())
        seeking.choose_gap_and_domain()
        return seeking.result()

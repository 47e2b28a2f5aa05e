"""Simulation of a scene."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from typing import TYPE_CHECKING

from ..errors import IncipientError, Interrupted, OutputError
from ..interrupt import Interruption
from ..parallel import Comm
from ..progress import Silent
from ..results.errorbars import Loads
from ..scene import Scene
from .assemble import outcome
from .build import prepared
from .loads import loads_of_run
from .state import Accounts, Recorder, Run
from .steady import loads_at, solve_with_turbulence

if TYPE_CHECKING:
    from ..restart import Checkpoint


@contextmanager
def solved(
    scene: Scene,
    comm: Comm,
    recorder: Recorder | None = None,
    voice: Silent | None = None,
    checkpoint: Checkpoint | None = None,
    accounts: Accounts | None = None,
    near: Run | None = None,
) -> Iterator[Run]:
    """Solve the run of a scene from the start or a checkpoint; freed at the end. Collective over `comm`.

    near: see `solve_with_turbulence`.

    Raises IncipientError on all ranks, after recording earlier results.
    """
    recorder, interruption = recorder or Recorder(), Interruption(comm)
    with (
        interruption if recorder.keeps else nullcontext(),
        prepared(scene, comm, accounts, recorder, voice, checkpoint) as run,
    ):
        try:
            if scene.time is None:
                solve_with_turbulence(run, run.fluid, run.turbulence, near)
                recorder.fields(run, 0, last=True)
            else:
                from .time_loop import TimeLoop

                TimeLoop(run, recorder, interruption, checkpoint).to_the_end()
        except Interrupted:
            raise
        except IncipientError as error:
            with suppress(OutputError):  # report a full disk once, after other failures
                recorder.finish(outcome(run, "failed", str(error)))
            raise
        yield run


def loads_of(scene: Scene, comm: Comm, speed: float = 1.0, near: Run | None = None) -> Loads:
    """Final force and torque in a scene; a steady flow may be `speed` times the scene's. Collective.

    near: see `solve_with_turbulence`.
    """
    if speed == 1.0:
        with solved(scene, comm, near=near) as run:
            return loads_of_run(run)
    with prepared(scene, comm, speed=speed) as run:
        return loads_of_run(run, loads_at(run, speed, near=near))

"""Runs a scene: builds what its plan names, solves, reads the tractions, judges.

One data flow: scene, plan, fluid, tractions, contact, result. Files and terminal are served through a `Recorder` and
a voice; this module writes nothing. The state of a run is in `state`, what makes it in `build`, its steps in time in
`time_loop`, and its result in `assemble`.
"""

from __future__ import annotations

from contextlib import nullcontext, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import IncipientError, Interrupted, OutputError
from ..interrupt import Interruption, told_where_kept
from ..parallel import Comm
from ..planning.layout import coarse_sizes
from ..progress import Silent
from ..results.errorbars import Loads
from ..results.loads import Couples, Forces
from ..results.result import Result
from ..scene import Scene
from .assemble import outcome, with_estimates
from .beside import Beside
from .build import prepared
from .recorder import Recorder, record_fields
from .state import Accounts, Run
from .steady import loads_at, solve_with_parts

if TYPE_CHECKING:
    from ..restart.checkpoint import Checkpoint


def simulate(
    scene: Scene,
    comm: Comm,
    recorder: Recorder | None = None,
    voice: Silent | None = None,
    checkpoint: Checkpoint | None = None,
    accounts: Accounts | None = None,
    follows: bool = True,
) -> Result:
    """Run a scene from plan to verdict, from the start or from a checkpoint of it. Collective over `comm`.

    With `follows` a grain that the load moves is followed to where it rests again, if it does.

    Raises:
        IncipientError: on all ranks; what was computed before it has been handed to the recorder.
    """
    recorder, interruption = recorder or Recorder(), Interruption(comm)
    with (
        interruption if recorder.keeps else nullcontext(),
        prepared(scene, comm, accounts, recorder, voice, checkpoint) as run,
    ):
        _solve(run, recorder, interruption, checkpoint)
        return finished(run, recorder, follows)


def hand_over(run: Run, recorder: Recorder) -> Path | None:
    """Hand a solved steady flow over to a recorder, with all but the error bars; where it is kept. Collective."""
    recorder.begin(run.scene, run.plan, run.domain)
    record_fields(recorder, run, 0, last=True)
    return recorder.provisional(outcome(run))


def finished(run: Run, recorder: Recorder, follows: bool = True) -> Result:
    """Judge what has been solved, estimate errors, and hand the result over. Collective.

    The result is handed over before the errors are estimated, too: that may take as long as the run. Raises Interrupted
    meanwhile, which says where the result without them is kept.
    """
    result = outcome(run)
    estimated = run.scene.numerics.error_bars
    with told_where_kept(recorder.provisional(result), run.comm) if estimated else nullcontext():
        improve = partial(improved_loads, comm=run.comm)
        beside = Beside(run, loads_of)
        result = with_estimates(run, result, beside, improve, follows)
    recorder.finish(result)
    return result


def loads_of(scene: Scene, comm: Comm, speed: float = 1.0) -> Loads:
    """Run a scene for its force and couple at the end; a steady flow may be `speed` times the scene's. Collective."""
    if speed == 1.0:
        return simulate(scene, comm, follows=False).loads_at_end()
    with prepared(scene, comm, speed=speed) as run:
        return _loads_in(run, *loads_at(run, speed))


def _loads_in(run: Run, force: Forces, couple: Couples) -> Loads:
    """Force and couple of a run, with what they still change by."""
    assert run.scene.grain is not None
    return Loads.at_the_end(force, couple, None, None, run.wall_report(), run.scene.grain.size)


def improved_loads(scene: Scene, comm: Comm, speed: float = 1.0) -> Loads:
    """Force and couple of a steady flow on coarser cells, less their estimated errors. Collective."""
    from ..accuracy.dual import COARSER_CELLS, GoalErrors

    sizing = partial(coarse_sizes, COARSER_CELLS, None)
    with prepared(scene, comm, sizing=sizing, speed=speed) as run:
        loads_at(run, speed)
        assert run.layout.placement is not None
        with GoalErrors(run.fluid, "body", run.layout.placement.centre) as goals:
            if goals.is_upwinded:
                goals.correct_again()
            return goals.loads(speed * run.fluid.reynolds / run.plan.reynolds)


def _solve(
    run: Run, recorder: Recorder, interruption: Interruption, checkpoint: Checkpoint | None
) -> None:
    try:
        if run.scene.time is None:
            solve_with_parts(run, run.fluid, run.parts)
            record_fields(recorder, run, 0, last=True)
        else:
            from .time_loop import TimeLoop

            TimeLoop(run, recorder, interruption, checkpoint).to_the_end()
    except Interrupted:
        raise
    except IncipientError as error:
        with suppress(OutputError):  # a full disk is reported once, and another failure before it
            recorder.finish(outcome(run, "failed", str(error)))
        raise

"""Result and error bars of a solved run."""

from __future__ import annotations

from contextlib import nullcontext
from functools import partial

from ..errors import IncipientError
from ..interrupt import told_where_kept
from ..parallel import Comm
from ..planning.layout import coarse_sizes
from ..results.errorbars import ErrorBars, Loads
from ..results.result import Result
from ..scene import Scene
from ..simulation.assemble import completed, outcome
from ..simulation.build import prepared
from ..simulation.recorder import Recorder
from ..simulation.simulate import loads_of
from ..simulation.state import Run
from ..simulation.steady import loads_at

COARSER_CELLS = 1.5  # factor on the cells of the run with improved loads


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
    from ..simulation.beside import Beside
    from .errorbars import coarse_scenes, error_bars

    solve = Beside(run, coarse_scenes, loads_of)
    improve = partial(improved_loads, comm=run.comm)
    with run.stage("error bars"):
        try:
            return error_bars(run, result.force, result.torque, solve, improve), ""
        except IncipientError as error:
            return None, f"not computed: {error}"


def improved_loads(scene: Scene, comm: Comm, speed: float = 1.0) -> Loads:
    """Force and torque of a steady flow on coarser cells, less their estimated errors. Collective."""
    from .dual import GoalErrors
    from .errorbars import unit_of

    sizing = partial(coarse_sizes, COARSER_CELLS, None)
    with prepared(scene, comm, sizing=sizing, speed=speed) as run:
        loads_at(run, speed)
        assert run.layout.placement is not None
        with GoalErrors(run.fluid, "body", run.layout.placement.centre) as goals:
            if goals.is_upwinded:
                goals.correct_again()
            return goals.loads(unit_of(run, speed))

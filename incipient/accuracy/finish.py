"""Result and error bars of a solved run."""

from __future__ import annotations

from contextlib import nullcontext

from ..errors import IncipientError
from ..interrupt import told_where_kept
from ..results.errorbars import ErrorBars
from ..results.result import Result
from ..simulation.assemble import completed, outcome
from ..simulation.loads import loads_of_run
from ..simulation.state import Recorder, Run, record_result


def finished(run: Run, recorder: Recorder) -> Result:
    """Compute verdict and error bars, and record the result. Collective.

    The result is first recorded without error bars: estimates may take as long as the run. A failed estimate is
    reported in the result. Raises Interrupted with the directory of the result.
    """
    result = outcome(run)
    estimated = run.scene.numerics.error_bars
    with told_where_kept(recorder.provisional(result), run.comm) if estimated else nullcontext():
        result = completed(run, result, *_bars(run, result))
    record_result(recorder, run, result)
    return result


def _bars(run: Run, result: Result) -> tuple[ErrorBars | None, str]:
    if not run.scene.has_error_bars:
        return None, run.scene.no_error_bars
    from .errorbars import error_bars

    with run.stage("error bars"):
        try:
            return error_bars(run, loads_of_run(run, result.load)), ""
        except IncipientError as error:
            return None, f"not computed: {error}"

"""Result and error bars of a solved run."""

from __future__ import annotations

from contextlib import nullcontext

from ..errors import IncipientError
from ..interrupt import told_where_kept
from ..results.result import Result
from ..simulation.assemble import completed, outcome
from ..simulation.loads import loads_of_run
from ..simulation.state import Recorder, Run


def finished(run: Run, recorder: Recorder) -> Result:
    """Compute verdict and error bars, and record the result. Collective.

    The result is first recorded without error bars: estimates may take as long as the run. A failed estimate is
    reported in the result. Raises Interrupted with the directory of the result.
    """
    result, scene = outcome(run), run.scene
    bars, why = None, scene.no_error_bars
    estimated = scene.numerics.error_bars
    with told_where_kept(recorder.provisional(result), run.comm) if estimated else nullcontext():
        if estimated and not why:
            from .errorbars import error_bars

            with run.stage("error bars"):
                try:
                    bars = error_bars(run, loads_of_run(run, result.load))
                except IncipientError as error:
                    why = f"not computed: {error}"
        result = completed(run, result, bars, why)
    recorder.finish(result)
    if run.last_checkpoint is not None:
        recorder.keep(run.last_checkpoint)
    return result

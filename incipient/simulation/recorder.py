"""Interface for recording a run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..planning.plan import Plan
from ..results.result import Result
from ..scene import Scene
from .state import Run

if TYPE_CHECKING:
    from ..mesh.domain import Domain
    from ..restart import Checkpoint


class Recorder:
    """Receiver of a run's results; the base class keeps time steps alone, as `rows`. All methods are collective.

    keeps: whether `keep` stores checkpoints.
    """

    keeps = False

    def __init__(self) -> None:
        self.rows: list[dict[str, Any]] = []

    def begin(self, scene: Scene, plan: Plan, domain: Domain) -> None:
        """Begin after meshing."""

    def wants_fields(self, number: int, last: bool) -> bool:
        return False

    def step(self, row: dict[str, Any], contacts: Sequence[dict[str, Any]] = ()) -> None:
        """Record an accepted time step, and the contacts of a moving grain after it."""
        self.rows.append(row)

    def remeshed(self, domain: Domain) -> None:
        """Record that later fields are on another mesh."""

    def fields(self, time: float, fields: dict[str, Any], traction: Any) -> None:
        """Record fields, and the traction on the grain (None without one)."""

    def keep(self, checkpoint: Checkpoint) -> Path | None:
        """Store a checkpoint; returns its directory, if any."""
        return None

    def provisional(self, result: Result) -> Path | None:
        """Store a result without error bars until `finish`; returns its directory, if any."""
        return None

    def finish(self, result: Result) -> None:
        """Record the result of a run, complete or not."""


def record_result(recorder: Recorder, run: Run, result: Result) -> None:
    """Record the result of a run, then the checkpoint of its last step, if any. Collective."""
    recorder.finish(result)
    if run.last_checkpoint is not None:
        recorder.keep(run.last_checkpoint)


def record_fields(recorder: Recorder, run: Run, number: int, last: bool) -> None:
    """Record the fields after a step on request. Collective."""
    if not recorder.wants_fields(number, last):
        return
    from ..fluid.derived import vorticity

    with run.stage("fields"):
        fluid, probe = run.fluid, run.probe
        fields = {
            "velocity": fluid.velocity,
            "pressure": fluid.pressure,
            "vorticity": vorticity(fluid),
        }
        if run.turbulence is not None:
            fields |= run.turbulence.functions()
        recorder.fields(fluid.time, fields, probe.field() if probe else None)

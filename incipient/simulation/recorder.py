"""Where a run leaves its results, and what it hands over."""

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
    from ..restart.checkpoint import Checkpoint


class Recorder:
    """Receiver of a run's results on the way; this one keeps nothing. All methods are collective.

    `keeps` says whether `keep` does anything.
    """

    keeps = False

    def begin(self, scene: Scene, plan: Plan, domain: Domain) -> None:
        """The mesh is there; computation begins."""

    def wants_fields(self, number: int, last: bool) -> bool:
        """Whether the fields of this step shall be handed over."""
        return False

    def step(self, row: dict[str, Any]) -> None:
        """A time step was accepted."""

    def contacts(self, rows: Sequence[dict[str, Any]]) -> None:
        """Take note of the contacts of a moving grain at the end of a step."""

    def remeshed(self, domain: Domain) -> None:
        """Take note that fields are on another mesh from now on."""

    def fields(self, time: float, fields: dict[str, Any], traction: Any) -> None:
        """Fields on the mesh, and the traction on the grain's surface (None without a grain)."""

    def keep(self, checkpoint: Checkpoint) -> Path | None:
        """Keep what the run needs to resume; where, None if nowhere."""
        return None

    def provisional(self, result: Result) -> Path | None:
        """The run is over but for its error bars; where this result is kept until `finish`, None if nowhere."""
        return None

    def finish(self, result: Result) -> None:
        """The run is over, whether complete or not."""


def record_fields(recorder: Recorder, run: Run, number: int, last: bool) -> None:
    """Hand the fields after a step of this number over to the recorder if it wants them. Collective."""
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
        for part in run.parts:
            fields |= part.functions()
        recorder.fields(fluid.time, fields, probe.field() if probe else None)

"""The result directory of a run, readable at any time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..files import append_row, cut_after, make_directory, sync, write_json
from ..parallel import Comm, collectively, on_first
from ..planning.plan import Plan
from ..results.result import Result
from ..scene import Scene
from ..scene.file import dumps
from ..simulation.recorder import Recorder
from .ownership import (
    CHECKPOINT,
    CONTACTS,
    FILES,
    HISTORY,
    PICTURES,
    RESULT,
    keep_complete_result,
    make_room,
    place_scene,
    remove,
)

if TYPE_CHECKING:
    from ..mesh.domain import Domain
    from ..restart.checkpoint import Checkpoint
    from .xdmf import FieldSeries


class ResultDirectory(Recorder):
    """Records a run in a directory. Every method is collective, and raises OutputError on all ranks.

    The directory is unchanged until a run begins. Then an earlier run is moved or removed (`ownership`). With a
    checkpoint later steps are dropped and the series continue; the earlier result stays until the new one.
    """

    keeps = True

    def __init__(
        self, path: Path, comm: Comm, resumed: Checkpoint | None = None, overwrite: bool = False
    ):
        self.path, self.comm, self._resumed = path, comm, resumed
        self._overwrite = overwrite
        self._series: dict[str, FieldSeries] = {}

    def begin(self, scene: Scene, plan: Plan, domain: Domain) -> None:
        """Write the resolved scene, and open the field series if requested. A second call restarts."""
        self._output, self._series = scene.output, {}
        on_first(self.comm, self._make_ready, scene)
        self._overwrite = True  # later files belong to this run
        if scene.output.fields:
            from .xdmf import FieldSeries

            after = -math.inf if self._resumed is None else self._resumed.time
            for name, facets in _parts(domain).items():
                self._series[name] = FieldSeries(
                    self.path / name, domain.mesh, self.comm, after, facets
                )

    def _make_ready(self, scene: Scene) -> None:
        if self._resumed is None:
            make_directory(self.path)
            make_room(self.path, self._overwrite)
        else:
            cut_after(self.path / HISTORY, self._resumed.time, self._resumed.progress.number)
            cut_after(self.path / CONTACTS, self._resumed.time)
        place_scene(self.path, dumps(scene), FILES)

    def wants_fields(self, number: int, last: bool) -> bool:
        """Whether the fields of a step are written: at the end, and at the scene's interval."""
        every = self._output.every
        return bool(self._series) and (last or (every > 0 and number % every == 0))

    def step(self, row: dict[str, Any]) -> None:
        on_first(self.comm, append_row, self.path / HISTORY, row)

    def contacts(self, rows: Sequence[dict[str, Any]]) -> None:
        with collectively(self.comm):
            for row in rows if self.comm.rank == 0 else ():
                append_row(self.path / CONTACTS, row)

    def remeshed(self, domain: Domain) -> None:
        for name, facets in _parts(domain).items() if self._series else ():
            self._series[name].remeshed(domain.mesh, facets)

    def fields(self, time: float, fields: dict[str, Any], traction: Any) -> None:
        self._series["fields"].write(time, fields)
        if "surface" in self._series and traction is not None:
            self._series["surface"].write(time, {"traction": traction})

    def keep(self, checkpoint: Checkpoint) -> Path:
        from ..restart import checkpoint as checkpoints

        on_first(self.comm, sync, self.path / HISTORY)  # the checkpoint relies on its rows
        checkpoints.write(self.path / CHECKPOINT, checkpoint, self.comm)
        return self.path

    def provisional(self, result: Result) -> Path:
        on_first(self.comm, self._write, result)
        return self.path

    def finish(self, result: Result) -> None:
        """Write result.json; keep the checkpoint on the scene's request or if the grain ended the run."""
        on_first(self.comm, self._write, result)
        wanted = result.scene["output"]["checkpoint"] or result.ended_early
        if result.status == "complete" and not wanted:
            on_first(self.comm, remove, [self.path / CHECKPOINT])

    def _write(self, result: Result) -> None:
        if self._resumed is not None:
            remove([self.path / name for name in PICTURES])
            if result.status != "complete":
                keep_complete_result(self.path)
        write_json(self.path / RESULT, result.to_dict())


def _parts(domain: Domain) -> dict[str, Any]:
    """Facets of the series of a mesh by name; None: all cells."""
    return {"fields": None} | (
        {"surface": domain.facets_of("body")} if "body" in domain.names else {}
    )

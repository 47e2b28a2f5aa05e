"""Runs of scenes, new or resumed, with a result directory."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..accuracy.run import run_scene
from ..errors import SceneError, refuse_broken
from ..files import append_row, cut_after, sync, write_json
from ..interrupt import one_at_a_time
from ..parallel import Comm, from_first, on_first, world
from ..planning.discretisation import order_of, with_order
from ..progress import Silent
from ..results.result import Result
from ..scene import Scene, Time, load
from ..scene.file import dumps, loads
from ..simulation.state import Recorder, Run
from .ownership import (
    CHECKPOINT,
    CONTACTS,
    FILES,
    HISTORY,
    PICTURES,
    RESULT,
    SCENE,
    keep_complete_result,
    locked,
    make_room,
    place_scene,
    remove,
)

if TYPE_CHECKING:
    from ..mesh.domain import Domain
    from ..restart import Checkpoint
    from .xdmf import FieldSeries

# Keys that may change on resumption: end time, step control, remeshing and its cells, output. Checkpoints are
# independent of all of them.
MAY_CHANGE = (
    *("time.end", "time.step", "time.first_step", "time.tolerance", "time.until_steady"),
    *("output.every", "output.checkpoint", "output.pictures"),
    *("numerics.tolerance", "numerics.stabilisation", "numerics.convection", "numerics.error_bars"),
)
MAY_CHANGE_IF_THE_GRAIN_MOVES = (
    *(
        "numerics.remesh_below",
        "numerics.mesh_size",
        "numerics.interface_tolerance",
    ),
    *("contact.gap", "time.until"),
)


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

    def begin(self, scene: Scene, domain: Domain) -> None:
        """Write the resolved scene, and open the field series if requested. A second call restarts."""
        self._output, self._series, self._domain = scene.output, {}, domain
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
            make_room(self.path, self._overwrite)
        else:
            cut_after(self.path / HISTORY, self._resumed.time, self._resumed.progress["number"])
            cut_after(self.path / CONTACTS, self._resumed.time)
        place_scene(self.path, dumps(scene), FILES)

    def step(self, row: dict[str, Any], contacts: Sequence[dict[str, Any]] = ()) -> None:
        on_first(self.comm, self._append, row, contacts)

    def _append(self, row: dict[str, Any], contacts: Sequence[dict[str, Any]]) -> None:
        append_row(self.path / HISTORY, row)
        for contact in contacts:
            append_row(self.path / CONTACTS, contact)

    def fields(self, run: Run, number: int, last: bool) -> None:
        """Write the fields of a step at the end, and at the scene's interval."""
        every, fluid, probe = self._output.every, run.fluid, run.probe
        if not self._series or not (last or (every > 0 and number % every == 0)):
            return
        from ..fluid.derived import vorticity

        with run.stage("fields"):
            if run.domain is not self._domain:
                self._domain = run.domain
                for name, facets in _parts(run.domain).items():
                    self._series[name].remeshed(run.domain.mesh, facets)
            fields = {
                "velocity": fluid.velocity,
                "pressure": fluid.pressure,
                "vorticity": vorticity(fluid),
            }
            if run.turbulence is not None:
                fields |= run.turbulence.functions()
            self._series["fields"].write(fluid.time, fields)
            if "surface" in self._series and probe is not None:
                self._series["surface"].write(fluid.time, {"traction": probe.field()})

    def keep(self, checkpoint: Checkpoint) -> Path:
        from .. import restart as checkpoints

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


@one_at_a_time
def run(
    scene: Scene,
    directory: Path | str | None = None,
    comm: Comm | None = None,
    voice: Silent | None = None,
    overwrite: bool = False,
) -> Result:
    """Simulate a scene and judge its grain. Collective over `comm` (default: all ranks).

    Args:
        directory: for the resolved scene, result.json, history and fields; None writes nothing. An earlier run there is
            removed, or moved to a numbered directory if it can be resumed.
        voice: reports progress; default: none.
        overwrite: remove an earlier run even if it can be resumed.

    Raises:
        IncipientError: on all ranks, one line; earlier results stay in the directory.
    """
    comm = comm or world()
    if directory is None:
        return run_scene(scene, comm, Recorder(), voice)
    directory = Path(directory)
    with locked(directory, comm, make=True):
        return run_scene(scene, comm, ResultDirectory(directory, comm, overwrite=overwrite), voice)


@one_at_a_time
def resume(
    directory: Path | str,
    overrides: Sequence[str] = (),
    comm: Comm | None = None,
    voice: Silent | None = None,
) -> Result:
    """Resume an interrupted run from its checkpoint, on any number of ranks. Collective over `comm`.

    Args:
        overrides: such as ``"time.end=20"``; `output.runs` lists the keys that may change.
        voice: reports progress; default: none.

    Raises:
        IncipientError: as `run`; also for a checkpoint that is missing, damaged, of another version or scene,
            and for a complete run.
    """
    comm, directory = comm or world(), Path(directory)
    with locked(directory, comm):
        scene, kept = reopened(directory, overrides, comm)
        return run_scene(scene, comm, ResultDirectory(directory, comm, kept), voice, kept)


def reopened(directory: Path, overrides: Sequence[str], comm: Comm) -> tuple[Scene, Checkpoint]:
    """The scene and the checkpoint of an interrupted run, on every rank. Collective; raises as `resume`."""
    from .. import restart as checkpoints  # not needed by most runs

    kept = checkpoints.read(directory / CHECKPOINT, comm)

    def loaded() -> tuple[Scene, Scene]:
        scene, before = load(directory / SCENE, overrides), loads(kept.scene)
        if scene.numerics.order == "auto" and order_of(scene) != order_of(before):
            scene = with_order(scene, order_of(before))  # order of the stored flow
        _require_same(directory / SCENE, scene, before)
        _require_work(scene.time, kept, passes=scene.contact_gap < before.contact_gap)
        return scene, before

    scene, before = from_first(comm, loaded)
    return scene, _adapted(kept, before.time, scene.time)


def _require_same(path: Path, scene: Scene, of_checkpoint: Scene) -> None:
    now, before = (
        dict(_flat(each.model_dump(mode="json"))) | {"numerics.order": order_of(each)}
        for each in (scene, of_checkpoint)
    )
    allowed = MAY_CHANGE + (MAY_CHANGE_IF_THE_GRAIN_MOVES if scene.moves else ())
    kept = {*now, *before} - {*allowed, "title"}
    differing = [key for key in kept if now.get(key) != before.get(key)]
    if differing:
        # Common keys first: keys of one scene alone may depend on others.
        key = min(differing, key=lambda key: (None in (now.get(key), before.get(key)), key))
        raise SceneError(
            f"{path}: {key} is {now.get(key)}, but the run to resume has {before.get(key)}; "
            f"keep that value (only {', '.join(allowed)} may change) or start a new run with: incipient run"
        )


def _require_work(time: Time | None, kept: Checkpoint, passes: bool) -> None:
    assert time is not None
    body = kept.body or {"met": False}
    on_bed = body.get("on_bed", {})
    refuse_broken(
        (
            body["met"] and not passes,
            "the run has ended: its grain reached the bed or a wall; to resume it set a smaller contact.gap",
        ),
        (
            time.until in on_bed.get("done", ()),
            f'the run has ended: its grain has reached time.until = "{time.until}"; '
            "to resume it give another, such as --set time.until=end",
        ),
        (
            time.end - kept.time <= 1e-9 * time.end,
            f"the run has already reached t = {kept.time:g}, and time.end is {time.end:g}; "
            f"to resume it give a later one, such as --set time.end={2 * kept.time:g}",
        ),
    )


def _adapted(kept: Checkpoint, then: Time | None, now: Time | None) -> Checkpoint:
    assert now is not None and then is not None
    if now.step != then.step or (now.tolerance is None and then.tolerance is not None):
        kept = replace(kept, progress=kept.progress | {"next_length": now.step})
    if kept.body is not None:
        kept = replace(kept, body=kept.body | {"met": False})
    return kept


def _flat(data: Any, key: str = "") -> list[tuple[str, Any]]:
    if not isinstance(data, dict):
        return [(key, data)]
    return [pair for k, value in data.items() for pair in _flat(value, f"{key}.{k}" if key else k)]

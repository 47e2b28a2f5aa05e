"""Runs of scenes, new or resumed, with a result directory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..accuracy.run import run_scene
from ..errors import SceneError
from ..interrupt import one_at_a_time
from ..parallel import Comm, from_first, world
from ..planning.discretisation import order_of, with_order
from ..progress import Silent
from ..results.result import Result
from ..scene import Scene, Time, load
from ..scene.file import loads
from ..simulation.recorder import Recorder
from .directory import ResultDirectory
from .ownership import CHECKPOINT, SCENE, locked

if TYPE_CHECKING:
    from ..restart.checkpoint import Checkpoint

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
    from ..restart import checkpoint as checkpoints  # not needed by most runs

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
        dict(_flat(one.model_dump(mode="json"))) | {"numerics.order": order_of(one)}
        for one in (scene, of_checkpoint)
    )
    allowed = MAY_CHANGE + (MAY_CHANGE_IF_THE_GRAIN_MOVES if scene.moves else ())
    differing = {*now, *before} - {*allowed, "title"}
    # Common keys first: keys of one scene alone may depend on others.
    for key in sorted(differing, key=lambda one: (None in (now.get(one), before.get(one)), one)):
        if now.get(key) == before.get(key):
            continue
        raise SceneError(
            f"{path}: {key} is {now.get(key)}, but the run to resume has {before.get(key)}; "
            f"keep that value (only {', '.join(allowed)} may change) or start a new run with: incipient run"
        )


def _require_work(time: Time | None, kept: Checkpoint, passes: bool) -> None:
    assert time is not None
    if kept.body is not None and kept.body.met and not passes:
        remedy = "set a smaller contact.gap"
        raise SceneError(
            f"the run has ended: its grain reached the bed or a wall; to resume it {remedy}"
        )
    if (
        kept.body is not None
        and kept.body.on_bed is not None
        and time.until in kept.body.on_bed["done"]
    ):
        why = f'its grain has reached time.until = "{time.until}"'
        remedy = "give another, such as --set time.until=end"
        raise SceneError(f"the run has ended: {why}; to resume it {remedy}")
    if time.end - kept.time <= 1e-9 * time.end:
        why = f"the run has already reached t = {kept.time:g}, and time.end is {time.end:g}"
        remedy = f"give a later one, such as --set time.end={2 * kept.time:g}"
        raise SceneError(f"{why}; to resume it {remedy}")


def _adapted(kept: Checkpoint, then: Time | None, now: Time | None) -> Checkpoint:
    assert now is not None and then is not None
    if now.step != then.step or (now.tolerance is None and then.tolerance is not None):
        kept = replace(kept, progress=replace(kept.progress, next_length=now.step))
    if kept.body is not None:
        kept = replace(kept, body=replace(kept.body, met=False))
    return kept


def _flat(data: Any, key: str = "") -> list[tuple[str, Any]]:
    if not isinstance(data, dict):
        return [(key, data)]
    return [pair for k, value in data.items() for pair in _flat(value, f"{key}.{k}" if key else k)]

"""The run that a directory holds, opened again: its checkpoint and its scene, if they fit and there is more to do."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import SceneError
from ..parallel import collectively
from ..scene import Scene, load
from ..scene.file import loads
from . import checkpoint as checkpoints
from .checkpoint import Checkpoint

if TYPE_CHECKING:
    from mpi4py import MPI

# What a scene may be resumed with in place of what it was run with.
MAY_CHANGE = ("time.end",)


def reopened(directory: Path, overrides: Sequence[str], comm: MPI.Comm) -> tuple[Scene, Checkpoint]:
    """The scene and the checkpoint of a run that was cut short, on every rank. Collective.

    Raises:
        OutputError: the checkpoint is missing, damaged, incomplete or of another version.
        SceneError: the scene differs from that of the checkpoint, or there is nothing left to compute.
    """
    found = None
    with collectively(comm):
        if comm.rank == 0:
            kept = checkpoints.read(directory / checkpoints.NAME)
            scene = load(directory / "scene.toml", overrides)
            _require_same(directory / "scene.toml", scene, loads(kept.scene))
            _require_work(scene, kept)
            found = scene, kept
    reopened: tuple[Scene, Checkpoint] = comm.bcast(found)
    return reopened


def _require_same(path: Path, scene: Scene, of_checkpoint: Scene) -> None:
    now, before = (dict(_flat(one.model_dump(mode="json"))) for one in (scene, of_checkpoint))
    for key in sorted(now.keys() | before.keys()):
        if now.get(key) != before.get(key) and key not in MAY_CHANGE:
            raise SceneError(
                f"{path}: {key} is {now.get(key)}, but the run to resume has {before.get(key)}; "
                f"leave it so (only {', '.join(MAY_CHANGE)} may change) or start anew with: incipient run"
            )


def _require_work(scene: Scene, kept: Checkpoint) -> None:
    assert scene.time is not None
    if kept.body is not None and kept.body.met:
        raise SceneError("the run has ended: its grain met something; there is nothing to resume")
    if scene.time.end - kept.time <= 1e-9 * scene.time.end:
        raise SceneError(
            f"the run has come to t = {kept.time:g} already and time.end is {scene.time.end:g}; "
            "to go on give a later one, such as --set time.end=" + f"{2 * kept.time:g}"
        )


def _flat(data: Any, key: str = "") -> list[tuple[str, Any]]:
    if not isinstance(data, dict):
        return [(key, data)]
    return [pair for k, value in data.items() for pair in _flat(value, f"{key}.{k}" if key else k)]

"""The run that a directory holds, opened again: its checkpoint and its scene, if they fit and there is more to do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..errors import SceneError
from ..parallel import Comm, from_first
from ..planning.order import order_of, with_order
from ..restart import checkpoint as checkpoints
from ..restart.checkpoint import Checkpoint
from ..scene import Scene, load
from ..scene.file import loads
from .earlier import CHECKPOINT, SCENE

# What a scene may be resumed with in place of what it was run with: where it ends, how its steps are made, when it
# gets new meshes and of what cells, what is written. What is stored fits all of them.
MAY_CHANGE = (
    *("time.end", "time.step", "time.first_step", "time.tolerance", "time.until_steady"),
    *("output.every", "output.checkpoint", "output.pictures"),
    *("numerics.tolerance", "numerics.stabilisation", "numerics.convection", "numerics.error_bars"),
)
MAY_CHANGE_IF_THE_GRAIN_MOVES = (
    *("numerics.remesh_below", "numerics.mesh_size", "numerics.interface_tolerance", "numerics.coupling"),
    "contact.gap",
)
# Where the grain moves a key may take this value, too.
MAY_BECOME = {"body.on_contact": "repel"}


def reopened(directory: Path, overrides: Sequence[str], comm: Comm) -> tuple[Scene, Checkpoint]:
    """The scene and the checkpoint of a run that was cut short, on every rank, of tables its share. Collective.

    Raises:
        OutputError: the checkpoint is missing, damaged, incomplete or of another version.
        SceneError: the scene differs from that of the checkpoint, or there is nothing left to compute.
    """

    kept = checkpoints.read(directory / CHECKPOINT, comm)

    def loaded() -> tuple[Scene, Scene]:
        """The scenes of the directory and of the checkpoint; refused if they do not go together."""
        scene, before = load(directory / SCENE, overrides), loads(kept.scene)
        if scene.numerics.order == "auto" and order_of(scene).number != order_of(before).number:
            scene = with_order(scene, order_of(before).number)  # that of the flow that is stored
        _require_same(directory / SCENE, scene, before)
        _require_work(scene, before, kept)
        return scene, before

    scene, before = from_first(comm, loaded)
    return scene, _adapted(scene, before, kept)


def _require_same(path: Path, scene: Scene, of_checkpoint: Scene) -> None:
    now, before = (
        dict(_flat(one.model_dump(mode="json"))) | {"numerics.order": order_of(one).number}
        for one in (scene, of_checkpoint)
    )
    moves = scene.moves
    allowed = MAY_CHANGE + (MAY_CHANGE_IF_THE_GRAIN_MOVES if moves else ())
    becomes = MAY_BECOME if moves else {}
    for key in sorted(now.keys() | before.keys()):
        if (
            now.get(key) == before.get(key)
            or key in (*allowed, "title")
            or becomes.get(key, ...) == now.get(key)
        ):
            continue
        others = [*allowed, *(f'{name} = "{value}"' for name, value in becomes.items())]
        raise SceneError(
            f"{path}: {key} is {now.get(key)}, but the run to resume has {before.get(key)}; "
            f"leave it so (only {', '.join(others)} may change) or start a new run with: incipient run"
        )


def _require_work(scene: Scene, of_checkpoint: Scene, kept: Checkpoint) -> None:
    assert scene.time is not None
    repelled = scene.body is not None and scene.body.on_contact == "repel"
    met = kept.body is not None and kept.body.met
    if met and not repelled and scene.contact_gap >= of_checkpoint.contact_gap:
        raise SceneError(
            "the run has ended: its grain met something; "
            'to resume it set body.on_contact = "repel", or a smaller contact.gap'
        )
    if scene.time.end - kept.time <= 1e-9 * scene.time.end:
        raise SceneError(
            f"the run has come to t = {kept.time:g} already and time.end is {scene.time.end:g}; "
            "to resume it give a later one, such as --set time.end=" + f"{2 * kept.time:g}"
        )


def _adapted(scene: Scene, of_checkpoint: Scene, kept: Checkpoint) -> Checkpoint:
    """The checkpoint, without what a change of the scene has made void: the step's length, that a wall was met."""
    assert scene.time is not None and of_checkpoint.time is not None
    now, then = scene.time, of_checkpoint.time
    if now.step != then.step or (now.tolerance is None and then.tolerance is not None):
        kept = replace(kept, progress=replace(kept.progress, next_length=scene.time.step))
    if kept.body is not None:
        kept = replace(kept, body=replace(kept.body, met=False))
    return kept


def _flat(data: Any, key: str = "") -> list[tuple[str, Any]]:
    if not isinstance(data, dict):
        return [(key, data)]
    return [pair for k, value in data.items() for pair in _flat(value, f"{key}.{k}" if key else k)]

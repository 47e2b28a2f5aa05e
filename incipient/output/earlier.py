"""What an earlier run has left in a directory: its files, and how they make room for those of another.

Nothing here is collective.
"""

from __future__ import annotations

import json
import logging
import re
import shutil
from pathlib import Path

from ..files import numbered, reported

log = logging.getLogger("incipient")

SCENE, RESULT, CHECKPOINT, CONTACTS = "scene.toml", "result.json", "checkpoint.h5", "contacts.csv"
SERIES = tuple(
    f"{name}.{ending}" for name in ("fields", "surface") for ending in ("xdmf", "h5", "h5.journal", "vtkhdf")
)
DATA = (RESULT, "history.csv", CONTACTS, *SERIES, "threshold.json")
DRAWN = (
    *("flow", "pressure", "vorticity", "traction", "verdict"),
    *("profiles", "mesh", "trajectory", "walls", "elevation"),
)
PICTURES = (
    *(f"{name}.png" for name in DRAWN),
    *(f"{name}.gif" for name in ("velocity", "pressure", "vorticity")),
    "report.html",
)
FILES = {*DATA, *PICTURES, "threshold.png", CHECKPOINT}


def make_room(directory: Path, overwrite: bool) -> None:
    """Remove an earlier run, or move it to a numbered neighbour if it can be resumed and is not to be overwritten.

    Only files that runs write are touched; the scene stays, and a copy of it goes along.

    Raises:
        OutputError: when they cannot be removed or moved.
    """
    found = [path for path in directory.iterdir() if _is_of_a_run(path.name)]
    if overwrite or not (directory / CHECKPOINT).exists():
        _remove(found)
    else:
        neighbour = _move(found, directory)
        log.warning("%s: the earlier run there, which can be resumed, is now in %s", directory, neighbour)


def remove_pictures(directory: Path) -> None:
    """Remove the pictures of a run: it has gone on since they were drawn.

    Raises:
        OutputError: when they cannot be removed.
    """
    _remove([directory / name for name in PICTURES])


def keep_complete_result(directory: Path) -> None:
    """Give the result of a run that had come to its end another name, as it is to be replaced by less.

    Raises:
        OutputError: when it cannot be renamed.
    """
    path = directory / RESULT
    try:
        complete = json.loads(path.read_text())["status"] == "complete"
    except (OSError, ValueError, KeyError, TypeError):
        return
    if complete:
        put_aside(path)


def put_aside(path: Path) -> Path:
    """Rename a file to the next numbered name that is free, which is returned.

    Raises:
        OutputError: when it cannot be renamed.
    """
    aside = numbered(path)
    with reported(aside):
        path.rename(aside)
    return aside


def _is_of_a_run(name: str) -> bool:
    """Whether runs write a file of this name, or put one aside that was called so."""
    return re.sub(r"\.\d+$", "", name) in FILES


def _remove(paths: list[Path]) -> None:
    for path in paths:
        with reported(path):
            path.unlink(missing_ok=True)


def _move(paths: list[Path], directory: Path) -> Path:
    """Move files, the checkpoint last, and a copy of the scene to a new directory beside theirs."""
    neighbour = numbered(directory.resolve())
    with reported(neighbour):
        neighbour.mkdir()
        if (directory / SCENE).exists():
            shutil.copy2(directory / SCENE, neighbour)
        for path in sorted(paths, key=lambda path: path.name == CHECKPOINT):
            shutil.move(path, neighbour)
    return neighbour

"""Which files of a directory are those of runs, by their contents, and how they make room for others.

No other file is replaced or removed. Nothing here is collective.
"""

from __future__ import annotations

import json
import logging
import re
import shutil
import tomllib
from collections.abc import Collection, Iterable
from pathlib import Path

import tomli_w

from ..errors import OutputError
from ..files import numbered, reported

log = logging.getLogger("incipient")

SCENE, RESULT, CHECKPOINT, CONTACTS = "scene.toml", "result.json", "checkpoint.h5", "contacts.csv"
SERIES = tuple(
    f"{name}.{ending}"
    for name in ("fields", "surface")
    for ending in ("xdmf", "h5", "h5.journal", "vtkhdf")
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
REMEDY = "choose another directory, or move it away"
# What the first lines, or the first keys, of a file of this name are.
KEYS: dict[str, Collection[str]] = {
    "result.json": ("schema_version", "status", "scene", "plan"),
    "threshold.json": ("schema_version", "trials", "contacts"),
    "judgement.json": ("verdict", "probabilities"),
    "series.json": ("samples", "shares", "events"),
    "batch.json": ("cases", "failed", "modes"),
    "survey.json": ("request", "exposed", "mobile"),
}
HEADS = {
    "history.csv": "time,step,newton,",
    "contacts.csv": "time,contact,x,y,",
    "cost.csv": "order,mesh_size",
    "series.csv": "time,safety_factor,mode",
    "verdicts.csv": "row,name,safety_factor",
}
SECTIONS = (
    "domain",
    "fluid",
    "flow",
    "effects",
    "numerics",
    "output",
)  # of a scene that a run has written


def make_room(directory: Path, overwrite: bool) -> None:
    """Remove an earlier run, or move it to a numbered neighbour if it can be resumed and is not to be overwritten.

    Only files that runs write are touched; the scene stays, and a copy of it goes along. Raises OutputError.
    """
    # Files that runs write, or have put aside.
    found = [path for path in directory.iterdir() if re.sub(r"\.\d+$", "", path.name) in FILES]
    if overwrite or not (directory / CHECKPOINT).exists():
        _remove(found)
    else:
        neighbour = _move(found, directory)
        log.warning(
            "%s: the earlier run there, which can be resumed, is now in %s", directory, neighbour
        )


def remove_pictures(directory: Path) -> None:
    """Remove the pictures of a run, which has gone on since they were drawn; raises OutputError."""
    _remove([directory / name for name in PICTURES])


def keep_complete_result(directory: Path) -> None:
    """Give the result of a run that had come to its end another name, before less replaces it; raises OutputError."""
    path = directory / RESULT
    try:
        complete = json.loads(path.read_text())["status"] == "complete"
    except (OSError, ValueError, KeyError, TypeError):
        return
    if complete:
        put_aside(path)


def put_aside(path: Path) -> Path:
    """Rename a file to the next numbered name that is free, which is returned; raises OutputError."""
    aside = numbered(path)
    with reported(aside):
        path.rename(aside)
    return aside


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


def refuse_foreign(directory: Path, names: Iterable[str] = ()) -> None:
    """Refuse a directory in which a file has a name that a run writes but was not written by one, or is a link.

    `names` are those of the files to be written; none: those of a run. Raises OutputError, which names the file.
    """
    wanted = set(names) or {*FILES, SCENE}
    for path in sorted(directory.iterdir()) if directory.is_dir() else ():
        name = re.sub(r"(\.\d+|\.part)$", "", path.name)
        if name not in wanted:
            continue
        if path.is_symlink():
            raise OutputError(f"{path}: is a link, and nothing is written through links; {REMEDY}")
        if path.suffix != ".part" and path.exists() and not _is_own(path, name):
            raise OutputError(
                f"{path}: is not of an incipient run, which would replace it; {REMEDY}"
            )


def _is_own(path: Path, name: str) -> bool:
    """Whether a run wrote a file, by what it holds; fields and pictures by the scene beside them."""
    try:
        if name in KEYS:
            held = json.loads(path.read_bytes())
            return isinstance(held, dict) and set(KEYS[name]) <= held.keys()
        if name in HEADS:
            with path.open(encoding="utf-8") as stream:
                return stream.readline(4096).startswith(HEADS[name])
        if name == "verdicts.parquet":
            return _is_own(path.with_name("batch.json"), "batch.json")
        if name == "report.html":
            return b"incipient" in path.read_bytes()
        return path.is_file() and _is_written_scene(path.with_name(SCENE))
    except (OSError, ValueError):
        return False


def _is_written_scene(path: Path) -> bool:
    """Whether a file is a scene as runs write it before anything else: complete, and without a word of anybody's."""
    text = path.read_text(encoding="utf-8")
    held = tomllib.loads(text)
    return (
        all(isinstance(held.get(name), dict) for name in SECTIONS) and tomli_w.dumps(held) == text
    )

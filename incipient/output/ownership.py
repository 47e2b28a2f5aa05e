"""Which files of a directory are results of incipient, and how they make room for others.

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
from ..files import MARK, numbered, own, owned, reported, require_own, write_text_atomically

log = logging.getLogger("incipient")

SCENE, RESULT, CHECKPOINT, CONTACTS = "scene.toml", "result.json", "checkpoint.h5", "contacts.csv"
SERIES = tuple(
    f"{name}.{ending}"
    for name in ("fields", "surface")
    for ending in ("xdmf", "h5", "h5.journal", "vtkhdf")
)
DATA = (RESULT, "history.csv", CONTACTS, *SERIES)
DRAWN = (
    *("flow", "pressure", "vorticity", "traction", "verdict"),
    *("profiles", "mesh", "trajectory", "walls", "elevation"),
)
PICTURES = (
    *(f"{name}.png" for name in DRAWN),
    *(f"{name}.gif" for name in ("velocity", "pressure", "vorticity")),
    "report.html",
)
FILES = {*DATA, *PICTURES, CHECKPOINT}
# Results of the other commands that leave their scene beside them.
OTHERS = {
    "threshold": {"threshold.json", "threshold.png"},
    "gusts": {"gusts.json", "gusts.csv", "gusts.png"},
    "entrainment": {"entrainment.json", "entrainment.csv", "entrainment.png"},
    "cost": {"cost.json", "cost.csv", "cost.png"},
}
RESULTS = FILES.union(*OTHERS.values())
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
    found = _there(directory, FILES)
    if overwrite or not (directory / CHECKPOINT).exists():
        _remove(found)
    else:
        _move(found, directory, "the earlier run there, which can be resumed,")


def place_scene(directory: Path, text: str, names: Collection[str] = ()) -> None:
    """Write the scene that results belong to; those of another scene move to a numbered neighbour first.

    `names` are of results that stay, since they are about to be replaced. Raises OutputError.
    """
    path = directory / SCENE
    others = _there(directory, RESULTS - {*names})
    if others and path.exists() and path.read_bytes() != text.encode():
        _move(others, directory, "what is there of another scene")
    write_text_atomically(path, text)
    own(directory, {SCENE: None})  # whoever changes a number in it may resume the run


def _there(directory: Path, names: Collection[str]) -> list[Path]:
    """The files of these names in a directory, also those that were put aside."""
    return [path for path in directory.iterdir() if re.sub(r"\.\d+$", "", path.name) in names]


def remove_pictures(directory: Path) -> None:
    """Remove the pictures of a run, which has gone on since they were drawn; raises OutputError."""
    _remove([directory / name for name in PICTURES])


def keep_complete_result(directory: Path) -> None:
    """Give the result of a run that had come to its end another name, before less replaces it; raises OutputError."""
    path = directory / RESULT
    try:
        complete = json.loads(path.read_text())["status"] == "complete"
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return
    if complete:
        put_aside(path)


def put_aside(path: Path) -> Path:
    """Rename a file to the next numbered name that is free, which is returned; raises OutputError."""
    aside = numbered(path)
    with reported(aside):
        path.rename(aside)
    own(aside.parent, {aside.name: aside.stat().st_size})
    return aside


def _remove(paths: list[Path]) -> None:
    for path in paths:
        with reported(path):
            path.unlink(missing_ok=True)


def _move(paths: list[Path], directory: Path, what: str) -> None:
    """Move files, the checkpoint last, and a copy of the scene to a new directory beside theirs, and say so."""
    neighbour = numbered(directory.resolve())
    with reported(neighbour):
        neighbour.mkdir()
        if (directory / SCENE).exists():
            shutil.copy2(directory / SCENE, neighbour)
        for path in sorted(paths, key=lambda path: path.name == CHECKPOINT):
            shutil.move(path, neighbour)
    sizes = {path.name: (neighbour / path.name).stat().st_size for path in paths}
    own(neighbour, {**sizes, SCENE: None})
    log.warning("%s: %s is now in %s", directory, what, neighbour)


def refuse_foreign(
    directory: Path,
    names: Iterable[str] = (),
    sources: Iterable[Path] = (),
    resumed: bool = False,
) -> None:
    """Refuse a directory in which a file to be written is a link, not incipient's, or one that is read.

    Args:
        names: of the files to be written; none: those of all commands with a scene.
        sources: files that are read.
        resumed: a run is, which says itself what is wrong with files that have grown.

    Raises:
        OutputError: naming the file.
    """
    if not directory.is_dir():
        return
    adopt(directory)
    wanted, mine = set(names) or {*RESULTS, SCENE}, owned(directory, grown=not resumed)
    if not _is_written_scene(directory / SCENE):  # but a copy of the user's, or edited since
        mine -= {SCENE}
    for path in sorted(directory.iterdir()):
        name = re.sub(r"(\.\d+|\.part)$", "", path.name)
        if name not in wanted:
            continue
        require_own(path, {path.name} if name in mine or path.suffix == ".part" else ())
        if any(source.exists() and path.samefile(source) for source in sources):
            raise OutputError(f"{path}: is read and would be replaced; choose another directory")


def adopt(directory: Path) -> None:
    """Take the files of a run that an earlier version of the program has left without a mark; raises OutputError."""
    if not (directory / MARK).exists() and _is_written_scene(directory / SCENE):
        there = {path.name: path.lstat().st_size for path in directory.iterdir()}
        own(directory, {name: there[name] for name in RESULTS & there.keys()} | {SCENE: None})


def _is_written_scene(path: Path) -> bool:
    """Whether a file is a scene as runs write it before anything else: complete, and without a word of anybody's."""
    try:
        text = path.read_text(encoding="utf-8") if path.is_file() else ""
        held = tomllib.loads(text)
    except (OSError, ValueError):
        return False
    return (
        all(isinstance(held.get(name), dict) for name in SECTIONS) and tomli_w.dumps(held) == text
    )

"""Which files of a directory are those of runs, by their contents: no other file is replaced or removed.

Nothing here is collective.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Collection, Iterable
from pathlib import Path

import tomli_w

from ..errors import OutputError
from .earlier import FILES, SCENE

REMEDY = "choose another directory, or move it away"
# What the first lines, or the first keys, of a file of this name are.
KEYS: dict[str, Collection[str]] = {
    "result.json": ("schema_version", "status", "scene", "plan"),
    "threshold.json": ("schema_version", "trials", "contacts"),
    "judgement.json": ("verdict", "probabilities"),
    "series.json": ("samples", "shares", "events"),
}
HEADS = {
    "history.csv": "time,step,newton,",
    "contacts.csv": "time,contact,x,y,",
    "cost.csv": "order,mesh_size",
    "series.csv": "time,safety_factor,mode",
}
SECTIONS = ("domain", "fluid", "flow", "effects", "numerics", "output")  # of a scene that a run has written


def refuse_foreign(directory: Path, names: Iterable[str] = ()) -> None:
    """Refuse a directory in which a file has a name that a run writes but was not written by one, or is a link.

    Args:
        names: of the files that are to be written; none: those of a run.

    Raises:
        OutputError: names the file.
    """
    wanted = set(names) or {*FILES, SCENE}
    for path in sorted(directory.iterdir()) if directory.is_dir() else ():
        name = re.sub(r"(\.\d+|\.part)$", "", path.name)
        if name not in wanted:
            continue
        if path.is_symlink():
            raise OutputError(f"{path}: is a link, and nothing is written through links; {REMEDY}")
        if path.suffix != ".part" and path.exists() and not _is_own(path, name):
            raise OutputError(f"{path}: is not of an incipient run, which would replace it; {REMEDY}")


def _is_own(path: Path, name: str) -> bool:
    """Whether a run wrote a file, by what it holds; fields and pictures by the scene beside them."""
    try:
        if name in KEYS:
            held = json.loads(path.read_bytes())
            return isinstance(held, dict) and set(KEYS[name]) <= held.keys()
        if name in HEADS:
            with path.open(encoding="utf-8") as stream:
                return stream.readline(4096).startswith(HEADS[name])
        if name == "report.html":
            return b"incipient" in path.read_bytes()
        return path.is_file() and _is_written_scene(path.with_name(SCENE))
    except (OSError, ValueError):
        return False


def _is_written_scene(path: Path) -> bool:
    """Whether a file is a scene as runs write it before anything else: complete, and without a word of anybody's."""
    text = path.read_text(encoding="utf-8")
    held = tomllib.loads(text)
    return all(isinstance(held.get(name), dict) for name in SECTIONS) and tomli_w.dumps(held) == text

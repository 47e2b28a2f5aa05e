"""Result files in a directory, and one run there at a time; no foreign file is replaced."""

from __future__ import annotations

import json
import logging
import os
import re
import shutil
import socket
from collections.abc import Collection, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from datetime import datetime
from pathlib import Path

from ..errors import OutputError
from ..files import (
    MARK,
    hold_alone,
    make_directory,
    numbered,
    opened_mark,
    own,
    owned,
    reported,
    require_own,
    write_fully,
    write_text_atomically,
)  # fmt: skip
from ..parallel import Comm, collectively
from ..results.kinds import KINDS, OF_RUNS, RUN

AT_WORK = "# at work: "  # begins the line of a running process in the mark
log = logging.getLogger("incipient")

SCENE, RESULT, CHECKPOINT = "scene.toml", "result.json", "checkpoint.h5"
HISTORY, CONTACTS = "history.csv", "contacts.csv"
PICTURES = (
    *(f"{name}.png" for name in OF_RUNS),
    *(f"{name}.gif" for name in ("velocity", "pressure", "vorticity")),
    "report.html",
)
FILES = {*RUN.files, CHECKPOINT, *PICTURES}
# Of all commands that write their scene.
RESULTS = FILES.union(*(kind.files for kind in KINDS if kind.has_scene))


def make_room(directory: Path, overwrite: bool) -> None:
    """Remove an earlier run, or without `overwrite` move a resumable one to a numbered directory.

    Only files of runs are affected; a copy of the scene is moved. Raises OutputError.
    """
    existing = _there(directory, FILES)
    if overwrite or not (directory / CHECKPOINT).exists():
        remove(existing)
    else:
        _move(existing, directory, "the earlier run there, which can be resumed,")


def place_scene(directory: Path, text: str, names: Collection[str] = ()) -> None:
    """Write the scene of results; results of another scene are first moved to a numbered directory.

    names: results that are not moved, because they are replaced. Raises OutputError.
    """
    path = directory / SCENE
    others = _there(directory, RESULTS - {*names})
    if others and path.exists() and path.read_bytes() != text.encode():
        _move(others, directory, "what is there of another scene")
    write_text_atomically(path, text)


def _there(directory: Path, names: Collection[str]) -> list[Path]:
    return [path for path in directory.iterdir() if _name(path) in names]


def _name(path: Path) -> str:
    return re.sub(r"(\.\d+|\.part)$", "", path.name)


def keep_complete_result(directory: Path) -> None:
    """Rename the result of a complete run before a less complete one replaces it; raises OutputError."""
    path = directory / RESULT
    with suppress(OSError, ValueError, KeyError, TypeError, RecursionError):
        if json.loads(path.read_text())["status"] == "complete":
            put_aside(path)


def put_aside(path: Path) -> Path:
    """Rename a file to the next free numbered name; returns the new path. Raises OutputError."""
    aside = numbered(path)
    with reported(aside):
        path.rename(aside)
    own(aside)
    return aside


def remove(paths: Iterable[Path]) -> None:
    """Remove files of this program, and directories without other files; raises OutputError."""
    for path in paths:
        with reported(path):
            if not path.is_dir():
                path.unlink(missing_ok=True)
                continue
            mine = {*owned(path), MARK}
            for member in path.iterdir():
                if _name(member) in mine:
                    member.unlink()
            with suppress(OSError):  # other files stay
                path.rmdir()


def _move(paths: list[Path], directory: Path, what: str) -> None:
    neighbour = numbered(directory.resolve())
    with reported(neighbour):
        neighbour.mkdir()
        for name in (SCENE, *(path.name for path in paths)):
            own(neighbour / name)
        if (directory / SCENE).exists():
            shutil.copy2(directory / SCENE, neighbour)
        for path in sorted(paths, key=lambda path: path.name == CHECKPOINT):
            shutil.move(path, neighbour)
    log.warning("%s: %s is now in %s", directory, what, neighbour)


def refuse_foreign(
    directory: Path, names: Iterable[str] = (), sources: Iterable[Path] = ()
) -> None:
    """Refuse a directory in which an output file is a link, a foreign file, or one of the input files `sources`.

    names: output files, by default of all commands with a scene. Raises OutputError naming the file.
    """
    wanted = {*names} or {*RESULTS, SCENE}
    for path in sorted(directory.iterdir()) if directory.is_dir() else ():
        if _name(path) not in wanted:
            continue
        require_own(path, folder=True)
        if any(source.exists() and path.samefile(source) for source in sources):
            raise OutputError(f"{path}: is read and would be replaced; choose another directory")


@contextmanager
def locked(directory: Path, comm: Comm, make: bool = False) -> Iterator[None]:
    """Lock a directory against other runs during the block; with `make` create it. Only entering is collective.

    Raises OutputError on all ranks: the directory is locked, has a foreign file, or is not writable.
    """
    with ExitStack() as held:
        with collectively(comm):
            if comm.rank == 0:
                if make:
                    make_directory(directory)
                if not directory.exists():
                    raise OutputError(
                        f"{directory}: no such directory; give the directory of a run"
                    )
                with reported(directory / MARK):
                    mark = held.enter_context(opened_mark(directory))
                    hold_alone(mark, lambda: _busy(directory))
                    since = datetime.now().astimezone().isoformat(" ", "seconds")
                    who = f"process {os.getpid()} on {socket.gethostname()}, since {since}"
                    write_fully(mark, f"{AT_WORK}{who}\n".encode())
                refuse_foreign(directory)
        yield


def _busy(directory: Path) -> str:
    _, _, last = (directory / MARK).read_text(errors="replace").rpartition(AT_WORK)
    remedy = "wait for it or choose another directory"
    return f"{directory}: another run is using it ({last.splitlines()[0]}); {remedy}"

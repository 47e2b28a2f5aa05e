"""Cache of compiled forms on disk, each compiled in a private folder that is renamed when complete.

In a shared folder the compiler would wait ten seconds for the mark of a killed process, and fail.
"""

from __future__ import annotations

import errno
import hashlib
import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

from .errors import OutputError
from .parallel import Comm, collectively, from_first, on_first

T = TypeVar("T")
WHOLE = "checksum"  # file with the checksum of a folder, written last
FULL = 2**20  # free bytes below which a disk counts as full
LEFT = 3600.0  # seconds after which the folder of a killed process is removed
REMEDY = "set XDG_CACHE_HOME to a directory that can be written"


def compiled(root: Path, name: str, comm: Comm, build: Callable[[Path], T]) -> T:
    """Result of `build` for a cached folder, compiled if missing or damaged. Collective over `comm`.

    Args:
        root: parent of all folders, created if missing.
        name: unique name of the form.
        build: compiles into a folder or loads from it; collective.

    Raises OutputError if on some rank the folder is not writable or the disk is full.
    """
    folder = from_first(comm, lambda: root / name)  # environments may differ between ranks
    if all(comm.allgather(_is_whole(folder))):
        loaded: list[T] = []
        with suppress(Exception):
            loaded.append(build(folder))
        if all(comm.allgather(bool(loaded))):
            return loaded[0]
    with ExitStack() as held:
        part = from_first(comm, lambda: _begun(folder, held))
        with collectively(comm), _reported(folder.parent):
            part.mkdir(parents=True, exist_ok=True)
            if not os.access(part, os.W_OK):  # within `build` it would block the other ranks
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        with collectively(comm), _reported(folder.parent):
            result = build(part)
        on_first(comm, _finish, part, folder)
    return result


def _begun(folder: Path, held: ExitStack) -> Path:
    with _reported(folder.parent):
        folder.parent.mkdir(parents=True, exist_ok=True)
        for left in folder.parent.glob("*.*"):
            with suppress(FileNotFoundError):  # renamed or removed by its own process
                if time.time() - left.stat().st_mtime > LEFT:
                    shutil.rmtree(left, ignore_errors=True)
        part = TemporaryDirectory("", f"{folder.name}.", folder.parent, ignore_cleanup_errors=True)
        return Path(held.enter_context(part))


def _finish(part: Path, folder: Path) -> None:
    with suppress(OSError):  # of a full disk, or since another process has been faster
        (part / WHOLE).write_bytes(_checksum(part))
        shutil.rmtree(folder, ignore_errors=True)
        part.rename(folder)


def _is_whole(folder: Path) -> bool:
    """Whether the files are intact: a truncated library crashes the process."""
    with suppress(OSError):
        return (folder / WHOLE).read_bytes() == _checksum(folder)
    return False


def _checksum(folder: Path) -> bytes:
    files = sorted(path for path in folder.iterdir() if path.is_file() and path.name != WHOLE)
    return hashlib.blake2b(b"".join(path.read_bytes() for path in files)).digest()


@contextmanager
def _reported(root: Path) -> Iterator[None]:
    """Report an unusable folder, and a full disk, which the C compiler reports only on the terminal."""
    try:
        yield
    except OSError as error:
        raise OutputError(
            f"{root}: compiled forms cannot be kept ({error.strerror}); {REMEDY}"
        ) from error
    except Exception as error:
        if shutil.disk_usage(root).free > FULL:
            raise
        raise OutputError(
            f"{root}: the disk is full, a form cannot be compiled; free some space, or {REMEDY}"
        ) from error

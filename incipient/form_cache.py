"""Compiled forms on the disk: each in a folder of its own, which gets its name when it is whole.

The form compiler marks a form as begun and waits ten seconds for it wherever it finds the mark: after a process that
was killed it would wait, and fail, for ever. Here a form is compiled in a folder that no other process knows, and the
folder is renamed at the end. What a killed process leaves is never looked at, and removed by the next that compiles
the form; a lock, which the kernel frees with its process, keeps others from compiling the same form meanwhile.
"""

from __future__ import annotations

import errno
import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TypeVar

from .errors import OutputError
from .parallel import Comm, collectively, from_first

T = TypeVar("T")
WHOLE = "checksum"  # of the files of a folder, written last
FULL = 2**20  # bytes free on a disk that counts as full
REMEDY = "set XDG_CACHE_HOME to a directory that can be written"


def compiled(root: Path, name: str, comm: Comm, build: Callable[[Path], T]) -> T:
    """What `build` makes of the code in a folder; it compiles the code where there is none. Collective over `comm`.

    A folder that is damaged or cannot be loaded is compiled anew.

    Args:
        root: of all folders; it is made where it is not there.
        name: of the form, other than that of any other form.
        build: gets a folder, compiles into it or loads from it, and is collective itself.

    Raises:
        OutputError: a rank cannot write to the folder, or its disk is full.
    """
    root, name = from_first(comm, lambda: (root, name))  # ranks may have their own environments
    if all(comm.allgather(_is_whole(root / name))):
        loaded: list[T] = []
        with suppress(Exception):
            loaded.append(build(root / name))
        if all(comm.allgather(bool(loaded))):
            return loaded[0]
        if comm.rank == 0:
            shutil.rmtree(root / name, ignore_errors=True)
    with _locked(root / "locks" / name[:2], comm.rank == 0):
        folder = from_first(comm, lambda: _begun(root, name))
        try:
            with collectively(comm):  # a rank that fails within `build` leaves the others waiting
                _require_writable(folder)
            with collectively(comm), _space_reported(root):
                made = build(folder)
        except BaseException:
            if comm.rank == 0:
                shutil.rmtree(folder, ignore_errors=True)
            raise
        if comm.rank == 0 and folder.name != name:
            _finish(folder, root / name)
    return made


def _begun(root: Path, name: str) -> Path:
    """A new folder to compile in, or that of the form where another process has made it meanwhile."""
    if _is_whole(root / name):
        return root / name
    try:
        root.mkdir(parents=True, exist_ok=True)
        for left in root.glob(f"{name}*"):
            shutil.rmtree(left, ignore_errors=True)
        return Path(tempfile.mkdtemp(prefix=f"{name}.", dir=root))
    except OSError as error:
        raise OutputError(
            f"{root}: compiled forms cannot be kept ({error.strerror}); {REMEDY}"
        ) from error


def _require_writable(folder: Path) -> None:
    """Refuse a folder that this rank, which may be on another machine, can neither find nor make."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as error:
        why = f"compiled forms cannot be kept ({error.strerror})"
        raise OutputError(f"{folder.parent}: {why}; {REMEDY}") from error


def _finish(folder: Path, final: Path) -> None:
    """Give a folder its name. Where that fails the form is compiled again the next time."""
    with suppress(OSError):
        (folder / WHOLE).write_bytes(_checksum(folder))
        # A name must not be on the disk before what it names: a power cut would leave zeros in its place.
        for path in (*folder.iterdir(), folder):
            _to_disk(path)
        folder.rename(final)
        _to_disk(final.parent)
    if folder.exists():
        shutil.rmtree(folder, ignore_errors=True)


def _to_disk(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _is_whole(folder: Path) -> bool:
    """Whether the files of a form are as they were. A library that was cut short ends the process that loads it."""
    with suppress(OSError):
        return (folder / WHOLE).read_bytes() == _checksum(folder)
    return False


def _checksum(folder: Path) -> bytes:
    files = sorted(path for path in folder.iterdir() if path.is_file() and path.name != WHOLE)
    return hashlib.blake2b(b"".join(path.read_bytes() for path in files)).digest()


@contextmanager
def _locked(path: Path, is_first: bool) -> Iterator[None]:
    """Hold a lock on the first rank; file systems without locks only let work be done twice."""
    if not is_first:
        yield
        return
    import fcntl

    handle = None
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        fcntl.flock(handle, fcntl.LOCK_EX)
    try:
        yield
    finally:
        if handle is not None:
            os.close(handle)


@contextmanager
def _space_reported(root: Path) -> Iterator[None]:
    """Let a failure of the block say so where the disk is full, which the C compiler says only to the terminal."""
    try:
        yield
    except Exception as error:
        if shutil.disk_usage(root).free > FULL:
            raise
        raise OutputError(
            f"{root}: the disk is full, a form cannot be compiled; free some space, or {REMEDY}"
        ) from error

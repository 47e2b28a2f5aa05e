"""Cache of compiled forms on disk, each compiled in a private folder that is renamed when complete.

In a shared folder the compiler would wait ten seconds for the mark of a killed process, and fail.
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
WHOLE = "checksum"  # file with the checksum of a folder, written last
FULL = 2**20  # free bytes below which a disk counts as full
REMEDY = "set XDG_CACHE_HOME to a directory that can be written"


def compiled(root: Path, name: str, comm: Comm, build: Callable[[Path], T]) -> T:
    """Result of `build` for a cached folder, compiled if missing or damaged. Collective over `comm`.

    Args:
        root: parent of all folders, created if missing.
        name: unique name of the form.
        build: compiles into a folder or loads from it; collective.

    Raises OutputError if on some rank the folder is not writable or the disk is full.
    """
    root, name = from_first(comm, lambda: (root, name))  # environments may differ between ranks
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
            with collectively(comm):  # a failure within `build` on one rank would block the others
                _require_writable(folder)
            with collectively(comm), _space_reported(root):
                result = build(folder)
        except BaseException:
            if comm.rank == 0:
                shutil.rmtree(folder, ignore_errors=True)
            raise
        if comm.rank == 0 and folder.name != name:
            _finish(folder, root / name)
    return result


def _begun(root: Path, name: str) -> Path:
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
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as error:
        why = f"compiled forms cannot be kept ({error.strerror})"
        raise OutputError(f"{folder.parent}: {why}; {REMEDY}") from error


def _finish(folder: Path, final: Path) -> None:
    with suppress(OSError):
        (folder / WHOLE).write_bytes(_checksum(folder))
        # Content is flushed before the name: a power cut would otherwise leave zeros.
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
    """Whether the files are intact: a truncated library crashes the process."""
    with suppress(OSError):
        return (folder / WHOLE).read_bytes() == _checksum(folder)
    return False


def _checksum(folder: Path) -> bytes:
    files = sorted(path for path in folder.iterdir() if path.is_file() and path.name != WHOLE)
    return hashlib.blake2b(b"".join(path.read_bytes() for path in files)).digest()


@contextmanager
def _locked(path: Path, is_first: bool) -> Iterator[None]:
    """Lock on the first rank; without locks of the file system work may be done twice."""
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
    """Report a full disk, which the C compiler reports only on the terminal."""
    try:
        yield
    except Exception as error:
        if shutil.disk_usage(root).free > FULL:
            raise
        raise OutputError(
            f"{root}: the disk is full, a form cannot be compiled; free some space, or {REMEDY}"
        ) from error

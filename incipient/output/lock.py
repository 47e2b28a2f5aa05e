"""One run at a time in a directory: a file there says which process is at work."""

from __future__ import annotations

import fcntl
import json
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import BinaryIO

from ..errors import OutputError
from ..files import make_directory, own_as_they_are, reported
from ..parallel import Comm, collectively
from .ownership import RESULTS, refuse_foreign

LOCK = "lock.json"
MOST = 2**16  # bytes of a lock that are read
TURNS = 10  # how often a lock that vanishes while it is looked at is tried again


@dataclass(frozen=True)
class Holder:
    """The process that holds a lock.

    host:  name of its machine, with what tells the containers on it apart
    began: when the process did, in the kernel's ticks; None where the system does not tell
    since: when it took the lock, for people
    """

    host: str
    process: int
    began: str | None
    since: str

    @classmethod
    def here(cls) -> Holder:
        """This process, now."""
        process = os.getpid()
        since = datetime.now().astimezone().isoformat(" ", "seconds")
        return cls(_host(), process, _began(process), since)

    @classmethod
    def read(cls, text: bytes) -> Holder | None:
        """The holder that a lock names, None if it names none."""
        try:
            holder = cls(**json.loads(text))
        except (ValueError, TypeError, RecursionError):
            return None
        known = isinstance(holder.host, str) and holder.host.split() and type(holder.process) is int
        began = holder.began is None or isinstance(holder.began, str)
        return holder if known and began and isinstance(holder.since, str) else None

    def is_gone(self) -> bool:
        """Whether the process has certainly ended; of another machine that is not known here."""
        return (
            self.host == _host() and self.began is not None and self.began != _began(self.process)
        )


@contextmanager
def locked(directory: Path, comm: Comm, make: bool = False) -> Iterator[None]:
    """Keep other runs out of a directory during the block. To enter is collective, to leave is not.

    With `make` the directory is made if it is not there.

    The lock of a process that has ended without giving it back is taken over. The lock is a file made only if it is
    not there, which network file systems do rightly, too; their locks on files are not relied upon.

    Raises OutputError on all ranks: another run is at work there, a file is not of a run, or the lock is not writable.
    """
    mine = Holder.here()
    with collectively(comm):
        if comm.rank == 0:
            if make:
                make_directory(directory)
            _take(directory, mine)
            try:
                refuse_foreign(directory, resumed=not make)
            except OutputError:
                _give_back(directory / LOCK, mine)
                raise
    try:
        yield
    finally:
        if comm.rank == 0:
            with suppress(OutputError):  # files that may grow stay replaceable
                own_as_they_are(directory, RESULTS)
            _give_back(directory / LOCK, mine)


def _take(directory: Path, mine: Holder) -> None:
    path = directory / LOCK
    if not directory.exists():
        raise OutputError(f"{directory}: no such directory; give the directory of a run")
    for _ in range(TURNS):
        if _create(path, mine) or _taken_over(path, mine):
            return
    raise OutputError(
        f"{path}: other runs keep taking this lock; wait for them to end, or remove it"
    )


def _create(path: Path, mine: Holder) -> bool:
    """Make the lock, unless there is one."""
    with reported(path):
        try:
            stream = path.open("xb", buffering=0)
        except FileExistsError:
            return False
        with stream:
            try:
                stream.write(_text(mine))
            except OSError:
                path.unlink(missing_ok=True)
                raise
    return True


def _taken_over(path: Path, mine: Holder) -> bool:
    """Put this process in the place of one that has ended; False if the lock has vanished meanwhile.

    Two that find the same old lock are on one machine, where a lock on the file keeps them apart.
    """
    if path.is_symlink() or (path.exists() and not path.is_file()):
        raise OutputError(f"{path}: is no lock but a link, pipe or directory; remove it")
    with suppress(FileNotFoundError), reported(path), path.open("r+b", buffering=0) as stream:
        with suppress(OSError):
            fcntl.flock(stream, fcntl.LOCK_EX)
        if not _is_still_there(path, stream):
            return False
        holder = Holder.read(stream.read(MOST))
        if holder is None or not holder.is_gone():
            raise OutputError(_busy(path, holder))
        stream.seek(0)
        stream.truncate()
        stream.write(_text(mine))
        return True
    return False


def _is_still_there(path: Path, stream: BinaryIO) -> bool:
    """Whether the opened file has not been removed."""
    try:
        return os.path.samestat(path.stat(), os.fstat(stream.fileno()))
    except FileNotFoundError:
        return False


def _busy(path: Path, holder: Holder | None) -> str:
    if holder is None:
        return f"{path.parent}: another run is starting there; choose another directory, or remove {path} if none does"
    who = f"process {holder.process} on {holder.host.split()[0]}, since {holder.since}"
    remedy = "wait for it or choose another directory"
    if holder.host != _host() or holder.began is None:
        remedy += f", or remove {path} if that process is gone"
    return f"{path.parent}: another run is using it ({who}); {remedy}"


def _give_back(path: Path, mine: Holder) -> None:
    """Remove the lock if it is still this process's."""
    with suppress(OSError):
        if path.is_file() and Holder.read(path.read_bytes()) == mine:
            path.unlink()


def _text(holder: Holder) -> bytes:
    return (json.dumps(asdict(holder)) + "\n").encode()


def _host() -> str:
    """The machine, and the numbering of processes in it: containers may share a name."""
    try:
        return f"{socket.gethostname()} {Path('/proc/self/ns/pid').readlink()}"
    except OSError:
        return socket.gethostname()


def _began(process: int) -> str | None:
    """When a process began; None if it has ended, or the system has no record."""
    try:
        state, *rest = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except (OSError, ValueError):
        return None
    return None if state in ("Z", "X") else rest[18]

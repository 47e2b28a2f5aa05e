"""One run at a time in a directory."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import datetime
from pathlib import Path

from ..errors import OutputError
from ..files import MARK, hold_alone, make_directory, opened_mark, reported, write_fully
from ..parallel import Comm, collectively
from .ownership import refuse_foreign

AT_WORK = "# at work: "


@contextmanager
def locked(directory: Path, comm: Comm, make: bool = False) -> Iterator[None]:
    """Lock a directory against other runs during the block; with `make` create it. Only entering is collective.

    The kernel's lock on the directory's mark ends with the process.

    Raises OutputError on all ranks: the directory is locked, a file is not of a run, or the mark is not writable.
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

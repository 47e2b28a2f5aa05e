"""Interrupts: all ranks of a run stop together between steps."""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import Any, ParamSpec, Self, TypeGuard, TypeVar

from .errors import IncipientError, Interrupted, printable, refuse_path
from .parallel import Comm, world

P = ParamSpec("P")
T = TypeVar("T")
SIGNALS = (signal.SIGINT, signal.SIGTERM)
# Seconds within which repeated signals count once: mpirun forwards signals that its ranks have already received.
SAME_WISH = 2.0
_STARTING = threading.RLock()  # of threads that start libraries
_COMPUTING = (
    threading.RLock()
)  # of threads that compute; another one, since these start libraries as well
UNWRITTEN = (errno.EPIPE, errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
NOTICE = b"stopping after this step; once more to stop at once\n"


def one_at_a_time(compute: Callable[P, T]) -> Callable[P, T]:
    """Serialise calls from several threads: gmsh, MPI and PETSc have one state per process.

    On several ranks a call outside the main thread raises IncipientError: the order of threads may differ. A file's
    name instead of a scene raises SceneError.
    """
    parameters = signature(compute)

    @wraps(compute)
    def serialised(*arguments: P.args, **options: P.kwargs) -> T:
        named = parameters.bind_partial(*arguments, **options).arguments
        refuse_path(named.get("scene"), compute.__name__)
        if threading.current_thread() is not threading.main_thread():
            comm = named.get("comm")
            if (world() if comm is None else comm).size > 1:
                raise IncipientError(
                    f"incipient.{compute.__name__} was called in a thread, where ranks cannot synchronise; "
                    "call it in the main thread, or with comm=MPI.COMM_SELF"
                )
        with _COMPUTING:
            return compute(*arguments, **options)

    return serialised


class Interruption:
    """Context manager that stops a run after the step on the first SIGINT or SIGTERM, at once on a later one.

    Until `armed`, and outside the main thread, signals are handled as before, except that SIGTERM also interrupts.
    """

    def __init__(self, comm: Comm):
        self.armed, self._comm = False, comm
        self._since: float | None = None
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, self._note) for number in SIGNALS}
        return self

    def __exit__(self, *exception: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)

    def asked(self) -> bool:
        """Whether any rank has received a signal to stop. Collective."""
        return any(self._comm.allgather(self._since is not None))

    def _note(self, number: int, frame: object) -> None:
        now = time.monotonic()
        if not self.armed or (self._since is not None and now - self._since > SAME_WISH):
            raise KeyboardInterrupt
        if self._since is None:
            self._since = now
            if self._comm.rank == 0:
                os.write(2, NOTICE)


@contextmanager
def handlers_kept(masked: Iterable[int] = SIGNALS) -> Iterator[None]:
    """Preserve signal handlers while the block starts libraries; what it starts does not receive the masked signals.

    PETSc reports a closed pipe or terminal as a crash; gmsh resets interrupts to the system's default, on import in
    Python, from version 4.15 on all signals in C. Signals are deferred: an exception during the start of a library
    becomes another error.
    """
    if threading.current_thread() is not threading.main_thread():
        with _handlers_left_alone():
            yield
        return
    before = {
        number: signal.getsignal(number) for number in (*SIGNALS, signal.SIGHUP, signal.SIGPIPE)
    }
    waiting: list[int] = []  # signals received by other threads, such as MPI's
    for number in SIGNALS:
        if before[number] != signal.SIG_IGN:
            signal.signal(number, lambda number, _: waiting.append(number))
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, masked)
    try:
        with _handlers_left_alone():
            yield
    finally:
        for number, handler in before.items():
            if handler is not None:  # installed by an embedding program, not by Python
                signal.signal(number, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        if waiting:
            signal.raise_signal(waiting[0])


@contextmanager
def _handlers_left_alone() -> Iterator[None]:
    with _STARTING:
        real, starting = signal.signal, threading.current_thread()

        def on_the_main_thread(number: int, handler: Any) -> Any:
            here = threading.current_thread()
            takes = here is threading.main_thread() and here is not starting
            return real(number, handler) if takes else signal.getsignal(number)

        signal.signal = on_the_main_thread  # type: ignore[assignment]
        try:
            yield
        finally:
            signal.signal = real


@contextmanager
def told_where_kept(directory: Path | None, comm: Comm) -> Iterator[None]:
    """Name the directory of the result without error bars in an interrupt of the block.

    Raises:
        Interrupted: instead of KeyboardInterrupt, with a directory and on one rank: others may wait for this one.
    """
    try:
        yield
    except KeyboardInterrupt as interrupt:
        if directory is None or comm.size > 1:
            raise
        raise Interrupted(
            f"interrupted while the error bars were computed; the result without them is kept in {directory}"
        ) from interrupt


def open_streams() -> None:
    """Open closed standard streams as the null device, before another file gets their number."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # the lowest free number
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w" if number else "r"))  # noqa: SIM115
    if isinstance(sys.stdout, io.TextIOWrapper):
        # Names of files need not be UTF-8; another encoding may lack letters.
        every = sys.stdout.encoding.lower() == "utf-8"
        sys.stdout.reconfigure(errors="surrogateescape" if every else "backslashreplace")


def say(text: str) -> None:
    """Print to the standard error if it is writable."""
    try:
        print(printable(text), file=sys.stderr, flush=True)
    except OSError:
        _let_go(2)


def comes_of_interrupt(error: BaseException | None) -> bool:
    """Whether a library has converted an interrupt to this error."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def output_is_lost(error: BaseException) -> TypeGuard[OSError]:
    """Whether the standard output is read by nobody or cannot be written; then use the null device."""
    lost = isinstance(error, OSError) and error.filename is None and error.errno in UNWRITTEN
    if lost:
        _let_go(1)
    return lost


def _let_go(descriptor: int) -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), descriptor)

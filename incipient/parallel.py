"""Common operations of ranks: agreement on failures, broadcasts, gathering, processes."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count, takewhile
from typing import TYPE_CHECKING, Any, Self, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from .errors import IncipientError, MissingError
from .installed import require_directories, require_limits, required

if TYPE_CHECKING:
    from mpi4py.MPI import Comm
else:
    Comm = Any  # mpi4py may be missing without flow computations

T = TypeVar("T")
END_WITH_PARENT = 1  # PR_SET_PDEATHSIG of Linux
# Looked up here: after a fork another thread's lock of the loader would never be released.
_PRCTL = getattr(ctypes.CDLL(None), "prctl", None)
OFTEN = 0.01  # seconds between checks for arrived ranks
# Variables that make a new process join a parallel run, or distribute an `mpirun` over Slurm's machines.
PARALLEL_RUN = (
    *("OMPI_COMM_", "OMPI_UNIVERSE", "OMPI_MCA_orte_", "OMPI_MCA_ess", "OMPI_MCA_pmix"),
    *("OMPI_FILE_", "OMPI_APP_", "OMPI_FIRST_RANKS", "OMPI_NUM_APP_CTX"),
    *("PMIX_", "PMI_", "ORTE_", "PRTE_", "SLURM_"),
)

# Of a process of one rank. Signatures of forms may depend on the order of a set: a common seed shares compiled forms.
ONE_RANK = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}


class Owner:
    """Owner of PETSc objects, which a context destroys at its end. Every method is collective.

    comm: of the context, or None without one
    """

    def __init__(self, comm: Any = None) -> None:
        self._owned, self._comm = list[Any](), comm

    def holding(self, resource: Any) -> Any:
        self._owned.append(resource)
        return resource

    def destroy(self) -> None:
        while self._owned:
            self._owned.pop().destroy()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *exception: object) -> None:
        # After an interrupt or an error on one rank freeing would deadlock.
        is_alone = self._comm is None or self._comm.size == 1
        if kind is None or issubclass(kind, IncipientError) or is_alone:
            self.destroy()


class Alone:
    """Communicator of one rank, for commands without flow computations if mpi4py is missing."""

    rank, size = 0, 1

    def allgather(self, value: Any) -> list[Any]:
        return [value]

    def bcast(self, value: Any) -> Any:
        return value


def world() -> Comm:
    """Communicator of all ranks.

    Raises MissingError without mpi4py or its MPI library, and OutputError as `require_limits`.
    """
    if "mpi4py" not in sys.modules:
        require_limits()
    with required():
        from mpi4py import MPI
    return MPI.COMM_WORLD


@contextmanager
def collectively(comm: Comm | Alone) -> Iterator[None]:
    """Run the block on every rank; an error on any rank is raised on all. Collective.

    For work of one rank, such as meshing or writing: the block must not fail within a collective call. Raises the
    IncipientError of the lowest failing rank.
    """
    error: Exception | None = None
    try:
        yield
    except Exception as caught:
        error = caught
    failures = [e for e in comm.allgather(_described(error)) if e is not None]
    if not failures:
        return
    if error is not None and not isinstance(error, IncipientError):
        raise error
    kind, message = failures[0]
    raise kind(message) from error


class Meeting:
    """Meeting of all ranks at their end, which determines the failed ones. The constructor is collective."""

    def __init__(self, comm: Comm | Alone):
        self.comm = cast("Comm", comm)
        self._own = None if comm.size == 1 else self.comm.Dup()

    def failed(self, has_failed: bool, seconds: float = float("inf")) -> list[bool]:
        """Whether each rank has failed; empty if some rank has not arrived after so many seconds."""
        if self._own is None:
            return [has_failed]
        mine, all_of_them = bytearray([has_failed]), bytearray(self.comm.size)
        request, until = self._own.Iallgather(mine, all_of_them), time.monotonic() + seconds
        while not request.Test():
            if time.monotonic() > until:
                return []
            time.sleep(OFTEN)
        return [bool(failed) for failed in all_of_them]


def from_first(comm: Comm | Alone, compute: Callable[[], T]) -> T:
    """Value of a function that only the first rank calls, on every rank. Collective; raises as `collectively`.

    The value must be picklable.
    """
    value: Any = None
    with collectively(comm):
        if comm.rank == 0:
            value = compute()
    return value if comm.size == 1 else comm.bcast(value)


def on_first(comm: Comm | Alone, work: Callable[..., object], *arguments: Any) -> None:
    """Call a function on the first rank alone. Collective; raises as `collectively`."""
    with collectively(comm):
        if comm.rank == 0:
            work(*arguments)


def largest(comm: Comm, values: NDArray[Any] | float, least: float = 0.0) -> float:
    """The largest of `least` and the values of all ranks. Collective."""
    return max(comm.allgather(float(np.max(values, initial=least))))


def joined(comm: Comm, rows: NDArray[Any]) -> NDArray[Any]:
    """Concatenated rows (n, ...) of all ranks on rank 0; none elsewhere. Collective."""
    parts = comm.gather(np.ascontiguousarray(rows))
    return rows[:0] if parts is None else np.concatenate(parts)


class NumberedRows:
    """Distributed rows with global `numbers` (n,), which ranks may share. Constructor and methods are collective.

    Rank 0 gathers each row once, in the order of the numbers.
    """

    def __init__(self, comm: Comm, numbers: NDArray[Any]):
        self._comm = comm
        self._numbers, self._order = np.unique(joined(comm, numbers), return_index=True)

    def joined(self, rows: NDArray[Any]) -> NDArray[Any]:
        return joined(self._comm, rows)[self._order]

    def places_of(self, numbers: NDArray[Any]) -> NDArray[Any]:
        """Rows of numbers of any shape. Not collective: local."""
        return np.searchsorted(self._numbers, numbers)


def _described(error: Exception | None) -> tuple[type[IncipientError], str] | None:
    if error is None:
        return None
    kind = type(error) if isinstance(error, IncipientError) else IncipientError
    return kind, str(error) or type(error).__name__


def end_with_parent(parent: int | None = None) -> None:
    """Let the kernel kill this process at the end of the thread that started it; Linux only.

    If `parent` has already ended, the process ends at once.
    """
    if _PRCTL is not None:
        _PRCTL(END_WITH_PARENT, signal.SIGKILL)
    if parent is not None and os.getppid() != parent:
        os._exit(1)


def environment_alone() -> dict[str, str]:
    """Environment of a process outside the parallel run of this one."""
    return {name: value for name, value in os.environ.items() if not name.startswith(PARALLEL_RUN)}


def leave_parallel_run() -> None:
    """Remove the MPI run of this process from the environment, so that children start alone."""
    environment = ctypes.POINTER(ctypes.c_char_p).in_dll(ctypes.CDLL(None), "environ")
    entries = takewhile(bool, (environment[n] for n in count()))
    for name in [os.fsdecode(entry).partition("=")[0] for entry in entries]:
        if name.startswith(PARALLEL_RUN):
            os.environ.pop(name, None)
            os.unsetenv(name)  # Python does not know variables set by the library


def start_alone_quickly() -> None:
    """Prevent Open MPI from starting a daemon and searching networks without mpirun, which takes 0.3 s.

    Children, which may be mpirun, do not inherit the settings. Raises OutputError.
    """
    if any(name.startswith(("OMPI_COMM_", "PMI_", "PMIX_", "SLURM_")) for name in os.environ):
        return
    require_directories()
    wanted = {"OMPI_MCA_ess_singleton_isolated": "1", "OMPI_MCA_pml": "ob1", "OMPI_MCA_btl": "self"}
    added = {name: value for name, value in wanted.items() if name not in os.environ}
    os.environ.update(added)
    ranks_there_are()  # mpi4py reads them at its start
    for name in added:
        del os.environ[name]


def ranks_there_are() -> Comm:
    """All ranks; without MPI a single rank, which can judge and plan."""
    try:
        return world()
    except MissingError:
        return cast("Comm", Alone())

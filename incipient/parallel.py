"""What several ranks must do together: agree on failure, and report it once."""

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
    Comm = Any  # what computes no flow does not load mpi4py, which need not be installed

T = TypeVar("T")
END_WITH_PARENT = 1  # PR_SET_PDEATHSIG of Linux
# Looked up here: after a fork another thread's lock of the loader would be waited for in vain.
_PRCTL = getattr(ctypes.CDLL(None), "prctl", None)
OFTEN = 0.01  # seconds between looks at who has come
# What makes a new process take part in a parallel run, or an `mpirun` spread over the machines of Slurm's job.
PARALLEL_RUN = (
    *("OMPI_COMM_", "OMPI_UNIVERSE", "OMPI_MCA_orte_", "OMPI_MCA_ess", "OMPI_MCA_pmix"),
    *("OMPI_FILE_", "OMPI_APP_", "OMPI_FIRST_RANKS", "OMPI_NUM_APP_CTX"),
    *("PMIX_", "PMI_", "ORTE_", "PRTE_", "SLURM_"),
)

# Of a process of one rank. Signatures of forms may depend on the order of a set: with one seed such processes find each
# other's compiled forms.
ONE_RANK = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}


class Holder:
    """Holds objects of PETSc, which all ranks free together: a context manager. Every method is collective."""

    def __init__(self, comm: Comm):
        self._comm, self._held = comm, list[Any]()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *exception: object) -> None:
        # After an interrupt or a defect of one rank freeing would wait for the others for ever.
        if kind is None or issubclass(kind, IncipientError) or self._comm.size == 1:
            self.destroy()

    def holding(self, made: Any) -> Any:
        """An object that has been made, to be freed with the others."""
        self._held.append(made)
        return made

    def destroy(self) -> None:
        """Free PETSc's memory, what was made last first."""
        while self._held:
            self._held.pop().destroy()


class Alone:
    """The only rank: what commands that compute no flow ask of a communicator, where mpi4py is not installed."""

    rank, size = 0, 1

    def allgather(self, value: Any) -> list[Any]:
        """The values of all ranks."""
        return [value]

    def bcast(self, value: Any) -> Any:
        """The value of rank 0."""
        return value


def world() -> Comm:
    """The communicator of all ranks.

    Raises:
        MissingError: mpi4py, or the MPI library that it needs, is not installed.
        OutputError: as `require_limits`.
    """
    if "mpi4py" not in sys.modules:
        require_limits()
    with required():
        from mpi4py import MPI
    return MPI.COMM_WORLD


@contextmanager
def collectively(comm: Comm | Alone) -> Iterator[None]:
    """Run the block on every rank; if any rank raised, every rank raises the first rank's error.

    Collective. For work that one rank does for all (building a mesh, writing a file): a rank that
    fails inside the block may not be inside a collective call when it does.

    Raises:
        IncipientError: of the type and with the message raised on the lowest failing rank.
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
    """Where all ranks come at their end, whatever it is, and learn which of them have failed. Made collectively."""

    def __init__(self, comm: Comm | Alone):
        self._comm = None if comm.size == 1 else cast("Comm", comm).Dup()

    def failed(self, has_failed: bool, seconds: float = float("inf")) -> list[bool]:
        """Who has failed, by rank; nobody knows where not all have come after so many seconds: an empty list."""
        if self._comm is None:
            return [has_failed]
        mine, all_of_them = bytearray([has_failed]), bytearray(self._comm.size)
        request, until = self._comm.Iallgather(mine, all_of_them), time.monotonic() + seconds
        while not request.Test():
            if time.monotonic() > until:
                return []
            time.sleep(OFTEN)
        return [bool(one) for one in all_of_them]


def from_first(comm: Comm | Alone, compute: Callable[[], T]) -> T:
    """What a function returns on the first rank, which alone calls it, on every rank. Collective.

    For files above all, which need not be there on the machines of other ranks. The value must be picklable.

    Raises:
        IncipientError: on all ranks, what the function raised.
    """
    value: Any = None
    with collectively(comm):
        if comm.rank == 0:
            value = compute()
    return value if comm.size == 1 else comm.bcast(value)


def joined(comm: Comm, rows: NDArray[Any]) -> NDArray[Any]:
    """The rows (n, ...) of all ranks, one rank's after the other's, on rank 0; none on the others. Collective."""
    parts = comm.gather(np.ascontiguousarray(rows))
    return rows[:0] if parts is None else np.concatenate(parts)


class NumberedRows:
    """Rows that ranks have by global `numbers` (n,), several of them the same ones. All is collective, also making it.

    On rank 0 rows come together in the order of their numbers, each once; the other ranks get none.
    """

    def __init__(self, comm: Comm, numbers: NDArray[Any]):
        self._comm = comm
        self._numbers, self._order = np.unique(joined(comm, numbers), return_index=True)

    def joined(self, rows: NDArray[Any]) -> NDArray[Any]:
        """This rank's rows (n, ...) with those of all others."""
        return joined(self._comm, rows)[self._order]

    def places_of(self, numbers: NDArray[Any]) -> NDArray[Any]:
        """Rows of the given numbers, of any shape. Not collective."""
        return np.searchsorted(self._numbers, numbers)


def _described(error: Exception | None) -> tuple[type[IncipientError], str] | None:
    if error is None:
        return None
    kind = type(error) if isinstance(error, IncipientError) else IncipientError
    return kind, str(error) or type(error).__name__


def end_with_parent(parent: int | None = None) -> None:
    """Let the kernel kill this process when the thread that started it ends, however that ends; on Linux only.

    A process whose `parent` is known, and has ended before the kernel knew, ends at once.
    """
    if _PRCTL is not None:
        _PRCTL(END_WITH_PARENT, signal.SIGKILL)
    if parent is not None and os.getppid() != parent:
        os._exit(1)


def environment_alone() -> dict[str, str]:
    """The environment for a process that takes no part in the parallel run of this one."""
    return {name: value for name, value in os.environ.items() if not name.startswith(PARALLEL_RUN)}


def leave_parallel_run() -> None:
    """Forget the MPI run that this process is part of, or that the MPI library has begun: children start alone."""
    environment = ctypes.POINTER(ctypes.c_char_p).in_dll(ctypes.CDLL(None), "environ")
    entries = takewhile(bool, (environment[n] for n in count()))
    for name in [os.fsdecode(entry).partition("=")[0] for entry in entries]:
        if name.startswith(PARALLEL_RUN):
            os.environ.pop(name, None)
            os.unsetenv(name)  # the library's own are unknown to Python


def start_alone_quickly() -> None:
    """Keep OpenMPI from starting a daemon and searching networks without mpirun, which takes 0.3 s.

    The settings are for this process alone: one that it starts may be an mpirun.

    Raises:
        OutputError: as `require_directories` and `require_limits`.
    """
    if any(name.startswith(("OMPI_COMM_", "PMI_", "PMIX_", "SLURM_")) for name in os.environ):
        return
    require_directories()
    wanted = {"OMPI_MCA_ess_singleton_isolated": "1", "OMPI_MCA_pml": "ob1", "OMPI_MCA_btl": "self"}
    added = {name: value for name, value in wanted.items() if name not in os.environ}
    os.environ.update(added)
    ranks_there_are()  # mpi4py reads them as it starts
    for name in added:
        del os.environ[name]


def ranks_there_are() -> Comm:
    """All ranks; without an MPI this process alone, which judges and plans, and says what is missing for a flow."""
    try:
        return world()
    except MissingError:
        return cast("Comm", Alone())

"""Executors of cases: any of `concurrent.futures`, as threads of this machine, Dask's workers, or an `mpirun`'s ranks.

All but the groups of ranks compute each case in a process below the worker (`case_process`). Ranks of one `mpirun` end
together when one of them dies: then what is in the file stays, and the sweep is called again.
"""

from __future__ import annotations

import asyncio
import json
import logging
import socket
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from ..errors import Interrupted, MissingError, OutputError, SceneError, shortened
from ..input_files import reading
from . import worker
from .case_process import Order, computed_below, end_all
from .expectation import my_cores
from .store import CaseOutcome

if TYPE_CHECKING:
    from mpi4py import MPI

log = logging.getLogger("incipient")
DASK = "dask://"
PATIENCE = 600.0  # seconds that a scheduler has to come back
START = 30.0  # seconds that it has to answer
OFTEN = 0.02  # seconds between looks at messages of other ranks
COUNTED = 1.0  # seconds for which the number of Dask's workers is believed


class Workers:
    """Workers of an executor, which is ended by whoever made it."""

    def __init__(self, executor: Executor, places: int):
        self._executor, self._places = executor, places

    @property
    def places(self) -> int:
        """How many cases can be computed at a time."""
        return self._places

    def submit(self, order: Order) -> Future[CaseOutcome]:
        """Give out a case."""
        return self._executor.submit(computed_below, order)

    def renew(self) -> None:
        """Go on after all futures have failed together; raises OutputError where that cannot be."""
        raise OutputError(
            "the executor is broken, as one of its workers died; repeat the command with a new one"
        )

    def close(self, sweep: str, at_once: bool) -> None:
        """End what has been started for a sweep; cases at work too if `at_once`."""
        end_all(sweep, at_once)


class DaskWorkers(Workers):
    """Workers of a scheduler of Dask, which may go away, and come back at the same address."""

    def __init__(self, address: str):
        self._address, self._places, self._counted = address, 1, 0.0
        self._client = self._connect(0.0)

    @property
    def places(self) -> int:
        """Threads of the workers that there are now."""
        if time.monotonic() > self._counted + COUNTED:
            with suppress(OSError, ValueError, RuntimeError):  # gone: the futures will say so
                asked = self._client.scheduler.ncores
                found = sum(self._client.sync(asked, callback_timeout=COUNTED).values())
                if not found and self._places:
                    log.warning("%s: has no workers; waiting for some", self._address)
                self._places = found
            self._counted = time.monotonic()
        return self._places

    def submit(self, order: Order) -> Future[CaseOutcome]:
        """See `Workers`; a scheduler that has gone gives a future that is cancelled."""
        try:
            return super().submit(order)
        except Exception:
            if self._client.status == "running":
                raise
        gone: Future[CaseOutcome] = Future()
        gone.cancel()
        gone.set_running_or_notify_cancel()
        return gone

    def renew(self) -> None:
        """Connect again, waiting for the scheduler; Dask's client does so itself, but not for long."""
        if self._client.status != "running":
            log.warning("%s: the scheduler has gone; waiting for it", self._address)
            with suppress(Exception):
                self._client.close(timeout=1.0)
            self._client = self._connect(PATIENCE)

    def close(self, sweep: str, at_once: bool) -> None:
        """Let workers end their processes: Dask itself cannot end what has begun."""
        with suppress(
            Exception
        ):  # a scheduler that has gone cannot pass it on; idle processes end by themselves
            self._client.run(end_all, sweep, at_once)
        with suppress(Exception):
            self._client.close(timeout=5.0)

    def _connect(self, patience: float) -> Any:
        """A client; raises OutputError: there is no scheduler within so many seconds; MissingError, SceneError."""
        try:
            from distributed import Client
        except ImportError as error:
            raise MissingError(
                f"--executor: Dask cannot be used ({error}): pip install 'incipient[dask]'"
            ) from None
        until = time.monotonic() + patience
        while True:
            try:
                address = _address(self._address.removeprefix(DASK))
                with ThreadPoolExecutor(1) as aside:  # a notebook has a loop of its own here
                    aside.submit(asyncio.run, _greet(address)).result()
                client = Client(address, timeout=START, set_as_default=False)
                break
            except Exception as error:
                if time.monotonic() < until:
                    time.sleep(OFTEN)
                    continue
                why = shortened(error, 200) or f"{type(error).__name__} after {START:g} s"
                remedy = (
                    "start `dask scheduler` there, or correct --executor, and repeat the command"
                )
                raise OutputError(
                    f"{self._address}: no scheduler answers ({why}); {remedy}"
                ) from None
        self._executor, self._counted = client.get_executor(pure=False), 0.0
        return client


def _address(where: str) -> str:
    """The address of a scheduler, or that in the file which the scheduler has written."""
    if not where.endswith(".json"):
        return where if "://" in where else f"tcp://{where}"
    with reading(Path(where), "give the file of `dask scheduler`", 1, OutputError):
        return str(json.loads(Path(where).read_text(encoding="utf-8"))["address"])


async def _greet(address: str) -> None:
    """Connect to a scheduler and leave: Dask itself waits without end for one that accepts and says nothing."""
    from distributed.core import connect

    comm = await asyncio.wait_for(connect(address, timeout=START), START)
    await comm.close()


class RankWorkers(Workers):
    """Groups of the ranks of one `mpirun`; the first rank only gives out cases."""

    def __init__(self, executor: Executor, comm: MPI.Comm, places: int):
        super().__init__(executor, places)
        self._comm, self._at_work = comm, set[Future[CaseOutcome]]()

    def submit(self, order: Order) -> Future[CaseOutcome]:
        """See `Workers`."""
        future = self._executor.submit(worker.computed_by_group, order.task, order.text)
        self._at_work.add(future)
        future.add_done_callback(self._at_work.discard)
        return future

    def close(self, sweep: str, at_once: bool) -> None:
        """See `Workers`; where some are at work, all ranks end, this one too."""
        sys.stdout.flush()
        sys.stderr.flush()
        if self._at_work:
            self._comm.Abort(Interrupted.exit_code)


def of_executor(executor: Executor | str, jobs: int | None) -> Workers:
    """Workers of an executor of Python, or of the address of Dask's scheduler.

    Raises:
        SceneError: the address is none, or how many workers the executor has is not known.
        OutputError, MissingError: no scheduler answers; Dask is not installed.
    """
    if isinstance(executor, str):
        if not executor.startswith(DASK):
            raise SceneError(
                f"--executor {executor}: is not known; give dask://HOST:PORT or dask://FILE.json"
            )
        return DaskWorkers(executor)
    names = ("num_workers", "_max_workers", "max_workers")
    known = (getattr(executor, name, None) for name in names)
    places = jobs or next((number for number in known if isinstance(number, int)), None)
    if places is None:
        raise SceneError(
            f"{type(executor).__name__}: how many workers it has is not known; give jobs=NUMBER"
        )
    return Workers(executor, places)


@contextmanager
def workers_of(
    comm: MPI.Comm, places: int, ranks: int, executor: Executor | str | None = None
) -> Iterator[Workers | None]:
    """Yield the workers on the first rank, and None on others, which compute cases before that. Collective.

    Args:
        places: how many cases are computed at a time; ranks: those of each case.
        executor: that computes them; default: threads of this machine with a process each, or ranks of this `mpirun`.
    """
    if executor is not None:
        yield of_executor(executor, places or None)
        return
    if comm.size == 1:
        with ThreadPoolExecutor(places) as threads:
            yield Workers(threads, places)
        return
    from mpi4py import MPI
    from mpi4py.futures import MPICommExecutor

    number = (comm.rank - 1) // ranks
    group = comm.Split(number if 0 <= number < places else MPI.UNDEFINED, comm.rank)
    leads = comm.rank == 0 or (bool(group) and group.rank == 0)
    leaders = comm.Split(0 if leads else MPI.UNDEFINED, comm.rank)
    if not leads:
        worker.follow(group)
        yield None
        return
    within = MPICommExecutor(cast("MPI.Intracomm", leaders), backoff=OFTEN)
    with worker.leading(group), within as found:
        yield None if found is None else RankWorkers(found, comm, places)


def require_cores(comm: MPI.Comm) -> None:
    """Refuse ranks that would share cores, as wrongly bound ones do. Collective; raises SceneError on all ranks."""
    mine = None if comm.rank == 0 else (socket.gethostname(), my_cores())
    if shared := short_of_cores([one for one in comm.allgather(mine) if one is not None]):
        remedy = "start fewer, or bind them otherwise (mpirun --bind-to none, srun --cpu-bind=none)"
        raise SceneError(f"{shared}; {remedy}")


def short_of_cores(ranks: Sequence[tuple[str, frozenset[int]]]) -> str:
    """The machine whose ranks have fewer cores together than there are of them; empty where none has.

    Args:
        ranks: machine, and cores that may be used, of each rank that computes.
    """
    number, together = Counter(host for host, _ in ranks), dict[str, frozenset[int]]()
    for host, cores in ranks:
        together[host] = together.get(host, frozenset()) | cores
    short = next((host for host in number if len(together[host]) < number[host]), None)
    return (
        ""
        if short is None
        else f"{number[short]} ranks compute on {short} and have {len(together[short])} cores there"
    )


def groups(comm: MPI.Comm, ranks: int) -> int:
    """Number of groups of so many ranks beside the first rank. Raises SceneError: on all ranks, there is none."""
    number = (comm.size - 1) // ranks
    if number < 1:
        why = f"one rank distributes the cases, and {comm.size - 1} are left"
        raise SceneError(f"--ranks {ranks}: {why}; start {ranks + 1} or more")
    return number

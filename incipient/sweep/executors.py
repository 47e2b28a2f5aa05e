"""Executors of cases: processes of this machine, or groups of the ranks of one `mpirun` by `mpi4py.futures`.

A thread of `concurrent.futures` waits for each process. One that dies takes its case with it and nothing else; another
is started in its place. Ranks of one `mpirun` end together when one of them dies: then what is in the file stays, and
the sweep is called again.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import IO, TYPE_CHECKING, cast

from ..cost.process import environment_of_one_rank
from ..errors import Interrupted, OutputError, SceneError
from . import worker
from .cases import SweepCase
from .procedure import Workers
from .store import CaseOutcome

if TYPE_CHECKING:
    from mpi4py import MPI

RENEWED = 50  # cases with a flow after which a process is replaced, whatever memory it has lost by then
LEAVE = 5.0  # seconds that a process has to end
OFTEN = 0.02  # seconds between looks at messages of other ranks


class _Process:
    """A process, or ranks under an `mpirun` of their own, that ends when this one does, however that ends."""

    def __init__(self, ranks: int):
        self.cases, self._ready = 0, False
        self._complaints = tempfile.TemporaryFile("w+")  # noqa: SIM115 (closed with the process)
        self.popen = subprocess.Popen(
            [*_on_ranks(ranks), sys.executable, "-P", "-m", "incipient.sweep.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._complaints,
            text=True,
            env={**environment_of_one_rank(), "OMPI_MCA_mpi_yield_when_idle": "1"},
            start_new_session=True,  # an interrupt is the sweep's to deal with
            preexec_fn=partial(worker.end_with_parent, os.getpid()),
        )

    def compute(self, case: SweepCase) -> CaseOutcome:
        """Compute a case, waiting for it; if the process dies, the reason.

        Raises:
            OutputError: it ended by itself before it began: that is not the case's fault, and all would.
        """
        began, answers = time.perf_counter(), cast("IO[str]", self.popen.stdout)
        self.cases += 1
        with suppress(BrokenPipeError):
            print(json.dumps([case.task, case.text]), file=self.popen.stdin, flush=True)
        self._ready = self._ready or answers.readline() == worker.READY
        # MPICH's mpirun writes of the end of a rank where the answer is expected.
        answer = next((line for line in iter(answers.readline, "") if line.startswith("{")), "")
        if answer.endswith("\n"):
            return CaseOutcome(**json.loads(answer))
        reason = self._epitaph()
        if not self._ready and self.popen.returncode >= 0:
            remedy = "remove the cause and repeat the command to resume"
            raise OutputError(f"no worker process starts: {reason}; {remedy}")
        return CaseOutcome(reason=reason, wall=time.perf_counter() - began)

    def dismiss(self) -> None:
        """Let it end by itself, which `mpirun` needs to clean up, but not for long."""
        assert self.popen.stdin is not None
        with suppress(BrokenPipeError, subprocess.TimeoutExpired):
            self.popen.stdin.close()
            self.popen.wait(LEAVE)

    def kill(self) -> None:
        """Kill it with all that it has started."""
        with suppress(ProcessLookupError):
            os.killpg(self.popen.pid, signal.SIGKILL)
        self.popen.wait()

    def end(self) -> None:
        """Kill it, and close its files."""
        self.kill()
        for stream in (self.popen.stdin, self.popen.stdout, self._complaints):
            with suppress(BrokenPipeError):
                cast("IO[str]", stream).close()

    def _epitaph(self) -> str:
        """Reason of its end, in one line."""
        with suppress(subprocess.TimeoutExpired):
            self.popen.wait(LEAVE)
        code = self.popen.poll()
        self.kill()
        self._complaints.seek(0)
        lines = [line for line in self._complaints if re.search(r"\w", line)]
        if code is not None and code < 0:
            return f"its process was ended by signal {-code}" + (": not enough memory?" if code == -9 else "")
        last = f": {' '.join(lines[-1].split())}" if lines else ""
        return f"its process ended with code {code}{last}"


class Processes:
    """Processes of this machine, each with its own ranks, started when there is something to do."""

    def __init__(self, places: int, ranks: int = 1):
        self.places, self._ranks = places, ranks
        self._threads = ThreadPoolExecutor(places)
        self._processes: list[_Process] = []
        self._at_work: dict[Future[CaseOutcome], _Process] = {}

    def submit(self, case: SweepCase) -> Future[CaseOutcome]:
        """See `Workers`."""
        idle = [one for one in self._processes if one not in self._at_work.values()]
        if not idle:
            idle = [_Process(self._ranks)]
            self._processes += idle  # before it computes: an interrupt from here on ends it, too
        future = self._threads.submit(idle[-1].compute, case)
        self._at_work[future] = idle[-1]
        return future

    def outcome(self, case: SweepCase, future: Future[CaseOutcome]) -> CaseOutcome:
        """See `Workers`. Raises OutputError: a process has ended by itself before it began."""
        process = self._at_work.pop(future)
        if process.popen.poll() is not None or (case.scene is not None and process.cases >= RENEWED):
            self._processes.remove(process)
            process.end()
        return future.result()

    def close(self, at_once: bool) -> None:
        """See `Workers`."""
        for process in () if at_once else self._processes:
            process.dismiss()
        for process in self._processes:
            process.end()
        self._threads.shutdown()


def _on_ranks(number: int) -> list[str]:
    """The start of a command on several ranks, by the `mpirun` of the MPI that Python uses.

    Open MPI would tie the ranks of each `mpirun` to the same cores.
    """
    if number == 1:
        return []
    from mpi4py import MPI

    beside = Path(sys.executable).with_name("mpirun")
    command = [str(beside) if beside.exists() else "mpirun", "-n", str(number)]
    own = ["--oversubscribe", "--bind-to", "none"]
    return command + (own if "Open MPI" in MPI.Get_library_version() else [])


class Ranks:
    """Groups of the ranks of one `mpirun`; the first rank only gives out cases."""

    def __init__(self, executor: Executor, comm: MPI.Comm, places: int):
        self.places, self._executor, self._comm = places, executor, comm
        self._at_work: set[Future[CaseOutcome]] = set()

    def submit(self, case: SweepCase) -> Future[CaseOutcome]:
        """See `Workers`."""
        future = self._executor.submit(worker.computed_by_group, case.task, case.text)
        self._at_work.add(future)
        return future

    def outcome(self, case: SweepCase, future: Future[CaseOutcome]) -> CaseOutcome:
        """See `Workers`."""
        self._at_work.remove(future)
        return future.result()

    def close(self, at_once: bool) -> None:
        """See `Workers`; with `at_once`, and some at work, all ranks end, this one too."""
        sys.stdout.flush()
        sys.stderr.flush()
        if at_once and self._at_work:
            self._comm.Abort(Interrupted.exit_code)


@contextmanager
def workers_of(comm: MPI.Comm, places: int, ranks: int) -> Iterator[Workers | None]:
    """Yield the workers on the first rank, and None on others, which compute cases before that. Collective.

    Args:
        places: how many cases are computed at a time; ranks: those of each case.
    """
    if comm.size == 1:
        yield Processes(places, ranks)
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
    with worker.leading(group), within as executor:
        yield None if executor is None else Ranks(executor, comm, places)


def groups(comm: MPI.Comm, ranks: int) -> int:
    """Number of groups of so many ranks beside the first rank. Raises SceneError: on all ranks, there is none."""
    number = (comm.size - 1) // ranks
    if number < 1:
        why = f"one rank distributes the cases, and {comm.size - 1} are left"
        raise SceneError(f"--ranks {ranks}: {why}; start {ranks + 1} or more")
    return number

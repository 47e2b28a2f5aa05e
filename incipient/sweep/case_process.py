"""What a worker of any executor does with a case: has it computed by a process of its own, and watches that.

The process stays for the next case of the same thread. One that dies, is at its case for too long, or takes too much
memory loses that case alone, and leaves the worker as it was: no standard pool of processes can do that
(docs/howto/cluster.md#why-a-process-below-each-worker).
"""

from __future__ import annotations

import json
import os
import re
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import IO, cast

from ..cost.process import environment_of_one_rank
from ..errors import MissingError, OutputError, SceneError
from ..parallel import end_with_parent
from .expectation import cores
from .store import CaseOutcome

COMMAND = "from incipient.sweep.worker import main; main()"
READY = "ready\n"
RENEWED = (
    50  # cases with a flow after which a process is replaced, whatever memory it has lost by then
)
LEAVE = 5.0  # seconds that a process has to end
LOOK = 0.2  # seconds between looks at its memory
IDLE = 300.0  # seconds after which a process that has nothing to do ends by itself
LONGEST_LOG = 20_000  # letters
# The process below each thread of this worker. An executor hands its workers functions alone, so they are kept here.
_BELOW: dict[int, _Process] = {}
_STARTING = threading.Lock()
_OVER: set[str] = set()  # sweeps that were ended at once, whose cases are not begun any more


@dataclass(frozen=True)
class Order:
    """A case as it is given to a worker.

    sweep: which sweep gives it; task, text: as in `SweepCase`; ranks: that compute it
    limit: seconds it may take; memory_mib: that its ranks may take together
    """

    sweep: str
    task: str
    text: str
    ranks: int = 1
    limit: float = float("inf")
    memory_mib: float = float("inf")
    release: str = version("incipient")


def computed_below(order: Order) -> CaseOutcome:
    """Compute a case in the process of this thread, waiting for it; what any executor is given. Not collective.

    An outcome without a result is `lost` where its process has died or was ended.

    Raises:
        SceneError: this machine gives the worker fewer cores than ranks are asked for.
        MissingError: the worker has another version of the program.
        OutputError: the process ended by itself before it began: that is not the case's fault, and all would.
    """
    host, here = socket.gethostname(), version("incipient")
    if order.release != here:
        raise MissingError(
            f"the worker on {host} has incipient {here}, the sweep {order.release}; install that there"
        )
    if order.ranks > cores():
        why = f"a worker on {host} has {cores()} cores"
        raise SceneError(
            f"--ranks {order.ranks}: {why}; give fewer ranks, or start workers with more cores"
        )
    thread = threading.get_ident()
    process = _BELOW.get(thread)
    if process is not None and not process.may_go_on(order):
        process.end()
        process = None
    process = _BELOW[thread] = process or _Process(order.ranks)
    process.at_work_for(order.sweep)
    try:
        if order.sweep in _OVER:
            process.kill()
        return process.compute(order)
    finally:
        process.is_at_work = False
        if process.popen.poll() is not None:
            process.end()
            _BELOW.pop(thread, None)


def end_all(sweep: str, at_once: bool = True) -> None:
    """End the processes below this worker whose last case was of a sweep; those at work, too, if `at_once`."""
    if at_once:
        _OVER.add(sweep)
    mine = {thread: process for thread, process in list(_BELOW.items()) if process.sweep == sweep}
    for process in mine.values() if at_once else ():
        if process.is_at_work:
            process.kill()  # its thread does the rest
    idle = {thread: process for thread, process in mine.items() if not process.is_at_work}
    for process in idle.values():
        process.dismiss()
    until = time.monotonic() + LEAVE  # together
    for thread, process in idle.items():
        with suppress(subprocess.TimeoutExpired):
            process.popen.wait(max(0.0, until - time.monotonic()))
        process.end()
        _BELOW.pop(thread, None)


class _Process:
    """A process, or ranks under an `mpirun` of their own, that ends when its thread does, however that ends."""

    def __init__(self, ranks: int):
        self.cases, self.ranks, self.sweep = 0, ranks, ""
        self.is_at_work, self._ready = False, False
        self._complaints = tempfile.TemporaryFile("w+")  # noqa: SIM115 (closed with the process)
        self._said = b""
        with _STARTING:
            self.popen = subprocess.Popen(
                [*_on_ranks(ranks), sys.executable, "-P", "-c", COMMAND],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._complaints,
                env={**environment_of_one_rank(), "OMPI_MCA_mpi_yield_when_idle": "1"},
                start_new_session=True,  # an interrupt is the sweep's to deal with
                preexec_fn=partial(end_with_parent, os.getpid()),
            )

    def at_work_for(self, sweep: str) -> None:
        """Belong to a sweep from here on."""
        self.sweep, self.is_at_work = sweep, True

    def may_go_on(self, order: Order) -> bool:
        """Whether it can compute a further case."""
        is_worn = order.task != "judge" and self.cases >= RENEWED
        return self.popen.poll() is None and self.ranks == order.ranks and not is_worn

    def compute(self, order: Order) -> CaseOutcome:
        """See `computed_below`."""
        began, orders = time.monotonic(), cast("IO[bytes]", self.popen.stdin)
        complained = self._complaints.seek(0, os.SEEK_END)
        self.cases += 1
        with suppress(BrokenPipeError):
            orders.write(json.dumps([order.task, order.text]).encode() + b"\n")
            orders.flush()
        answer, reason = self._answer(order, began + order.limit)
        if answer:
            outcome = CaseOutcome(**json.loads(answer))
            return replace(outcome, log=(outcome.log + self._complained(complained))[-LONGEST_LOG:])
        reason = reason or self._epitaph()
        self.kill()
        if not self._ready and (self.popen.returncode or 0) >= 0:
            remedy = "remove the cause and repeat the command to resume"
            raise OutputError(f"no worker process starts: {reason}; {remedy}")
        said = f"host {socket.gethostname()}, ranks {order.ranks}\n{self._complained(complained)}"
        return CaseOutcome(
            reason=reason, wall=time.monotonic() - began, log=said[-LONGEST_LOG:], lost=True
        )

    def _answer(self, order: Order, until: float) -> tuple[str, str]:
        """The line with the outcome, or why it is not waited for any more; neither when the process has ended."""
        stream = cast("IO[bytes]", self.popen.stdout)
        watched = select.poll()
        watched.register(stream, select.POLLIN)
        while True:
            if watched.poll(1000 * LOOK):
                said = os.read(stream.fileno(), 1 << 20)
                *lines, self._said = (self._said + said).split(b"\n")
                self._ready = self._ready or READY.strip().encode() in lines
                # MPICH's mpirun writes of the end of a rank where the answer is expected.
                if answer := next((line for line in lines if line.startswith(b"{")), b""):
                    return answer.decode(), ""
                if not said:
                    return "", ""
            if time.monotonic() > until:
                return "", f"was ended: it took longer than {order.limit:.0f} s"
            if (
                order.memory_mib < float("inf")
                and (taken := _memory_mib(self.popen.pid)) > order.memory_mib
            ):
                return (
                    "",
                    f"was ended: it took {taken:.0f} MiB of memory, more than {order.memory_mib:.0f}",
                )

    def dismiss(self) -> None:
        """Let it end by itself, which `mpirun` needs to clean up."""
        with suppress(BrokenPipeError):
            cast("IO[bytes]", self.popen.stdin).close()

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
                cast("IO[bytes]", stream).close()

    def _epitaph(self) -> str:
        """Reason of its end, in one line."""
        with suppress(subprocess.TimeoutExpired):
            self.popen.wait(LEAVE)
        code = self.popen.poll()
        self.kill()
        lines = [line for line in self._complained(0).splitlines() if re.search(r"\w", line)]
        if code is not None and code < 0:
            return f"its process was ended by signal {-code}" + (
                ": not enough memory?" if code == -9 else ""
            )
        last = f": {' '.join(lines[-1].split())}" if lines else ""
        return f"its process ended with code {code}{last}"

    def _complained(self, start: int) -> str:
        """What it has written to its standard error from a place on."""
        size = os.fstat(self._complaints.fileno()).st_size
        start = max(start, size - LONGEST_LOG)
        return os.pread(self._complaints.fileno(), size - start, start).decode(errors="replace")


def _memory_mib(process: int) -> float:
    """Resident memory [MiB] of a process and all below it; zero where the system does not tell."""
    try:
        status = Path(f"/proc/{process}/statm").read_text()
        below = [
            one
            for task in Path(f"/proc/{process}/task").glob("*/children")
            for one in task.read_text().split()
        ]
    except OSError:
        return 0.0
    own = int(status.split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20
    return own + sum(_memory_mib(int(one)) for one in below)


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

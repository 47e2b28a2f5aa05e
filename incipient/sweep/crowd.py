"""Who computes the cases side by side: processes of this machine, or groups of the ranks of one `mpirun`.

A process that dies takes its case with it and nothing else; another is started in its place. Ranks of one `mpirun` end
together when one of them dies: then what is in the file stays, and the sweep is called again.
"""

from __future__ import annotations

import json
import os
import re
import selectors
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import IO, TYPE_CHECKING, Protocol

from ..cost.measurement import surroundings
from ..errors import Interrupted, OutputError, SceneError
from .cases import Case
from .store import Outcome
from .worker import READY, computed, end_with_parent

if TYPE_CHECKING:
    from mpi4py import MPI

RENEWED = 50  # cases with a flow after which a process is replaced, whatever memory it has lost by then
LEAVE = 5.0  # seconds that a process has to end
OFTEN = 0.02  # seconds between looks at messages of other ranks
_READY = f"{READY}\n".encode()
ORDER, ANSWER = 1, 2  # tags of messages


class Crowd(Protocol):
    """Those who compute; each has one case at a time."""

    places: int

    def idle(self) -> int:
        """How many have no case."""

    def give(self, case: Case) -> None:
        """Let an idle one compute a case."""

    def answers(self, seconds: float) -> list[tuple[Case, Outcome]]:
        """What has been finished, waiting for so long if nothing has."""

    def close(self, at_once: bool) -> None:
        """End all; those at work too if `at_once`."""


# -- processes ----------------------------------------------------------------------------------------------


@dataclass(eq=False)
class _Process:
    """One process, or ranks under an `mpirun` of their own, with the case it computes."""

    popen: subprocess.Popen[bytes]
    complaints: IO[str]
    case: Case | None = None
    given: float = 0.0
    cases: int = 0
    said: bytearray = field(default_factory=bytearray)
    ready: bool = False

    @classmethod
    def started(cls, ranks: int) -> _Process:
        """A new one; it ends when this process does, however that ends."""
        command = [sys.executable, "-P", "-m", "incipient.sweep.worker"]
        complaints = tempfile.TemporaryFile("w+")  # noqa: SIM115 (closed with the process)
        popen = subprocess.Popen(
            [*_on_ranks(ranks), *command],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=complaints,
            env={**surroundings(), "OMPI_MCA_mpi_yield_when_idle": "1"},
            start_new_session=True,  # an interrupt is the sweep's to deal with
            preexec_fn=partial(end_with_parent, os.getpid()),
        )
        return cls(popen, complaints)

    def give(self, case: Case) -> None:
        """Order a case; that a process has died is told by its silence."""
        self.case, self.given, self.cases = case, time.perf_counter(), self.cases + 1
        order = json.dumps({"task": case.task, "text": case.text}).encode() + b"\n"
        assert self.popen.stdin is not None
        with suppress(BrokenPipeError):
            self.popen.stdin.write(order)
            self.popen.stdin.flush()

    def hear(self, piece: bytes) -> None:
        """Take what it says; its first line says that it is there."""
        self.said += piece
        if not self.ready and self.said.startswith(_READY):
            self.ready = True
            del self.said[: len(_READY)]

    def dismiss(self) -> None:
        """Let it end by itself, which `mpirun` needs to clean up, but not for long."""
        assert self.popen.stdin is not None
        with suppress(BrokenPipeError, subprocess.TimeoutExpired):
            self.popen.stdin.close()
            self.popen.wait(LEAVE)

    def end(self) -> int:
        """Kill it with all that it has started; its exit code."""
        with suppress(ProcessLookupError):
            os.killpg(self.popen.pid, signal.SIGKILL)
        code = self.popen.wait()
        for stream in (self.popen.stdin, self.popen.stdout):
            if stream is not None:
                with suppress(BrokenPipeError):
                    stream.close()
        return code

    def epitaph(self) -> str:
        """Why it has ended, in one line."""
        with suppress(subprocess.TimeoutExpired):
            self.popen.wait(5.0)
        code = self.popen.poll()
        self.end()
        self.complaints.seek(0)
        lines = [line for line in self.complaints.read().splitlines() if re.search(r"\w", line)]
        if code is not None and code < 0:
            return f"its process was ended by signal {-code}" + (": not enough memory?" if code == -9 else "")
        last = f": {' '.join(lines[-1].split())}" if lines else ""
        return f"its process ended with code {code}{last}"


class Processes:
    """So many processes of this machine, each with its own ranks; started when there is something to do."""

    def __init__(self, places: int, ranks: int = 1):
        self.places, self._ranks = places, ranks
        self._working: list[_Process] = []
        self._waiting: list[_Process] = []
        self._selector = selectors.DefaultSelector()

    def idle(self) -> int:
        """How many have no case."""
        return self.places - len(self._working)

    def give(self, case: Case) -> None:
        """Let an idle process, else a new one, compute a case."""
        process = self._waiting.pop() if self._waiting else self._started()
        process.give(case)
        self._working.append(process)

    def _started(self) -> _Process:
        process = _Process.started(self._ranks)
        assert process.popen.stdout is not None
        os.set_blocking(process.popen.stdout.fileno(), False)
        self._selector.register(process.popen.stdout, selectors.EVENT_READ, process)
        return process

    def answers(self, seconds: float) -> list[tuple[Case, Outcome]]:
        """What has been finished; a process that has died leaves its case with the reason.

        Raises:
            OutputError: one has ended by itself before it began: that is not the case's fault, and all would.
        """
        found = []
        for key, _ in self._selector.select(seconds):
            process: _Process = key.data
            piece = process.popen.stdout.read(1 << 20) if process.popen.stdout else b""
            process.hear(piece or b"")
            if piece == b"":
                found += self._died(process)
            elif process.said.endswith(b"\n"):
                found.append(self._answered(process))
        return found

    def _answered(self, process: _Process) -> tuple[Case, Outcome]:
        case, outcome = process.case, Outcome(**json.loads(process.said))
        assert case is not None
        process.said.clear()
        process.case = None
        self._working.remove(process)
        if case.scene is not None and process.cases >= RENEWED:
            self._forget(process)
        else:
            self._waiting.append(process)
        return case, outcome

    def _died(self, process: _Process) -> list[tuple[Case, Outcome]]:
        case, wall = process.case, time.perf_counter() - process.given
        for those in (self._working, self._waiting):
            if process in those:
                those.remove(process)
        self._selector.unregister(process.popen.stdout)  # type: ignore[arg-type]
        reason = process.epitaph()
        process.complaints.close()
        if not process.ready and process.popen.returncode >= 0:
            raise OutputError(f"no process can compute cases: {reason}; see to that, and call again to go on")
        return [] if case is None else [(case, Outcome(reason=reason, wall=wall))]

    def _forget(self, process: _Process) -> None:
        self._selector.unregister(process.popen.stdout)  # type: ignore[arg-type]
        process.end()
        process.complaints.close()

    def close(self, at_once: bool) -> None:
        """End all processes; none is at work unless `at_once`."""
        if not at_once:
            for process in self._waiting:
                process.dismiss()
        for process in (*self._working, *self._waiting):
            self._forget(process)
        self._working, self._waiting = [], []
        self._selector.close()


def _on_ranks(number: int) -> list[str]:
    """The start of a command on several ranks, by the `mpirun` of the MPI that Python uses.

    Open MPI would tie the ranks of each `mpirun` to the same cores.
    """
    if number == 1:
        return []
    from pathlib import Path

    from mpi4py import MPI

    beside = Path(sys.executable).with_name("mpirun")
    command = [str(beside) if beside.exists() else "mpirun", "-n", str(number)]
    own = ["--oversubscribe", "--bind-to", "none"]
    return command + (own if "Open MPI" in MPI.Get_library_version() else [])


# -- ranks --------------------------------------------------------------------------------------------------


class Ranks:
    """Groups of the ranks of one `mpirun`; the first rank only gives out cases. Made by it while others `serve`."""

    def __init__(self, comm: MPI.Comm, ranks: int = 1):
        self._comm, self.places = comm, groups(comm, ranks)
        _group(comm, ranks)
        self._leaders = [1 + ranks * number for number in range(self.places)]
        self._at: dict[int, Case] = {}

    def idle(self) -> int:
        """How many groups have no case."""
        return self.places - len(self._at)

    def give(self, case: Case) -> None:
        """Let an idle group compute a case."""
        leader = next(one for one in self._leaders if one not in self._at)
        self._comm.send((case.task, case.text), leader, ORDER)
        self._at[leader] = case

    def answers(self, seconds: float) -> list[tuple[Case, Outcome]]:
        """What has been finished."""
        until, found = time.monotonic() + seconds, []
        while True:
            for leader in [one for one in self._at if self._comm.iprobe(one, ANSWER)]:
                found.append((self._at.pop(leader), self._comm.recv(source=leader, tag=ANSWER)))
            if found or time.monotonic() >= until:
                return found
            time.sleep(OFTEN)

    def close(self, at_once: bool) -> None:
        """Let the groups go; with `at_once`, and some at work, end all ranks, this one too."""
        sys.stdout.flush()
        sys.stderr.flush()
        if at_once and self._at:
            self._comm.Abort(Interrupted.exit_code)
        for leader in self._leaders:
            self._comm.send(None, leader, ORDER)


def serve(comm: MPI.Comm, ranks: int) -> None:
    """Compute what the first rank orders until it orders nothing more; for all ranks but that. Collective."""
    group = _group(comm, ranks)
    while group:
        order = group.bcast(_received(comm) if group.rank == 0 else None)
        if order is None:
            return
        task, text = order
        outcome = computed(task, text, group)
        if group.rank == 0:
            comm.send(outcome, 0, ANSWER)


def _group(comm: MPI.Comm, ranks: int) -> MPI.Comm:
    """The ranks that compute cases together with this one; none, which is false, for the first and those left over."""
    from mpi4py import MPI

    number, last = (comm.rank - 1) // ranks, groups(comm, ranks)
    return comm.Split(number if 0 <= number < last else MPI.UNDEFINED, comm.rank)


def _received(comm: MPI.Comm) -> Sequence[str] | None:
    """The next order; a rank that waits leaves the processor to others."""
    while not comm.iprobe(0, ORDER):
        time.sleep(OFTEN)
    return comm.recv(source=0, tag=ORDER)


def groups(comm: MPI.Comm, ranks: int) -> int:
    """How many groups of so many ranks there are beside the first rank.

    Raises:
        SceneError: on all ranks, there is none.
    """
    number = (comm.size - 1) // ranks
    if number < 1:
        raise SceneError(
            f"--ranks {ranks}: one rank gives out the cases, and {comm.size - 1} are left; start {ranks + 1} or more"
        )
    return number

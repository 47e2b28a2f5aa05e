"""Whole processes measured from outside: wall time, processor time, peak memory, and what they computed.

Programs to be compared run alternately, round by round, so that a busy moment of the machine hits all of them.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Usage:
    """Cost and output of one process: seconds, MiB of its largest process; a negative exit code is a signal's."""

    wall: float
    cpu: float
    peak_mib: float
    exit_code: int
    output: str
    errors: str


@dataclass(frozen=True)
class Program:
    """Something to run and to compare: `read` takes the numbers from what the process printed or left."""

    name: str
    family: str
    command: tuple[str, ...]
    read: Callable[[Usage], dict[str, Any]]
    about: dict[str, Any] = field(default_factory=dict)


def measure(command: Sequence[str], environment: Mapping[str, str] | None = None) -> Usage:
    """Run a command in the project's directory to its end.

    The kernel counts the peak of a new process from that of the one that starts it. It is that of the command as long
    as this process is the smaller one: nothing here loads the finite elements.
    """
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as errors:
        began = time.perf_counter()
        streams = {"stdin": subprocess.DEVNULL, "stdout": output, "stderr": errors}
        process = subprocess.Popen(command, cwd=ROOT, env=environment, **streams)
        try:
            _, status, used = os.wait4(process.pid, 0)
        except BaseException:
            process.kill()
            process.wait()
            raise
        wall = time.perf_counter() - began
        process.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        errors.seek(0)
        cpu, peak = used.ru_utime + used.ru_stime, used.ru_maxrss / 1024
        return Usage(wall, cpu, peak, process.returncode, output.read(), errors.read())


class Session:
    """One run of the benchmarks: where programs are found, how often each runs, what has been said.

    Args:
        repeat: measured rounds after the warm-up.
        scratch: directory for what the programs write.
    """

    def __init__(self, repeat: int, scratch: Path):
        self.repeat, self.scratch = repeat, scratch
        self.cores = sorted(os.sched_getaffinity(0))
        self.environment = _environment()
        self._count = 0

    def say(self, text: str) -> None:
        """Tell how far the session is."""
        print(f"[{time.strftime('%H:%M:%S')}] {text}", file=sys.stderr, flush=True)

    def directory(self) -> Path:
        """A new directory name for results."""
        self._count += 1
        return self.scratch / f"{self._count:04d}"

    def compare(self, programs: Sequence[Program]) -> list[dict[str, Any]]:
        """Rows of all programs, run in turn: one round to warm up (forms compile), then the measured ones."""
        taken: list[list[Usage]] = [[] for _ in programs]
        numbers: list[dict[str, Any]] = [{} for _ in programs]
        for turn in range(self.repeat + 1):
            for i, program in enumerate(programs):
                if "error" in numbers[i]:
                    continue
                usage, numbers[i] = self._run(program)
                if turn > 0:
                    taken[i].append(usage)
            self.say(f"round {turn} of {self.repeat}: {len(programs)} programs")
        return [_row(p, t, n) for p, t, n in zip(programs, taken, numbers, strict=True)]

    def once(
        self, program: Program, environment: Mapping[str, str] | None = None
    ) -> dict[str, Any]:
        """Row of a single run, for programs that take long; the caller has seen to compiled forms."""
        usage, numbers = self._run(program, environment)
        return _row(program, [usage], numbers)

    def _run(
        self, program: Program, environment: Mapping[str, str] | None = None
    ) -> tuple[Usage, dict[str, Any]]:
        usage = measure(program.command, {**self.environment, **(environment or {})})
        if usage.exit_code != 0:
            return usage, {"error": _complaint(usage)}
        return usage, program.read(usage)


def on_cores(cores: Sequence[int]) -> None:
    """Bind this process, and so all that it starts, to these cores."""
    os.sched_setaffinity(0, set(cores))


def last_line(usage: Usage) -> dict[str, Any]:
    """Numbers of a program that prints them as one line of JSON at its end."""
    return json.loads(usage.output.strip().splitlines()[-1])


def _environment() -> dict[str, str]:
    environment = dict(os.environ)
    environment |= dict.fromkeys(ONE_THREAD, "1")
    # UFL's signature of a form may depend on the order of a set: fixed, or cached forms compile again.
    environment["PYTHONHASHSEED"] = "0"
    environment |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    return environment


def _complaint(usage: Usage) -> str:
    lines = usage.errors.strip().splitlines() or [f"exit code {usage.exit_code}"]
    return lines[-1].replace(str(ROOT), "")[:200]


def _row(program: Program, taken: Sequence[Usage], numbers: dict[str, Any]) -> dict[str, Any]:
    row = {"name": program.name, "family": program.family, **program.about, **numbers}
    if "error" in numbers or not taken:
        return row
    for key in ("wall", "cpu", "peak_mib"):
        row[key] = round(median(getattr(usage, key) for usage in taken), 3)
    row["wall_of_each_run"] = [round(usage.wall, 3) for usage in taken]
    return row

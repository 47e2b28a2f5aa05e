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

from tables import ROOT, Row

ENVIRONMENT = {
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"),
    # UFL's signature of a form may depend on the order of a set: fixed, or cached forms compile again.
    "PYTHONHASHSEED": "0",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
}


@dataclass(frozen=True)
class Usage:
    """Cost and output of one process: seconds, MiB of its largest process; a negative exit code is a signal's."""

    wall: float
    cpu: float
    peak_mib: float
    exit_code: int
    output: str
    errors: str

    @property
    def complaint(self) -> str:
        """The last line of its errors."""
        lines = self.errors.strip().splitlines() or [f"exit code {self.exit_code}"]
        return lines[-1].replace(str(ROOT), "")[:200]


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
        process = subprocess.Popen(
            command,
            cwd=ROOT,
            env={**os.environ, **ENVIRONMENT, **(environment or {})},
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=errors,
        )
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


@dataclass(frozen=True)
class Session:
    """One run of the benchmarks: measured rounds after the warm-up, directory for what the programs write, cores."""

    repeat: int
    scratch: str
    cores: tuple[int, ...]

    def directory(self) -> Path:
        """A new directory for results."""
        return Path(tempfile.mkdtemp(dir=self.scratch))

    def compare(self, programs: Sequence[Program]) -> list[Row]:
        """Rows of all programs, run in turn: one round to warm up (forms compile), then the measured ones."""
        usages: list[list[Usage]] = [[] for _ in programs]
        for turn in range(self.repeat + 1):
            for program, runs in zip(programs, usages, strict=True):
                if not runs or runs[-1].exit_code == 0:
                    runs.append(measure(program.command))
            say(f"round {turn} of {self.repeat}: {len(programs)} programs")
        return [
            _row(program, runs[1:] or runs) for program, runs in zip(programs, usages, strict=True)
        ]

    def once(self, program: Program, environment: Mapping[str, str] | None = None) -> Row:
        """Row of a single run, for programs that take long; the caller has seen to compiled forms."""
        row = _row(program, [measure(program.command, environment)])
        say(
            f"{program.family}, {program.name}: {row.get('error') or format(row['wall'], '.2f') + ' s'}"
        )
        return row


def _row(program: Program, usages: Sequence[Usage]) -> Row:
    row = {"name": program.name, "family": program.family, **program.about}
    if usages[-1].exit_code != 0:
        return {**row, "error": usages[-1].complaint}
    row |= program.read(usages[-1])
    for key in ("wall", "cpu", "peak_mib"):
        row[key] = round(median(getattr(usage, key) for usage in usages), 3)
    row["wall_of_each_run"] = [round(usage.wall, 3) for usage in usages]
    return row


def say(text: str) -> None:
    """Tell how far the benchmarks are."""
    print(f"[{time.strftime('%H:%M:%S')}] {text}", file=sys.stderr, flush=True)


def last_line(usage: Usage) -> dict[str, Any]:
    """Numbers of a program that prints them as one line of JSON at its end."""
    return json.loads(usage.output.strip().splitlines()[-1])

"""Cost and results of a rung, in a separate process that isolates time and memory.

`python -m incipient.cost.measurement TASK` reads a scene as TOML and prints a line of JSON.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from ..errors import ConvergenceError, IncipientError, SceneError
from ..parallel import ONE_RANK, environment_alone, start_alone_quickly
from ..results.timing import peak_memory_mib
from ..scene import Scene, loads
from ..scene.file import dumps
from ..simulation.recorder import Recorder
from ..simulation.simulate import simulate
from . import quantities
from .ladder import Rung
from .quantities import Quantity

if TYPE_CHECKING:
    from mpi4py import MPI


@dataclass(frozen=True)
class MeasuredRun:
    """Cost of a process (seconds, MiB, Newton updates) and results; `failed`: reason for a missing result."""

    rung: Rung
    wall: float = 0.0
    cpu: float = 0.0
    peak_mib: float = 0.0
    cells: int = 0
    unknowns: int = 0
    newton: int = 0
    quantities: dict[str, Quantity] = field(default_factory=dict)
    failed: str = ""

    @property
    def numbers(self) -> dict[str, float]:
        every = (quantity.numbers.items() for quantity in self.quantities.values())
        return {name: value for numbers in every for name, value in numbers}


def measure(scene: Scene, rung: Rung, task: str) -> MeasuredRun:
    """Run a rung in a separate process, twice if forms were compiled."""
    try:
        text = dumps(rung.of(scene))
    except SceneError as error:
        return MeasuredRun(rung, failed=str(error))
    measured, compiled = _once(rung, text, task)
    return _once(rung, text, task)[0] if compiled and not measured.failed else measured


def _once(rung: Rung, text: str, task: str) -> tuple[MeasuredRun, bool]:
    # -P: no modules from the working directory. In a new session interrupts reach the parent alone.
    began = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-P", "-m", "incipient.cost.measurement", task],
        input=text,
        capture_output=True,
        text=True,
        env=environment_alone() | ONE_RANK,
        start_new_session=True,
    )
    if done.returncode != 0:
        said = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
        killed = f"ended by signal {-done.returncode} (9: often by a lack of memory)"
        why = killed if done.returncode < 0 else said[-1].removeprefix("incipient: ")
        return MeasuredRun(rung, failed=why), False
    measured = json.loads(done.stdout.strip().splitlines()[-1])
    compiled = measured.pop("compiling") > 0.05  # CPU time [s] of compilers
    values = {name: Quantity(**value) for name, value in measured.pop("quantities").items()}
    wall = time.perf_counter() - began
    return MeasuredRun(rung, wall, quantities=values, **measured), compiled


def computed(scene: Scene, task: str, comm: MPI.Comm) -> dict[str, Any]:
    """Run a scene for the content of a `MeasuredRun` without wall time. Collective."""
    if task == "threshold":
        from ..thresholds.critical import find_threshold

        threshold = find_threshold(scene, comm)
        if not threshold.is_critical:
            raise ConvergenceError(f"there is no critical flow: {threshold.reason}")
        cost, values = threshold.cost, quantities.of_threshold(threshold)
    else:
        history = Recorder()
        result = simulate(scene, comm, history)
        cost, values = result.cost, quantities.of_run(scene, result, history.rows)
    if not values:
        raise ConvergenceError("its result has no quantity to compare")
    compilers = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {
        "cpu": time.process_time(),
        "peak_mib": peak_memory_mib(),
        "cells": cost["cells"],
        "unknowns": cost["unknowns"],
        "newton": cost["iterations"].get("newton", 0),
        "quantities": {name: asdict(quantity) for name, quantity in values.items()},
        "compiling": compilers.ru_utime + compilers.ru_stime,
    }


def main() -> int:
    """Run the scene on standard input, print its `MeasuredRun` as JSON; returns the exit code."""
    start_alone_quickly()
    from mpi4py import MPI

    try:
        print(json.dumps(computed(loads(sys.stdin.read()), sys.argv[1], MPI.COMM_SELF)))
    except IncipientError as error:
        print(f"incipient: {error}", file=sys.stderr)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())

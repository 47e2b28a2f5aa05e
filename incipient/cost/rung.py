"""One run among many of the same scene: how finely it is computed, and what that takes and gives.

Each run has a process of its own, so that time and memory are its own. `python -m incipient.cost.rung` is that
process: it reads a scene as TOML and prints one line of JSON.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..recorder import Unrecorded
from ..scene import Scene

if TYPE_CHECKING:
    from mpi4py import MPI

# What would make the new process take part in a parallel run.
PARALLEL = ("OMPI_COMM_", "OMPI_UNIVERSE", "PMIX_", "PMI_", "ORTE_")
COMPILED = 0.05  # processor time [s] of compilers that tells that forms were compiled
COUNTS = ("steps", "newton", "factorisations", "krylov", "remeshings")


@dataclass(frozen=True, order=True)
class Rung:
    """How finely: order of the velocity, factor on cell sizes, time step (None: steady)."""

    order: int
    mesh_size: float
    step: float | None = None

    @property
    def name(self) -> str:
        """Such as "P3-P2, mesh_size 0.5, step 0.01"."""
        step = "" if self.step is None else f", step {self.step:.4g}"
        return f"P{self.order}-P{self.order - 1}, mesh_size {self.mesh_size:.4g}{step}"

    @property
    def key(self) -> tuple[int, str, str]:
        """What tells rungs apart in a file of rounded numbers."""
        return self.order, f"{self.mesh_size:.6g}", "" if self.step is None else f"{self.step:.6g}"

    def of(self, scene: Scene) -> Scene:
        """The scene computed so finely, without error bars and files.

        Raises:
            SceneError: the scene cannot be computed so.
        """
        from ..accuracy.errorbars import changed

        numerics = {"order": self.order, "mesh_size": self.mesh_size, "geometry_order": None}
        sections: dict[str, dict[str, Any]] = {"numerics": {**numerics, "error_bars": False}}
        # An accuracy asked for would choose the mesh itself.
        for name in ("accuracy", "budget_seconds", "budget_mib"):
            if name in type(scene.numerics).model_fields:
                sections["numerics"][name] = None
        sections["output"] = {"fields": False, "pictures": False, "every": 0, "checkpoint": 0}
        if self.step is not None:
            # A step that adapts itself would not be the rung's.
            sections["time"] = {"step": self.step, "tolerance": None}
        return changed(scene, **sections)


@dataclass(frozen=True)
class Measured:
    """What a run took and gave.

    wall, cpu: seconds of the whole process; start: processor time until everything was imported
    counts:    time steps, Newton corrections, factorisations, Krylov iterations, new meshes
    found:     the numbers its accuracy is measured by
    failed:    why it gave nothing; the rest is then empty
    """

    rung: Rung
    wall: float
    cpu: float
    start: float = 0.0
    peak_mib: float = 0.0
    cells: int = 0
    unknowns: int = 0
    counts: Mapping[str, int] = field(default_factory=dict)
    found: Mapping[str, float] = field(default_factory=dict)
    failed: str = ""


def measure(scene: Scene, rung: Rung) -> Measured:
    """Run a scene at a rung in a process of its own; a run that compiled forms is made again. Not collective.

    A run that fails is not an error: `failed` says why.
    """
    measured, compiled = _once(scene, rung)
    return _once(scene, rung)[0] if compiled and not measured.failed else measured


def _once(scene: Scene, rung: Rung) -> tuple[Measured, bool]:
    from ..errors import SceneError
    from ..scene.file import dumps

    try:
        text = dumps(rung.of(scene))
    except SceneError as error:
        return Measured(rung, 0.0, 0.0, failed=str(error)), False
    code, wall, cpu, said, complained = _process([sys.executable, "-m", "incipient.cost.rung"], text)
    if code != 0:
        return Measured(rung, wall, cpu, failed=_complaint(code, complained)), False
    told = json.loads(said.strip().splitlines()[-1])
    compiled = told.pop("compiling") > COMPILED
    return Measured(rung, wall, cpu, **told), compiled


def _process(command: list[str], text: str) -> tuple[int, float, float, str, str]:
    """Exit code, wall and processor time, output and errors of a process that reads a text."""
    with (
        tempfile.TemporaryFile("w+") as given,
        tempfile.TemporaryFile("w+") as output,
        tempfile.TemporaryFile("w+") as errors,
    ):
        given.write(text)
        given.seek(0)
        began = time.perf_counter()
        process = subprocess.Popen(
            command, stdin=given, stdout=output, stderr=errors, env=surroundings(), start_new_session=True
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
        return process.returncode, wall, used.ru_utime + used.ru_stime, output.read(), errors.read()


def surroundings() -> dict[str, str]:
    """The environment of a run alone: one thread, no part in a parallel run, names of forms that stay."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(PARALLEL)}
    # A form's signature may depend on the order of a set: fixed, or forms would be compiled again.
    return {**kept, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}


def _complaint(code: int, errors: str) -> str:
    if code < 0:
        return f"ended by signal {-code}" + (": not enough memory?" if code == -9 else "")
    lines = errors.strip().splitlines() or [f"exit code {code}"]
    return lines[-1].removeprefix("incipient: ")


# -- the process --------------------------------------------------------------------------------------------


class _Rows(Unrecorded):
    """Keeps the history of a run."""

    def __init__(self) -> None:
        self.rows: list[dict[str, Any]] = []

    def step(self, row: dict[str, Any]) -> None:
        self.rows.append(row)


def main() -> int:
    """Run the scene on standard input and tell what it took and gave; the exit code."""
    from ..cli import start_alone_quickly
    from ..errors import IncipientError

    start_alone_quickly()
    from mpi4py import MPI

    from ..scene import loads

    try:
        print(json.dumps(told(loads(sys.stdin.read()), MPI.COMM_SELF)))
    except IncipientError as error:
        print(f"incipient: {error}", file=sys.stderr)
        return error.exit_code
    return 0


def told(scene: Scene, comm: MPI.Comm) -> dict[str, Any]:
    """Run a scene; what `Measured` holds beside the times of the whole process. Collective."""
    from .. import boundaries, domain, fluid, simulation, tractions  # noqa: F401 (the start is over then)
    from .quantities import quantities

    start, recorder = time.process_time(), _Rows()
    result = simulation.simulate(scene, comm, recorder)
    counted = {
        **result.cost["iterations"],
        "remeshings": len((result.trajectory or {}).get("remeshings", ())),
    }
    compilers = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {
        "start": start,
        "peak_mib": _peak_mib(),
        "cells": result.cost["cells"],
        "unknowns": result.cost["unknowns"],
        "counts": {name: int(counted.get(name, 0)) for name in COUNTS},
        "found": quantities(scene, result, recorder.rows),
        "compiling": compilers.ru_utime + compilers.ru_stime,
    }


def _peak_mib() -> float:
    """Largest resident memory of this program; the kernel's other count has that of the starting process in it."""
    from ..ledger import peak_memory_mib

    status = Path("/proc/self/status")
    lines = status.read_text().splitlines() if status.exists() else []
    peaks = [int(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM:")]
    return peaks[0] if peaks else peak_memory_mib()


if __name__ == "__main__":
    sys.exit(main())

"""One run among many of the same scene: how finely it is computed, and what that takes and gives.

Each run has a process of its own, so that time and memory are its own. `python -m incipient.cost.measurement` is that
process: it reads a scene as TOML and prints one line of JSON.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

from ..accuracy.coarse_runs import changed
from ..errors import IncipientError, SceneError
from ..parallel import start_alone_quickly
from ..results.timing import peak_memory_mib
from ..scene import Scene, loads
from ..scene.file import dumps
from ..simulation.recorder import Recorder
from ..simulation.simulate import simulate
from . import process
from .quantities import ComparedNumbers
from .solvers import SolverOptions, options

if TYPE_CHECKING:
    from mpi4py import MPI

COMPILED = 0.05  # processor time [s] of compilers that tells that forms were compiled
ENOUGH = 5.0  # processor time [s] after which a run is not made again


@dataclass(frozen=True, order=True)
class Variant:
    """Resolution: order of the velocity, factor on cell sizes, time step (None: steady); and how it is solved.

    solver: words of `solvers`, empty for the scene's own
    """

    order: int
    mesh_size: float
    step: float | None = None
    solver: str = ""

    @property
    def name(self) -> str:
        """Name such as "P3-P2, mesh_size 0.5, step 0.01, extrapolated"."""
        step = "" if self.step is None else f", step {self.step:.4g}"
        solver = f", {self.solver}" if self.solver else ""
        return f"P{self.order}-P{self.order - 1}, mesh_size {self.mesh_size:.4g}{step}{solver}"

    @property
    def key(self) -> tuple[int, str, str, str]:
        """Key of the variant in a file of rounded numbers."""
        step = "" if self.step is None else f"{self.step:.6g}"
        return self.order, f"{self.mesh_size:.6g}", step, self.solver

    def of(self, scene: Scene) -> Scene:
        """The scene at this resolution, without error bars and files; PETSc's options are not part of it.

        Raises:
            SceneError: the scene cannot be computed so.
        """
        # An accuracy asked for would choose the mesh itself.
        chosen = ("accuracy", "accuracy_includes", "budget_seconds", "budget_mib", "geometry_order")
        numerics: dict[str, Any] = {
            name: type(scene.numerics).model_fields[name].default for name in chosen
        }
        numerics |= {"order": self.order, "mesh_size": self.mesh_size, "error_bars": False}
        output = {"fields": False, "pictures": False, "every": 0, "checkpoint": 0}
        sections: dict[str, dict[str, Any]] = {"numerics": numerics, "output": output}
        if self.step is not None:
            # A step that adapts itself would not be the variant's.
            sections["time"] = {"step": self.step, "tolerance": None}
        for name, keys in SolverOptions(scene).sections(self.solver).items():
            sections[name] = sections.get(name, {}) | keys
        return changed(scene, **sections)


@dataclass(frozen=True)
class Counts:
    """Time steps, Newton corrections, factorisations, Krylov iterations, new meshes after the first of a run."""

    steps: int = 0
    newton: int = 0
    factorisations: int = 0
    krylov: int = 0
    remeshings: int = 0

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> Counts:
        """Counts from numbers by name; missing ones are zero, other names are ignored."""
        return cls(**{one.name: int(data.get(one.name, 0)) for one in fields(cls)})


@dataclass(frozen=True)
class MeasuredRun:
    """Cost and numbers of a run.

    wall, cpu: seconds of the whole process; start: processor time until everything was imported
    found:     the numbers its accuracy is measured by
    failed:    why it gave nothing; the rest is then empty
    """

    variant: Variant
    wall: float
    cpu: float
    start: float = 0.0
    peak_mib: float = 0.0
    cells: int = 0
    unknowns: int = 0
    counts: Counts = Counts()
    found: Mapping[str, float] = field(default_factory=dict)
    failed: str = ""


@dataclass(frozen=True)
class JudgedRun:
    """A run with its errors: by goal, and the largest of the leading ones.

    told_apart: whether that error is clearly more than the doubt about the reference
    """

    run: MeasuredRun
    errors: Mapping[str, float]
    error: float
    told_apart: bool


def measure(scene: Scene, variant: Variant) -> MeasuredRun:
    """Run a variant in its own process, again if it compiled forms; `failed` says why a run fails. Not collective."""
    try:
        text = dumps(variant.of(scene))
    except SceneError as error:
        return MeasuredRun(variant, 0.0, 0.0, failed=str(error))
    measured, compiled = _once(variant, text)
    return _once(variant, text)[0] if compiled and not measured.failed else measured


def quicker(scene: Scene, variant: Variant) -> MeasuredRun:
    """The quicker of two runs by `measure`, so that chance counts less; of a long run the only one. Not collective."""
    first = measure(scene, variant)
    if first.failed or first.cpu > ENOUGH:
        return first
    return min(first, measure(scene, variant), key=lambda run: (bool(run.failed), run.cpu))


def _once(variant: Variant, text: str) -> tuple[MeasuredRun, bool]:
    """One run of a variant, a scene as TOML, and whether it compiled forms."""
    # -P: modules are not looked for in the working directory.
    command = [sys.executable, "-P", "-m", "incipient.cost.measurement"]
    environment = process.environment_of_one_rank(options(variant.solver))
    # In a session of its own: an interrupt is this process's to deal with.
    used = process.run(command, environment, given=text, apart=True)
    if used.exit_code != 0:
        why = _complaint(used.exit_code, used.errors)
        return MeasuredRun(variant, used.wall, used.cpu, failed=why), False
    measured = json.loads(used.output.strip().splitlines()[-1])
    compiled = measured.pop("compiling") > COMPILED
    counts = Counts.of(measured.pop("counts"))
    return MeasuredRun(variant, used.wall, used.cpu, counts=counts, **measured), compiled


def _complaint(code: int, errors: str) -> str:
    if code < 0:
        return f"ended by signal {-code}" + (": not enough memory?" if code == -9 else "")
    lines = errors.strip().splitlines() or [f"exit code {code}"]
    return lines[-1].removeprefix("incipient: ")


class _History(Recorder):
    """Keeps the history of a run."""

    def __init__(self) -> None:
        self.rows: list[dict[str, Any]] = []

    def step(self, row: dict[str, Any]) -> None:
        """See `recorder.Recorder`."""
        self.rows.append(row)


def main() -> int:
    """Run the scene on standard input and print what it took and gave as JSON; returns the exit code."""
    start_alone_quickly()
    from mpi4py import MPI

    try:
        print(json.dumps(computed(loads(sys.stdin.read()), MPI.COMM_SELF)))
    except IncipientError as error:
        print(f"incipient: {error}", file=sys.stderr)
        return error.exit_code
    return 0


def computed(scene: Scene, comm: MPI.Comm) -> dict[str, Any]:
    """Run a scene; the contents of a `MeasuredRun` but for the times of the whole process. Collective."""
    from ..coupled import tractions  # noqa: F401 (the start is over then)

    start, recorder = time.process_time(), _History()
    result = simulate(scene, comm, recorder)
    remeshings = len((result.trajectory or {}).get("remeshings", ()))
    counted = {**result.cost["iterations"], "remeshings": remeshings}
    compilers = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {
        "start": start,
        "peak_mib": peak_memory_mib(),
        "cells": result.cost["cells"],
        "unknowns": result.cost["unknowns"],
        "counts": vars(Counts.of(counted)),
        "found": ComparedNumbers(scene).of_run(result, recorder.rows),
        "compiling": compilers.ru_utime + compilers.ru_stime,
    }


if __name__ == "__main__":
    sys.exit(main())

"""Cost of a rung in a separate process, which isolates time and memory, and the quantities compared between rungs.

`python -m incipient.cost.measurement TASK` reads a scene as TOML and prints a line of JSON.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import TypeAdapter

from ..accuracy.goal import place_of_shear_velocity
from ..accuracy.run import run_scene
from ..arrays import Floats, point
from ..errors import ConvergenceError, IncipientError, SceneError
from ..geometry.placement import Placement
from ..parallel import ONE_RANK, environment_alone, start_alone_quickly
from ..results.loads import columns_of_load
from ..results.result import Result
from ..results.timing import peak_memory_mib
from ..scene import Scene, loads
from ..scene.file import dumps
from ..simulation.state import Recorder
from .ladder import Rung

if TYPE_CHECKING:
    from mpi4py import MPI

TIMES = 16  # number of times at which elevations are compared


@dataclass(frozen=True)
class Quantity:
    """Numbers of a result by name; their error is the norm of the differences over a scale."""

    numbers: Mapping[str, float]
    scale: float

    @classmethod
    def of(cls, numbers: Mapping[str, float], least: float = 0.0) -> Quantity:
        """A quantity whose scale is its norm, and at least a number."""
        return cls(numbers, max(float(np.linalg.norm([*numbers.values()])), least))

    def error(self, numbers: Mapping[str, float]) -> float:
        differences = [numbers[name] - value for name, value in self.numbers.items()]
        return float(np.linalg.norm(differences)) / self.scale


Quantities = dict[str, Quantity]


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
        return {
            name: value
            for quantity in self.quantities.values()
            for name, value in quantity.numbers.items()
        }


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
    measured |= {"rung": rung, "wall": time.perf_counter() - began}
    return TypeAdapter(MeasuredRun).validate_python(measured), compiled


def computed(scene: Scene, task: str, comm: MPI.Comm) -> dict[str, Any]:
    """Run a scene for the content of a `MeasuredRun` without wall time. Collective."""
    if task == "threshold":
        from ..thresholds.critical import find_threshold

        threshold = find_threshold(scene, comm)
        if not threshold.is_critical:
            raise ConvergenceError(f"there is no critical flow: {threshold.reason}")
        cost, values = threshold.cost, _singles({"critical flow": threshold.factor})
    else:
        history = Recorder()
        result = run_scene(scene, comm, history)
        cost, values = result.cost, of_run(scene, result, history.rows)
    if not values:
        raise ConvergenceError(
            "its result has no quantity to compare; give a flow that loads a grain"
        )
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


# -- quantities --------------------------------------------------------------------------------------


def of_run(scene: Scene, result: Result, history: Sequence[Mapping[str, Any]]) -> Quantities:
    """Quantities of a finished run, with a `history` row per time step. Collective."""
    if scene.body is None:
        seen = result.elevations is not None and result.elevations.values.size
        return _of_surface(scene, result) if seen else _of_flow(scene, result)
    if result.trajectory is not None:
        return _of_path(scene, result, history)
    if scene.time is not None:
        return _of_loads(scene, _extremes(scene, history))
    safety = {"safety factor": (result.verdict or {}).get("safety_factor") or np.nan}
    return _of_loads(scene, columns_of_load(result.load, scene.gdim)) | _singles(safety)


def _of_flow(scene: Scene, result: Result) -> Quantities:
    if result.centrelines is not None:
        values = {name: extreme.value for name, extreme in result.centrelines.items()}
    elif (walls := result.turbulence) is not None:
        place = place_of_shear_velocity(scene)
        values = {"shear velocity": float(walls.shear_velocities[place])}
    else:
        import ufl

        from .. import compat

        energy = compat.form(ufl.inner(result.velocity, result.velocity) / 2 * ufl.dx)
        comm = result.velocity.function_space.mesh.comm
        values = {"kinetic energy": compat.integral(energy, comm)}
    return _singles(values)


def _of_surface(scene: Scene, result: Result) -> Quantities:
    assert scene.time is not None and result.elevations is not None
    values = result.elevations.at(scene.time.end * np.arange(1, TIMES + 1) / TIMES)
    named = {
        f"elevation_{station + 1}_{time + 1}": float(value)
        for (time, station), value in np.ndenumerate(values)
    }
    return {"elevation": Quantity.of(named)}


def _of_path(scene: Scene, result: Result, history: Sequence[Mapping[str, Any]]) -> Quantities:
    start, path = scene.placement, result.trajectory
    assert start is not None and scene.time is not None and path is not None
    size, axes = scene.grain.size, "xyz"[: scene.gdim]
    places = np.array([start.centre, *([row[axis] for axis in axes] for row in history)])
    length = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum()) or size
    turned = "quaternion" in path and tuple(path["quaternion"])
    end = Placement(point(path["place"]), path.get("angle", 0.0), turned or None)
    # In 2-D about z alone
    turns = zip("zyx", end.turn_since(start)[::-1], strict=False)
    rotation = {f"rotation_{axis}": float(angle) for axis, angle in turns}
    ended = path["ended"]["time"]
    early = ended < scene.time.end * (1.0 - 1e-6)
    return {
        "position": Quantity(dict(zip(axes, end.centre, strict=True)), length),
        # The scale of the error of a smaller rotation is a tenth of the path over the grain's size.
        "rotation": Quantity.of(rotation, 0.1 * length / size),
        **(_singles({"time of contact": ended}) if early else {}),
    }


def _extremes(scene: Scene, history: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Extreme loads, over all times for unsteady inflow or waves, otherwise over the last quarter."""
    assert scene.time is not None
    changing = scene.flow.changes or (scene.has_surface and scene.flow.at_rest)
    begin = 0.0 if changing else 0.75 * scene.time.end
    rows = [row for row in history if row["time"] >= begin]
    times = np.array([row["time"] for row in rows])
    return {
        f"{column}_{name}": end
        for column in rows[0]
        if column.startswith(("force", "torque"))
        for name, end in zip(
            ("least", "most"),
            extremes(times, np.array([row[column] for row in rows])),
            strict=True,
        )
    }


def _of_loads(scene: Scene, numbers: Mapping[str, float]) -> Quantities:
    force, torque = (
        {name: number for name, number in numbers.items() if name.startswith(load)}
        for load in ("force", "torque")
    )
    acting = Quantity.of(force)
    if acting.scale == 0.0:
        return {}
    # The scale of the error of a smaller torque is 1% of force times size.
    least = 0.01 * acting.scale * scene.grain.size
    return {"force": acting, "torque": Quantity.of(torque, least)}


def _singles(values: Mapping[str, float]) -> Quantities:
    """Numbers by quantity, without those that are zero or not finite."""
    return {
        name: Quantity.of({name.replace(" ", "_"): float(value)})
        for name, value in values.items()
        if np.isfinite(value) and value
    }


def extremes(times: Floats, values: Floats) -> tuple[float, float]:
    """Minimum and maximum of the cubic spline through samples."""
    from scipy.interpolate import CubicSpline

    if len(times) > 1:
        spline = CubicSpline(times, values)
        values = np.append(values, spline(spline.derivative().roots(extrapolate=False)))
    return float(np.nanmin(values)), float(np.nanmax(values))


# -- the process -------------------------------------------------------------------------------------


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

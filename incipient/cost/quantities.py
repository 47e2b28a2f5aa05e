"""Quantities compared between the runs of a ladder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Floats
from ..results.errorbars import way
from ..results.loads import named, named_torque
from ..results.result import Result
from ..scene import Scene
from ..thresholds.outcome import Threshold

TIMES = 16  # number of times at which elevations are compared


@dataclass(frozen=True)
class Quantity:
    """Numbers of a result by name; their error is the norm of the differences over a scale."""

    numbers: Mapping[str, float]
    scale: float

    def error(self, numbers: Mapping[str, float]) -> float:
        differences = [numbers[name] - value for name, value in self.numbers.items()]
        return float(np.linalg.norm(differences)) / self.scale


Quantities = dict[str, Quantity]


def of_threshold(threshold: Threshold) -> Quantities:
    """Critical flow of a scene relative to its own."""
    return _singles({"critical flow": threshold.factor})


def of_run(scene: Scene, result: Result, history: Sequence[Mapping[str, Any]]) -> Quantities:
    """Quantities of a finished run, with a `history` row per time step. Collective."""
    if scene.body is None:
        seen = result.elevations is not None and result.elevations.values.size
        return _of_surface(scene, result) if seen else _of_flow(result)
    if result.trajectory is not None:
        return _of_path(scene, result, history)
    if scene.time is not None:
        return _of_loads(scene, _extremes(scene, history))
    assert result.force is not None and result.torque is not None
    force = named("force", result.force.flow, scene.gdim)
    torque = named_torque("torque", result.torque.flow, scene.gdim)
    safety = (result.verdict or {}).get("safety_factor")
    return _of_loads(scene, force | torque) | _singles({"safety factor": safety or np.nan})


def _of_flow(result: Result) -> Quantities:
    if result.centrelines is not None:
        values = {name: extreme.value for name, extreme in result.centrelines.items()}
    elif (walls := result.turbulence) is not None:
        values = {"shear velocity": float(walls.shear_velocities[walls.leading])}
    else:
        values = {"kinetic energy": _kinetic_energy(result.velocity)}
    return _singles(values)


def _of_surface(scene: Scene, result: Result) -> Quantities:
    assert scene.time is not None and result.elevations is not None
    values = result.elevations.at(scene.time.end * np.arange(1, TIMES + 1) / TIMES)
    numbers = {
        f"elevation_{station + 1}_{time + 1}": float(value)
        for (time, station), value in np.ndenumerate(values)
    }
    return {"elevation": Quantity(numbers, _norm(numbers))}


def _of_path(scene: Scene, result: Result, history: Sequence[Mapping[str, Any]]) -> Quantities:
    start, path = scene.placement, result.trajectory
    assert start is not None and scene.time is not None and path is not None
    size, gdim = scene.grain.size, scene.gdim
    axes = "xyz"[:gdim]
    places = np.array([start.centre[:gdim], *([row[axis] for axis in axes] for row in history)])
    length = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum()) or size
    turned = start.quaternion or (start.angle,)
    end = [*path["place"], *(path["quaternion"] if "quaternion" in path else [path["angle"]])]
    turn = way(np.array([*start.centre[:gdim], *turned]), np.array(end))[gdim:]
    rotation = {
        f"rotation_{axis}": float(angle) for axis, angle in zip("zyx", turn[::-1], strict=False)
    }
    # The scale of the error of a smaller rotation is a tenth of the path over the grain's size.
    least, ended = 0.1 * length / size, path["ended"]["time"]
    early = ended < scene.time.end * (1.0 - 1e-6)
    return {
        "position": Quantity(dict(zip(axes, map(float, end), strict=False)), length),
        "rotation": Quantity(rotation, max(_norm(rotation), least)),
        **(_singles({"time of contact": ended}) if early else {}),
    }


def _extremes(scene: Scene, history: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Extreme loads, over all times for unsteady inflow or waves, otherwise over the last quarter."""
    assert scene.time is not None
    changing = scene.flow.changes or (scene.has_surface and scene.flow.at_rest)
    begin = 0.0 if changing else 0.75 * scene.time.end
    rows = [row for row in history if row["time"] >= begin]
    times = np.array([row["time"] for row in rows])
    ends = {
        column: extremes(times, np.array([row[column] for row in rows]))
        for column in rows[0]
        if column.startswith(("force", "torque"))
    }
    names = ("least", "most")
    return {f"{column}_{names[k]}": end[k] for column, end in ends.items() for k in (0, 1)}


def _of_loads(scene: Scene, numbers: Mapping[str, float]) -> Quantities:
    force, torque = (
        {name: number for name, number in numbers.items() if name.startswith(load)}
        for load in ("force", "torque")
    )
    scale = _norm(force)
    # The scale of the error of a smaller torque is 1% of force times size.
    least = 0.01 * scale * scene.grain.size
    quantities = {
        "force": Quantity(force, scale),
        "torque": Quantity(torque, max(_norm(torque), least)),
    }
    return quantities if scale else {}


def _singles(values: Mapping[str, float]) -> Quantities:
    """Numbers by quantity, without those that are zero or not finite."""
    known = {name: value for name, value in values.items() if np.isfinite(value) and value}
    return {
        name: Quantity({name.replace(" ", "_"): float(value)}, abs(float(value)))
        for name, value in known.items()
    }


def _kinetic_energy(velocity: Any) -> float:
    import ufl
    from dolfinx import fem

    from .. import compat

    mesh = velocity.function_space.mesh
    local = fem.assemble_scalar(compat.form(ufl.inner(velocity, velocity) / 2 * ufl.dx))
    return float(mesh.comm.allreduce(float(np.real(local))))


def extremes(times: Floats, values: Floats) -> tuple[float, float]:
    """Minimum and maximum of the cubic spline through samples."""
    from scipy.interpolate import CubicSpline

    if len(times) > 1:
        spline = CubicSpline(times, values)
        values = np.append(values, spline(spline.derivative().roots(extrapolate=False)))
    return float(np.nanmin(values)), float(np.nanmax(values))


def _norm(numbers: Mapping[str, float]) -> float:
    return float(np.linalg.norm([*numbers.values()]))

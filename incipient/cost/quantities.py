"""Quantities compared between the runs of a ladder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ..arrays import Floats
from ..results.result import Result
from ..scene import Scene, Surface
from ..scene.sections import stations_of
from ..thresholds.outcome import Threshold

SMALLEST_TORQUE = 0.01  # of force times grain size: scale of the error of smaller torques
SMALLEST_TURN = 0.1  # of the path over the grain's size: scale of the error of smaller rotations
SETTLED = 0.75  # fraction of the time after which flow with a steady inflow counts as developed
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
    return _single("critical flow", threshold.factor)


def of_run(scene: Scene, result: Result, history: Sequence[Mapping[str, Any]]) -> Quantities:
    """Quantities of a finished run, with a `history` row per time step. Collective."""
    if scene.body is None:
        stations = scene.has_surface and stations_of(scene.surface, scene.domain)
        return _of_surface(scene, history) if stations else _of_flow(result)
    if result.trajectory is not None:
        return _of_path(scene, result.trajectory, history)
    if scene.time is not None:
        return _of_extremes(scene, history)
    assert result.force is not None and result.torque is not None
    force = dict(zip((f"force_{axis}" for axis in "xyz"), result.force.flow, strict=True))
    torque = dict(zip((f"torque_{axis}" for axis in "xyz"), result.torque.flow, strict=True))
    quantities = _of_loads(scene, force, torque)
    safety = (result.verdict or {}).get("safety_factor")
    return quantities | _single("safety factor", safety or np.nan)


def _of_flow(result: Result) -> Quantities:
    if result.centrelines is not None:
        singles = (_single(name, extreme.value) for name, extreme in result.centrelines.items())
        return {name: quantity for single in singles for name, quantity in single.items()}
    if (walls := result.turbulence) is not None:
        return _single("shear velocity", float(walls.shear_velocities[walls.leading]))
    return _single("kinetic energy", _kinetic_energy(result.velocity))


def _of_surface(scene: Scene, history: Sequence[Mapping[str, Any]]) -> Quantities:
    from scipy.interpolate import CubicSpline

    assert scene.time is not None
    surface, numbers = scene.surface or Surface(), dict[str, float]()
    times = np.array([0.0, *(row["time"] for row in history)])
    for k, place in enumerate(stations_of(scene.surface, scene.domain), 1):
        first = surface.height(np.array([[*place, 0.0, 0.0][:3]]).T)
        spline = CubicSpline(times, [float(first[0]), *(row[f"elevation_{k}"] for row in history)])
        for n in range(1, TIMES + 1):
            numbers[f"elevation_{k}_{n}"] = float(spline(scene.time.end * n / TIMES))
    return {"elevation": Quantity(numbers, _norm(numbers))}


def _of_path(
    scene: Scene, trajectory: Mapping[str, Any], history: Sequence[Mapping[str, Any]]
) -> Quantities:
    assert scene.placement is not None and scene.grain is not None and scene.time is not None
    axes, start = "xyz"[: scene.gdim], scene.placement
    places = [start.centre[: scene.gdim], *([row[axis] for axis in axes] for row in history)]
    path = sum(float(np.linalg.norm(np.subtract(*pair))) for pair in pairwise(places))
    path = path or scene.grain.size
    if (angle := trajectory.get("angle")) is not None:
        turn, turned = {"angle": angle}, abs(angle - start.angle)
    else:  # small rotation: twice the vector part of the quaternion
        w, *axis = trajectory["quaternion"]
        turn = {f"rotation_{x}": 2.0 * np.sign(w) * a for x, a in zip("xyz", axis, strict=True)}
        turned = _norm(turn)
    end, size = trajectory["ended"]["time"], scene.grain.size
    quantities = {
        "position": Quantity(dict(zip(axes, map(float, trajectory["place"]), strict=False)), path),
        "rotation": Quantity(turn, max(turned, SMALLEST_TURN * path / size)),
    }
    early = end < scene.time.end * (1.0 - 1e-6)
    return quantities | (_single("time of contact", end) if early else {})


def _of_extremes(scene: Scene, history: Sequence[Mapping[str, Any]]) -> Quantities:
    """Extreme loads, over all times for unsteady inflow or waves, otherwise over the last quarter."""
    assert scene.time is not None
    changing = scene.flow.changes or (scene.has_surface and scene.flow.at_rest)
    begin = 0.0 if changing else SETTLED * scene.time.end
    rows = [row for row in history if row["time"] >= begin]
    times = np.array([row["time"] for row in rows])
    ranges: dict[str, dict[str, float]] = {"force": {}, "torque": {}}
    for part, numbers in ranges.items():
        for column in (name for name in rows[0] if name.startswith(part)):
            low, high = extremes(times, np.array([row[column] for row in rows]))
            numbers |= {f"least_{column}": low, f"most_{column}": high}
    return _of_loads(scene, ranges["force"], ranges["torque"])


def _of_loads(scene: Scene, force: dict[str, float], torque: dict[str, float]) -> Quantities:
    assert scene.grain is not None
    scale = _norm(force)
    if scale == 0.0:
        return {}
    least = SMALLEST_TORQUE * scale * scene.grain.size
    return {
        "force": Quantity(force, scale),
        "torque": Quantity(torque, max(_norm(torque), least)),
    }


def _single(name: str, value: float) -> Quantities:
    known = bool(np.isfinite(value)) and value != 0.0
    return {name: Quantity({name.replace(" ", "_"): value}, abs(value))} if known else {}


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

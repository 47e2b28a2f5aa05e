"""What the accuracy of a run is measured by: numbers of its outcome, and which errors of them matter.

A held grain: force, couple and safety factor, in time the largest and least of force and couple. A moving one:
where it is at the end. Without a grain: the elevations of a free surface at its stations in time, the extreme
velocities on a box's centrelines, u* at the walls of a turbulent flow, else the kinetic energy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..planning.flow_setup import Setup
from ..results.result import Result
from ..scene import Scene, Surface
from ..scene.numerics import OF_WALLS
from ..scene.surface import stations_of

SMALLEST_COUPLE = 0.01  # of force times grain size: below it a couple's error is relative to that
SMALLEST_TURN = 0.1  # the same for a turn, of the path in units of the grain's size
SMALLEST_PART = 1e-3  # of the force: below it a component has no error of its own
SETTLED = 0.75  # of the time after which flow from a steady inflow is taken to be what it tends to
TIMES = 16  # in the time of a run, at which elevations are compared
WALLS = {"outflow_shear_velocity": "u* at the outflow", "mean_shear_velocity": "mean u*"}
LOADS = ("force_x", "force_y", "couple")
LINES = {"u_min": "minimum of v1", "v_max": "maximum of v2", "v_min": "minimum of v2"}
LINES_IN_SPACE = {"u_min": "minimum of v1", "w_max": "maximum of v3", "w_min": "minimum of v3"}


@dataclass(frozen=True)
class ErrorNorm:
    """Numbers whose error is one error: the norm of their differences over a scale.

    leading: whether it counts for the accuracy of the whole; the others are shown beside it
    """

    name: str
    columns: tuple[str, ...]
    scale: float
    leading: bool = True

    def error(self, found: Mapping[str, float], reference: Mapping[str, float]) -> float:
        """The relative error; NaN where a number is missing."""
        differences = [found.get(name, np.nan) - reference[name] for name in self.columns]
        return float(np.linalg.norm(differences)) / self.scale


@dataclass(frozen=True, eq=False)
class ComparedNumbers:
    """The numbers that the runs of a scene are compared by, and which errors of them matter."""

    scene: Scene

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Names of the numbers."""
        scene = self.scene
        if scene.body is None:
            of_walls = (*WALLS,) if scene.is_averaged else ("kinetic_energy",)
            return self._elevations or ((*self._lines,) if scene.has_centrelines else of_walls)
        if scene.body.moves:
            return ("x", "y", "angle", "end_time", "path")
        if scene.time is None:
            return (*LOADS, "safety_factor")
        return tuple(f"{which}_{part}" for part in LOADS for which in ("most", "least"))

    def of_run(self, result: Result, history: Sequence[Mapping[str, Any]]) -> dict[str, float]:
        """The numbers of a finished run, by the names of `columns`; NaN where it has none. Collective."""
        if self.scene.body is None:
            return self._of_surface(history) if self._elevations else self._of_flow(result)
        if result.trajectory is not None:
            return self._of_path(result.trajectory, history)
        if self.scene.time is not None:
            return self._of_extremes(history)
        assert result.force is not None and result.couple is not None
        factor = (result.verdict or {}).get("safety_factor")
        loads = (
            *result.force.flow[:2],
            result.couple.flow[2],
            np.nan if factor is None else factor,
        )
        return {name: float(load) for name, load in zip(self.columns, loads, strict=True)}

    def goals(self, reference: Mapping[str, float]) -> tuple[ErrorNorm, ...]:
        """The errors to look at, relative to what the reference says the sizes are."""
        if self._elevations:
            size = _norm(reference, self.columns)
            return (ErrorNorm("elevation", self.columns, size),) if size else ()
        if self.scene.body is None:
            return tuple(
                self._single(name, abs(reference[name])) for name in self.columns if reference[name]
            )
        return (
            self._goals_of_path(reference)
            if self.scene.body.moves
            else self._goals_of_loads(reference)
        )

    @property
    def _lines(self) -> dict[str, str]:
        return LINES if self.scene.gdim == 2 else LINES_IN_SPACE

    @cached_property
    def _elevations(self) -> tuple[str, ...]:
        """Names of the elevations at the stations, at equal intervals of time; none with a grain or no surface."""
        scene, times = self.scene, range(1, TIMES + 1)
        waves = scene.has_surface and scene.body is None
        stations = stations_of(scene.surface, scene.domain) if waves else ()
        return tuple(f"elevation_{k}_{n}" for k in range(1, len(stations) + 1) for n in times)

    def _of_surface(self, history: Sequence[Mapping[str, Any]]) -> dict[str, float]:
        """The elevations at the stations, between steps by a cubic spline from the first elevation on."""
        from scipy.interpolate import CubicSpline

        scene, values = self.scene, list[float]()
        assert scene.time is not None
        surface = scene.surface or Surface()
        times = np.array([0.0, *(row["time"] for row in history)])
        asked = scene.time.end * np.arange(1, TIMES + 1) / TIMES
        for k, place in enumerate(stations_of(scene.surface, scene.domain), 1):
            first = surface.height(np.array([[*place, 0.0, 0.0][:3]]).T)
            trace = [float(first[0]), *(row[f"elevation_{k}"] for row in history)]
            values += CubicSpline(times, trace)(asked).tolist()
        return dict(zip(self.columns, values, strict=True))

    def _of_flow(self, result: Result) -> dict[str, float]:
        if result.centrelines is not None:
            return {name: result.centrelines[key].value for name, key in self._lines.items()}
        if result.turbulence is not None:
            return dict(zip(WALLS, result.turbulence.shear_velocities.tolist(), strict=True))
        return {"kinetic_energy": _kinetic_energy(result.velocity)}

    def _of_path(
        self, trajectory: Mapping[str, Any], history: Sequence[Mapping[str, Any]]
    ) -> dict[str, float]:
        assert self.scene.placement is not None
        places = np.array(
            [self.scene.placement.centre[:2], *((row["x"], row["y"]) for row in history)]
        )
        (x, y), end = trajectory["place"][:2], trajectory["ended"]["time"]
        path = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
        return {
            "x": float(x),
            "y": float(y),
            "angle": trajectory["angle"],
            "end_time": end,
            "path": path,
        }

    def _of_extremes(self, history: Sequence[Mapping[str, Any]]) -> dict[str, float]:
        """Largest and least loads: of all times if the inflow changes or waves pass, else of the last quarter."""
        scene, found = self.scene, dict[str, float]()
        assert scene.time is not None
        changing = scene.flow.kind == "expression" and scene.flow.unsteady
        changing = changing or (scene.has_surface and scene.flow.kind == "still")
        begin = 0.0 if changing else SETTLED * scene.time.end
        for part in LOADS:
            trace = np.array([(row["time"], row[part]) for row in history if row["time"] >= begin])
            found[f"most_{part}"] = peak(*trace.T)
            found[f"least_{part}"] = -peak(trace[:, 0], -trace[:, 1])
        return found

    def _single(self, name: str, size: float) -> ErrorNorm:
        of_walls = (*WALLS,)[0 if Setup(self.scene).walls.plane else 1]
        words = LINES | LINES_IN_SPACE | WALLS | {of_walls: OF_WALLS}
        said = words.get(name, name.replace("_", " "))
        return ErrorNorm(said, (name,), size, name == of_walls or name not in WALLS)

    def _goals_of_path(self, reference: Mapping[str, float]) -> tuple[ErrorNorm, ...]:
        scene = self.scene
        assert scene.grain is not None and scene.body is not None and scene.time is not None
        path = reference["path"] or scene.grain.size
        turned = abs(reference["angle"] - np.radians(getattr(scene.body, "angle", 0.0)))
        turn = max(turned, SMALLEST_TURN * path / scene.grain.size)
        found = [ErrorNorm("place", ("x", "y"), path), ErrorNorm("angle", ("angle",), turn)]
        if reference["end_time"] < scene.time.end * (1.0 - 1e-6):
            found.append(ErrorNorm("time of contact", ("end_time",), reference["end_time"]))
        return tuple(found)

    def _goals_of_loads(self, reference: Mapping[str, float]) -> tuple[ErrorNorm, ...]:
        assert self.scene.grain is not None
        parts = {
            axis: tuple(name for name in self.columns if name.endswith(axis)) for axis in LOADS
        }
        couples = parts.pop("couple")
        sizes = {axis: _norm(reference, part) for axis, part in parts.items()}
        force = float(np.linalg.norm([*sizes.values()]))
        if force == 0.0:
            return ()
        couple = max(_norm(reference, couples), SMALLEST_COUPLE * force * self.scene.grain.size)
        forces = (*parts["force_x"], *parts["force_y"])
        found = [ErrorNorm("force", forces, force), ErrorNorm("couple", couples, couple)]
        safety = reference.get("safety_factor", np.nan)
        if np.isfinite(safety) and safety > 0.0:
            found.append(ErrorNorm("safety factor", ("safety_factor",), safety))
        for name, axis in (("drag", "force_x"), ("lift", "force_y")):
            if sizes[axis] > SMALLEST_PART * force:
                found.append(ErrorNorm(name, parts[axis], sizes[axis], leading=False))
        return tuple(found)


def _kinetic_energy(velocity: Any) -> float:
    """The integral of |v|^2/2."""
    import ufl
    from dolfinx import fem

    from .. import compat

    mesh = velocity.function_space.mesh
    local = fem.assemble_scalar(compat.form(ufl.inner(velocity, velocity) / 2 * ufl.dx))
    return float(mesh.comm.allreduce(float(np.real(local))))


def peak(times: np.ndarray, values: np.ndarray) -> float:
    """The largest value of a sampled function, between samples by the parabola through three of them."""
    at = int(np.argmax(values))
    if at == 0 or at == len(values) - 1:
        return float(values[at])
    near = slice(at - 1, at + 2)
    t = (times[near] - times[at]) / (times[at + 1] - times[at - 1])
    a, b, c = np.linalg.solve(np.vander(t, 3), values[near])
    return float(c - b**2 / (4.0 * a)) if a < 0.0 else float(values[at])


def _norm(reference: Mapping[str, float], names: tuple[str, ...]) -> float:
    return float(np.linalg.norm([reference[name] for name in names]))

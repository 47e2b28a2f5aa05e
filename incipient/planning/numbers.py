"""The dimensionless numbers of a scene, by which effects are decided."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..scene.expression import expressions
from .base_flow import column, mean_speed, undisturbed

if TYPE_CHECKING:
    from ..geometry.placement import Placement
    from ..scene import Scene

SAMPLES = 33  # of times and of heights at which a given flow is looked at


@dataclass(frozen=True)
class Numbers:
    """A scene's dimensionless numbers; None where the scene has nothing of the kind.

    grain_reynolds: speed of the flow past the grain times its largest diameter over the viscosity
    flow_reynolds:  reference velocity times height of the domain over the viscosity
    bed_reynolds:   speed at the height of the bed's relief above the datum times that height over the viscosity
    reach:          how far the grain's disturbance goes before a wall stops it, in grain sizes
    strouhal:       grain size over speed times the time in which the flow changes
    density_ratio:  density of a free or weighing grain over the fluid's
    stokes:         density ratio times grain Reynolds number / 18: how sluggishly the grain follows the flow
    froude:         reference velocity over sqrt(g height)
    shear_reynolds: shear velocity of a turbulent stream times the grain's largest diameter over the viscosity
    """

    grain_reynolds: float | None
    flow_reynolds: float
    bed_reynolds: float | None
    reach: float
    strouhal: float | None
    density_ratio: float | None
    stokes: float | None
    froude: float | None
    shear_reynolds: float | None = None

    def text(self) -> str:
        """The numbers that the scene has, on one line."""
        named = {
            "grain Re": self.grain_reynolds,
            "flow Re": self.flow_reynolds,
            "bed Re": self.bed_reynolds,
            "Strouhal": self.strouhal,
            "density ratio": self.density_ratio,
            "Stokes": self.stokes,
            "Froude": self.froude,
            "Re*": self.shear_reynolds,
        }
        told = {"grain Re": " (largest speed at its height)"}
        return ", ".join(
            f"{name} {value:.3g}{told.get(name, '')}" for name, value in named.items() if value is not None
        )


def numbers_of(scene: Scene) -> Numbers:
    """The scene's dimensionless numbers. Not collective."""
    grain, viscosity, height = scene.grain, scene.viscosity, scene.domain.height
    reynolds = strouhal = ratio = stokes = froude = of_shear = None
    velocity, period = mean_speed(scene), time_of_change(scene)
    if grain is not None:
        placement = scene.placement
        assert placement is not None
        speed = _speed_past_grain(scene, placement)
        reynolds, ratio = speed * grain.size / viscosity, scene.density
        stokes = None if ratio is None else ratio * reynolds / 18.0
        if scene.flow.kind == "log-law":
            of_shear = scene.reference_velocity * grain.size / viscosity
        strouhal = grain.size / (speed * period) if period is not None and speed > 0.0 else None
    if acceleration := float(abs(scene.gravity_vector).max()):
        froude = velocity / math.sqrt(acceleration * height)
    if scene.flow.kind == "shear":  # whose reference velocity is that over the reference length
        velocity *= height / scene.reference_length
    if scene.flow.kind == "still":
        velocity = 0.0
    flow = velocity * height / viscosity
    reach = wall_distance(scene) + 0.5 if grain is not None else 0.0
    return Numbers(reynolds, flow, _bed_reynolds(scene), reach, strouhal, ratio, stokes, froude, of_shear)


def _heights(scene: Scene) -> np.ndarray:
    return np.linspace(scene.domain.bottom, scene.domain.ceiling, SAMPLES)


def _speed_past_grain(scene: Scene, placement: Placement) -> float:
    """The largest of the speeds of the given flow over the grain's height and of the grain's own."""
    grain = scene.grain
    assert grain is not None
    heights = placement.centre[scene.up] + 0.5 * grain.size * np.linspace(-1.0, 1.0, SAMPLES)
    points = column(scene, placement.centre, heights)
    times = np.linspace(0.0, scene.time.end, SAMPLES) if scene.time else np.zeros(1)
    stream = undisturbed(scene)
    return max(float(max(np.abs(stream(points, t)).max() for t in times)), _own_speed(scene, times))


def _own_speed(scene: Scene, times: np.ndarray) -> float:
    """Estimated speed of the grain itself: prescribed, initial, or settling (Stokes, capped by free fall)."""
    body, grain = scene.body, scene.grain
    if body is None or grain is None or not body.moves:
        return 0.0
    if body.course is not None:
        course = expressions(body.course, "body.course")
        origin = np.zeros((3, 1))
        velocities = np.abs([[float(one(origin, float(t))[0]) for one in course] for t in times])
        turning = 3 if scene.gdim == 3 else 1
        weights = np.concatenate([np.ones(scene.gdim), np.full(turning, 0.5 * grain.size)])
        return float((velocities @ weights).max())
    drive = abs((scene.density or 0.0) - 1.0) * float(abs(scene.gravity_vector).max())
    settling = min(drive * grain.size**2 / (18.0 * scene.viscosity), math.sqrt(drive * grain.size))
    spin = float(np.linalg.norm(body.spin))
    return max(settling, math.hypot(*body.velocity), 0.5 * grain.size * spin)


def _bed_reynolds(scene: Scene) -> float | None:
    """Reynolds number of the bed's forms, by the given flow up to their height above its datum; None for a plane."""
    bed, domain = scene.bed_shape, scene.domain
    if bed is None:
        return None
    heights = bed.height(_along_bed(scene))
    relief = float(heights.max() - heights.min())
    if relief == 0.0:
        return None
    levels = scene.datum + np.linspace(0.0, relief, SAMPLES)
    points = column(scene, domain.entrance, levels)
    return float(np.abs(undisturbed(scene)(points, 0.0)).max()) * relief / scene.viscosity


def _along_bed(scene: Scene) -> np.ndarray:
    """Abscissae (n,) at which the bed is looked at; in space points (n, 2)."""
    domain = scene.domain
    x = np.linspace(domain.left, domain.right, 20 * SAMPLES)
    if scene.gdim == 2:
        return x
    y = np.linspace(*domain.across, 2 * SAMPLES)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def wall_distance(scene: Scene) -> float:
    """From the grain to the next wall above or below, in grain sizes; without one, the height of the domain."""
    grain, placement, domain = scene.grain, scene.placement, scene.domain
    assert grain is not None and placement is not None
    if scene.rests:
        return 0.0
    y, distances = placement.centre[scene.up], [domain.height]
    bounded = domain.kind == "box" or scene.top == "wall" or scene.flow.kind in ("open-channel", "log-law")
    if scene.bed is not None or bounded:
        distances.append(y - scene.datum)
    if scene.top == "wall":
        distances.append(domain.ceiling - y)
    return max(min(distances) / grain.size - 0.5, 0.0)


def time_of_change(scene: Scene) -> float | None:
    """Largest speed of the given flow over its largest rate of change; None where it does not change."""
    time, flow = scene.time, scene.flow
    if time is None or flow.kind != "expression" or not flow.unsteady:
        return None
    times = np.linspace(0.0, time.end, 4 * SAMPLES)
    points = column(scene, scene.domain.entrance, _heights(scene))
    stream = undisturbed(scene)
    speeds = np.array([stream(points, t) for t in times])
    rate = float(np.abs(np.gradient(speeds, times, axis=0)).max())
    return float(np.abs(speeds).max()) / rate if rate > 0.0 else None

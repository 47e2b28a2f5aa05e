"""The mean flow at a grain: velocity, and intensity of its fluctuation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from ..arrays import Floats, spatial
from ..errors import SceneError, refuse_broken
from ..scene.flows import AT_LEAST, MODEL, NEAR_WALL, Gusts
from ..setup.driving_force import DisplacedFluid
from ..setup.setup import Setup

AT_REST = "gusts: the base flow is at rest at the grain; lower flow.datum, or give gusts.intensity"
LARGEST = 3.0  # largest intensity of the laws


@dataclass(frozen=True, eq=False)
class MeanFlow:
    """The base flow at the grain; strengths are over the scene's flow."""

    setup: Setup
    gusts: Gusts

    def shields(self, strength: float) -> float:
        return self._stress(strength) / self.setup.stress_unit

    @cached_property
    def _stress(self) -> Callable[[float], float]:
        return cache(self.setup.bed_stress)

    def intensity(self, strength: float) -> float:
        intensity, flow = self.gusts.intensity, self
        if isinstance(intensity, float):
            return intensity
        if self.setup.scene.is_averaged:
            flow, strength = self._faster(strength), 1.0
        if intensity == NEAR_WALL:
            return flow._near_wall(strength)
        return math.sqrt(2.0 / 3.0 * flow._energy) / flow.speed

    @cached_property
    def _faster(self) -> Callable[[float], MeanFlow]:
        return cache(
            lambda strength: (
                self if strength == 1.0 else replace(self, setup=self.setup.faster(strength))
            )
        )

    def require_intensity(self) -> None:
        scene, depth = self.setup.scene, self.gusts.depth
        size = 0.0 if scene.grain is None else scene.grain.size
        refuse_broken(
            (
                self.gusts.intensity == MODEL and not scene.is_averaged,
                'gusts.intensity: "model" needs a turbulence model; set effects.turbulence = true, or give a number',
            ),
            (
                depth is not None and depth < size,
                f"gusts.depth: is {depth}, less than the grain's size of {size:g}; give the depth of the flow",
            ),
        )
        if self.gusts.law not in AT_LEAST and not (intensity := self.intensity(1.0)) < LARGEST:
            where, speed = "at the grain", self.speed
            if self.gusts.intensity == NEAR_WALL:
                where, speed = "at the grain's top", self._speed_at_top
            raise SceneError(
                f"gusts.intensity: is {intensity:.3g}, of a velocity {where} of {speed:.3g}; "
                f"give a number below {LARGEST:g}"
            )

    def _near_wall(self, strength: float) -> float:
        scene = self.setup.scene
        shear_velocity, size = math.sqrt(self._stress(strength)), scene.grain.size
        below = 0.0 if self.gusts.depth is None else size / self.gusts.depth
        ratio = near_wall(shear_velocity * size / scene.viscosity, below)
        return ratio * shear_velocity / (strength * self._speed_at_top)

    @cached_property
    def _energy(self) -> float:
        logarithms = self.setup.walls.inflow.logarithms
        return float(np.exp(logarithms(self._at_inflow))[0].mean())

    @cached_property
    def speed(self) -> float:
        """The scene's velocity at the grain: mean over its volume above the datum."""
        if self.setup.scene.is_averaged:
            return float(self.setup.walls.inflow.velocity(self._at_inflow)[0].mean())
        return _flowing(self.setup.base_flow.velocity(spatial(self._places).T, 0.0)[0])

    @cached_property
    def _speed_at_top(self) -> float:
        scene, base_flow = self.setup.scene, self.setup.base_flow
        assert scene.placement is not None
        top = np.array([self._places[:, scene.up].max()])
        if self.setup.scene.is_averaged:
            place = base_flow.column(scene.domain.entrance, top)
            return _flowing(self.setup.walls.inflow.velocity(place)[0])
        return _flowing(base_flow.velocity(base_flow.column(scene.placement.centre, top), 0.0)[0])

    @cached_property
    def _places(self) -> Floats:
        scene = self.setup.scene
        assert scene.grain is not None and scene.placement is not None
        return DisplacedFluid(scene.grain, self.setup.base_flow).points(scene.placement)

    @cached_property
    def _at_inflow(self) -> Floats:
        domain, base_flow = self.setup.scene.domain, self.setup.base_flow
        heights = self._places[:, self.setup.scene.up]
        return base_flow.column(domain.entrance, heights[heights > self.setup.walls.datum])


def _flowing(speeds: Floats) -> float:
    flowing = speeds[speeds > 0.0]
    if not len(flowing):
        raise SceneError(AT_REST)
    return float(flowing.mean())


def near_wall(shear_reynolds: float, size_over_depth: float = 0.0) -> float:
    """u'/u* at the top of grains of a bed (Zanke 2003, J. Hydraul. Res. 41, 405), with k+ = u* d/nu and d/h."""
    damped = math.exp(-0.1 * shear_reynolds)
    return 0.31 * shear_reynolds * damped + 1.8 * math.exp(-0.88 * size_over_depth) * (1.0 - damped)

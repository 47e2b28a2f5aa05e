"""The stream at a grain: mean velocity, shear velocity and intensity of fluctuation, by the strength of the flow."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from ..arrays import Floats, spatial
from ..errors import SceneError
from ..planning.driving_force import DisplacedFluid
from ..planning.flow_setup import Setup
from ..scene.fluctuations import GIVEN, MODEL, NEAR_WALL, Gusts

INTEGRAL = (
    0.43  # longitudinal integral scale over k^1.5/epsilon, in the limit of large Reynolds numbers
)
AT_REST = "gusts: the base flow is at rest at the grain; lower flow.datum, or give gusts.intensity"
LARGEST = 3.0  # intensity, beyond which the laws are not those of a stream


@dataclass(frozen=True, eq=False)
class Stream:
    """The base flow of a scene at its grain. Strengths are relative to the flow of the scene; nothing is collective.

    Raises SceneError where an intensity is asked for that the scene does not have.
    """

    setup: Setup
    gusts: Gusts

    def __post_init__(self) -> None:
        if self.setup.is_averaged:
            return
        for name in ("intensity", "microscale", "integral_time"):
            if getattr(self.gusts, name) == MODEL:
                why = '"model" needs a turbulence model; set effects.turbulence = true, or give a number'
                raise SceneError(f"gusts.{name}: {why}")

    def shields(self, strength: float) -> float:
        """Shields number of the mean flow."""
        return self._stresses(strength) / self.setup.stress_unit

    def shear_velocity(self, strength: float) -> float:
        """Shear velocity of the mean flow."""
        return math.sqrt(self._stresses(strength))

    @cached_property
    def _stresses(self) -> Callable[[float], float]:
        """The stress on the bed by strength; a datum that depends on it is computed once for each."""
        return cache(self.setup.bed_stress)

    def intensity(self, strength: float) -> float:
        """Root mean square of the velocity's fluctuation over its mean, at the grain."""
        asked = self.gusts.intensity
        if isinstance(asked, float):
            return asked
        assert asked in (NEAR_WALL, MODEL)
        flow, rest = self._in(strength)
        return flow._near_wall(rest) if asked == NEAR_WALL else flow._of_model

    def _in(self, strength: float) -> tuple[Stream, float]:
        """The stream of a mean flow with a turbulence model, in units of that flow, and what is left of its strength.

        Without a model the velocity keeps its profile: the stream is that of the scene.
        """
        return (self._faster(strength), 1.0) if self.setup.is_averaged else (self, strength)

    @cached_property
    def _faster(self) -> Callable[[float], Stream]:
        return cache(
            lambda strength: (
                self if strength == 1.0 else replace(self, setup=self.setup.faster(strength))
            )
        )

    def require_intensity(self) -> None:
        """Raise SceneError where the intensity in the scene's flow, or the depth, is that of no stream."""
        grain, depth = self.setup.scene.grain, self.gusts.depth
        if grain is not None and depth is not None and depth < grain.size:
            why = f"is {depth:g}, less than the grain's size of {grain.size:g}"
            raise SceneError(f"gusts.depth: {why}; give the depth of the stream")
        if self.gusts.law not in GIVEN and not (found := self.intensity(1.0)) < LARGEST:
            near = self.gusts.intensity == NEAR_WALL
            where, speed = (
                ("at the grain's top", self._speed_at_top) if near else ("at the grain", self.speed)
            )
            why = f"is {found:.3g}, of a velocity {where} of {speed:.3g}"
            raise SceneError(f"gusts.intensity: {why}; give a number below {LARGEST:g}")

    def _near_wall(self, strength: float) -> float:
        scene = self.setup.scene
        assert scene.grain is not None
        shear_velocity, size = self.shear_velocity(strength), scene.grain.size
        below = 0.0 if self.gusts.depth is None else size / self.gusts.depth
        ratio = near_wall(shear_velocity * size / scene.viscosity, below)
        return ratio * shear_velocity / (strength * self._speed_at_top)

    def microscale(self, strength: float) -> float | None:
        """Time of the correlation at short times, 1 - (t/lambda)^2; None: not known.

        By the model it is the longitudinal microscale of isotropic turbulence, lambda^2 = 30 nu u'^2/epsilon, over the
        mean velocity.
        """
        asked = self.gusts.microscale
        if not isinstance(asked, str):
            return asked
        flow, _ = self._in(strength)
        energy, loss = flow._energy_and_loss
        if not loss > 0.0:
            return None
        length = math.sqrt(20.0 * flow.setup.scene.viscosity * energy / loss)
        return length / (flow.speed * strength)

    def integral_time(self, strength: float) -> float | None:
        """Integral of the correlation over time; None: not known.

        By the model it is the longitudinal integral scale 0.43 k^1.5/epsilon (Pope 2000, Turbulent Flows, section 6.5)
        over the mean velocity.
        """
        asked = self.gusts.integral_time
        if not isinstance(asked, str):
            return asked
        flow, _ = self._in(strength)
        energy, loss = flow._energy_and_loss
        if not loss > 0.0:
            return None
        return INTEGRAL * energy**1.5 / loss / (flow.speed * strength)

    @cached_property
    def _of_model(self) -> float:
        """By k of the turbulence that enters, at the heights of the grain: u'^2 = 2k/3."""
        return math.sqrt(2.0 / 3.0 * self._energy_and_loss[0]) / self.speed

    @cached_property
    def _energy_and_loss(self) -> tuple[float, float]:
        """Mean k, and its loss epsilon, of the turbulence that enters at the heights of the grain.

        The loss is no number in a flow that is too slow for the law of the wall.
        """
        _, logarithms = self._entering
        with np.errstate(invalid="ignore"):
            energy, other = np.exp(logarithms(self._at_inflow))
        loss = other if self.setup.has_wall_layer else self.setup.turbulence.c_mu * other * energy
        return float(energy.mean()), float(loss.mean())

    @cached_property
    def speed(self) -> float:
        """The scene's velocity at the grain: the mean over the part of its volume that is above the datum."""
        if self.setup.is_averaged:
            velocity, _ = self._entering
            return float(velocity(self._at_inflow, 0.0)[0].mean())
        speeds = self.setup.base_flow.velocity(spatial(self._places).T, 0.0)[0]
        flowing = speeds[speeds > 0.0]
        if not len(flowing):
            raise SceneError(AT_REST)
        return float(flowing.mean())

    @cached_property
    def _speed_at_top(self) -> float:
        """The scene's velocity at the height of the grain's top."""
        domain, scene = self.setup.scene.domain, self.setup.scene
        assert scene.placement is not None
        top = np.array([self._places[:, domain.up].max()])
        if self.setup.is_averaged:
            velocity, _ = self._entering
            return float(velocity(self.setup.base_flow.column(domain.entrance, top), 0.0)[0, 0])
        at = self.setup.base_flow.column(scene.placement.centre, top)
        if not (speed := float(self.setup.base_flow.velocity(at, 0.0)[0, 0])) > 0.0:
            raise SceneError(AT_REST)
        return speed

    @cached_property
    def _entering(self) -> tuple[Callable[[Floats, float], Floats], Callable[[Floats], Floats]]:
        """Velocity, and logarithms of k and its loss or frequency, that enter with a turbulence model."""
        if self.setup.has_wall_layer:
            from ..planning import wall_conditions

            return wall_conditions.velocity(self.setup), wall_conditions.logarithms(self.setup)
        return self.setup.resolved_walls.velocity, self.setup.resolved_walls.logarithms

    @cached_property
    def _places(self) -> Floats:
        """(n, gdim) points of equal volumes in the grain."""
        scene = self.setup.scene
        assert scene.grain is not None and scene.placement is not None
        return DisplacedFluid(scene.grain, self.setup.base_flow).points(scene.placement)

    @cached_property
    def _at_inflow(self) -> Floats:
        """(3, n) points of the inflow at heights of the grain above the datum."""
        domain = self.setup.scene.domain
        heights = self._places[:, domain.up]
        heights = heights[heights > self.setup.base_flow.datum]
        return self.setup.base_flow.column(domain.entrance, heights)


def near_wall(shear_reynolds: float, size_over_depth: float = 0.0) -> float:
    """u'/u* at the top of grains of a bed (Zanke 2003, J. Hydraul. Res. 41, 405), with k+ = u* d/nu and d/h."""
    damped = math.exp(-0.1 * shear_reynolds)
    return 0.31 * shear_reynolds * damped + 1.8 * math.exp(-0.88 * size_over_depth) * (1.0 - damped)

"""A measured profile that enters a flow whose walls are resolved: speed and k as measured, the model's own at walls."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import root_scalar

from ..arrays import Floats
from ..errors import SceneError
from ..forms.k_omega_sst import BETA_STAR
from .base_flow import BaseFlow
from .developed_channel import DevelopedChannel, developed
from .measured_profile import Measured, Rows
from .resolved_walls import ResolvedWalls, resolved_walls_of
from .scene_geometry import Geometry
from .sides import SideNames
from .wall_law import WallLaw

NEAREST = 1e-9  # of the depth: height that stands for none
BISECTIONS = 60
OF_LAYER, SAMPLES = (
    0.05,
    4000,
)  # thickness of the layer at a wall where a uniform flow enters, over the depth
# Speed over u* to begin with, the next u* over the first, and how well its logarithm is known.
USUAL, CHANGED, FOUND = 15.0, 0.9, 1e-9


@dataclass(frozen=True, eq=False)
class InnerLaw:
    """The model's own law of smooth walls, u+ by y+: that of developed flow. No method is collective."""

    developed: DevelopedChannel
    kappa: float = WallLaw().kappa

    @cached_property
    def _law(self) -> Any:
        return PchipInterpolator(
            self.developed.heights * self.developed.re_tau, self.developed.speed
        )

    def channel(self, shear_velocity: float, viscosity: float) -> DevelopedChannel:
        """The developed flow that has the layer at the wall of a flow with a u*."""
        return self.developed

    def velocity(self, shear_velocity: Any, viscosity: float, height: Any) -> Floats:
        """u+ at heights."""
        return np.asarray(
            self._law(np.minimum(shear_velocity * height / viscosity, self.developed.re_tau))
        )

    def shear_velocity(self, speed: Floats, viscosity: float, height: Floats) -> Floats:
        """u* at which speeds (n,) are those at heights (n,), by bisection."""
        low, high = np.zeros_like(speed), np.sqrt(speed**2 + viscosity * speed / height)
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            fast = middle * self.velocity(middle, viscosity, height) > speed
            low, high = np.where(fast, low, middle), np.where(fast, middle, high)
        return np.asarray(0.5 * (low + high))


@dataclass(frozen=True)
class LawOfSand:
    """The model's own law of rough walls, u+ by y and u*: that of developed flow over the roughness.

    No method is collective. depth: of that flow; sand: equivalent sand roughness [length]
    """

    depth: float
    sand: float
    kappa: float = WallLaw().kappa

    def channel(self, shear_velocity: float, viscosity: float) -> DevelopedChannel:
        """The developed flow with a u*."""
        return developed(float(shear_velocity) * self.depth / viscosity, self.sand / self.depth)

    def velocity(self, shear_velocity: float, viscosity: float, height: Any) -> Floats:
        """u+ at heights."""
        found = self.channel(shear_velocity, viscosity)
        return np.asarray(
            PchipInterpolator(found.heights, found.speed)(np.minimum(height / self.depth, 1.0))
        )

    def shear_velocity(self, speed: Floats, viscosity: float, height: Floats) -> Floats:
        """u* at which speeds (n,) are those at heights (n,)."""
        return np.array([self._at(*one, viscosity) for one in zip(speed, height, strict=True)])

    def _at(self, speed: float, height: float, viscosity: float) -> float:
        def excess(log_u: float) -> float:
            u = math.exp(log_u)
            return math.log(u / speed * float(self.velocity(u, viscosity, height)))

        # The speed at a height goes as u* to a power from one to two: secants in logarithms find it.
        start = math.log(speed / USUAL)
        found = root_scalar(excess, x0=start, x1=start + math.log(CHANGED), xtol=FOUND)
        return math.exp(found.root)


@dataclass(frozen=True, eq=False)
class MeasuredInflow:
    """Inflow from measured rows between resolved walls. No method is collective.

    Between the rows speeds are cubic in the logarithm of the height, k is as measured, or in equilibrium with the
    mixing length, and omega is k^(1/2)/(beta*^(1/4) l), see `measured_profile.Measured`. Between the rows and a wall
    all are those of developed flow at the u* that the next row has by it; k and omega go over to those at the row as
    the square of the distance.

    walls: as they are for developed flow; rows: as measured
    """

    walls: ResolvedWalls
    rows: Measured

    @classmethod
    def of(
        cls, walls: ResolvedWalls, rows: Rows, intensity: float | None, length: float | None
    ) -> MeasuredInflow:
        """Inflow from rows, see `measured_profile.Measured`."""
        whole = walls.number * walls.depth
        sand = walls.upstream or walls.roughness
        between = SimpleNamespace(
            law=LawOfSand(walls.depth, sand) if sand else InnerLaw(walls.developed),
            viscosity=walls.viscosity,
            depth=walls.depth,
            number=walls.number,
            floor=walls.floor,
            ceiling=walls.floor + whole,
            distance=NEAREST * whole,
            mean=walls.mean,
        )
        return cls(walls, Measured.of(between, rows, intensity, length, BETA_STAR))

    @cached_property
    def shear_velocities(self) -> tuple[float, float]:
        """u* at the lower wall and at the one on top."""
        u, law = self.rows.rows[:, 1], self.rows.walls.law
        places = [0, -1][: self.walls.number]
        found = law.shear_velocity(u[places], self.walls.viscosity, self._ends[: self.walls.number])
        return float(found[0]), float(found[-1])

    @property
    def _ends(self) -> Floats:
        """Distances (2,) of the outermost rows from their walls."""
        y = self.rows.rows[:, 0]
        return np.array([y[0], self.walls.number * self.walls.depth - y[-1]])

    def speed(self, above: Floats) -> Floats:
        """Speeds (n,) at heights (n,) above the lower wall."""
        return self.rows.speed(above + self.walls.floor)

    def logarithms(self, above: Floats) -> Floats:
        """ln k and ln omega (2, n) at heights (n,) above the lower wall."""
        heights = above + self.walls.floor
        k, loss = self.rows.energy(heights), self.rows.dissipation(heights)
        found = np.array([np.log(k), np.log(loss / (BETA_STAR * k))])
        whole = self.walls.number * self.walls.depth
        for u, end, away in zip(
            self.shear_velocities, self._ends, (above, whole - above), strict=True
        ):
            if away is not above and self.walls.number == 1:
                break
            near = away < end
            share = (away[near] / end) ** 2
            at_row = self._outer(end if away is above else whole - end)
            inner = self._inner(u, np.append(away[near], end))
            found[:, near] = inner[:, :-1] + share * (at_row - inner[:, -1:])
        return found

    def _outer(self, above: float) -> Floats:
        """ln k and ln omega (2, 1) at a row."""
        height = np.array([above + self.walls.floor])
        k, loss = self.rows.energy(height), self.rows.dissipation(height)
        return np.array([np.log(k), np.log(loss / (BETA_STAR * k))])

    def _inner(self, shear_velocity: float, away: Floats) -> Floats:
        """ln k and ln omega (2, n) of developed flow with a u* at distances (n,) from a wall."""
        developed = self.rows.walls.law.channel(shear_velocity, self.walls.viscosity)
        depth = developed.re_tau * self.walls.viscosity / shear_velocity
        walls = replace(self.walls, shear_velocity=shear_velocity, depth=depth, developed=developed)
        return walls.logarithms_at(np.minimum(away, depth))


def with_profile(
    walls: ResolvedWalls, rows: Rows, intensity: float | None, length: float | None
) -> ResolvedWalls:
    """The walls of a flow that enters as rows say; without rows it is developed."""
    if not rows:
        return walls
    measured = MeasuredInflow.of(walls, rows, intensity, length)
    at_walls = measured.shear_velocities[: walls.number]
    return replace(
        walls, shear_velocity=max(at_walls), bed_shear_velocity=at_walls[0], measured=measured
    )


def resolved_walls_as_asked(
    geometry: Geometry, base_flow: BaseFlow, names: SideNames, asked: Any
) -> ResolvedWalls:
    """The resolved walls of a flow, and the inflow between them by its section. Not collective."""
    upstream = asked.upstream_roughness
    walls = resolved_walls_of(geometry, base_flow, names, asked.roughness, upstream=upstream)
    if why := asked.rows_beyond(walls.number, walls.depth):
        raise SceneError(why)
    if asked.inflow == "given":
        rows = _uniform(walls, 1.0)
        above = (np.arange(SAMPLES) + 0.5) / SAMPLES * walls.number * walls.depth
        uniform = with_profile(walls, rows, asked.intensity, asked.length).measured
        assert uniform is not None
        rows = _uniform(walls, walls.mean / float(uniform.speed(above).mean()))
        found = with_profile(walls, rows, asked.intensity, asked.length)
        return replace(found, bed_shear_velocity=walls.shear_velocity)
    return with_profile(walls, asked.profile, asked.intensity, asked.length)


def _uniform(walls: ResolvedWalls, speed: float) -> Rows:
    """Rows of a uniform flow of a speed over the reference velocity, from where the layers at walls end."""
    # Rows near each other next to the layer: speeds between two of them overshoot by less than 1%.
    near, whole = OF_LAYER * walls.depth * 1.3 ** np.arange(9), walls.number * walls.depth
    far = whole - near[::-1] if walls.number == 2 else [whole]
    return tuple((float(height), speed) for height in (*near, *far))

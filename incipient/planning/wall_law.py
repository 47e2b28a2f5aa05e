"""The law of the wall, smooth or rough, and from which distances to which it holds."""

import math
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

LOWEST, HIGHEST = 30.0, 300.0  # distances from a smooth wall, in nu/u*, between which the law holds
AIMED_AT = 50.0
LARGEST_SHARE = 0.2  # of the depth over which a wall is felt, that the mesh may stand off from it
ROUGH = (
    8.5  # u+ at the height of the roughness on rough walls (Nikuradse 1933, VDI-Forschungsheft 361)
)
# u* k/nu up to which roughness does not matter, and from which on viscosity does not: Nikuradse's measurements,
# as fitted by Cebeci & Bradshaw (1977, Momentum Transfer in Boundary Layers, section 6.4).
SMOOTH_TO, ROUGH_FROM = 2.25, 90.0
SCALE = math.log(ROUGH_FROM / SMOOTH_TO)
CROSSING = 11.06  # distance at which the law of a smooth wall meets the viscous sublayer
LEAST = 1.0  # u+ where the roughness is higher than the wall distance, on the way to a solution
# Newton's corrections of u*, which leave less than 1e-7 of it between smooth and rough walls, else 1e-12.
CORRECTIONS = 4
SAMPLES = 2000  # along a height
ROUND_OFF = 1e-9
NUMPY = SimpleNamespace(log=np.log, larger=np.maximum, sin=np.sin, cos=np.cos)


@dataclass(frozen=True)
class WallLaw:
    """u+ = ln(y+)/kappa + B + w (8.5 - B - ln(k+)/kappa), k+ of the equivalent sand roughness: Nikuradse's.

    w is 0 on smooth walls, 1 on rough ones, and sin(pi/2 ln(k+/2.25)/ln(40)) between. Functions take numbers, arrays,
    or UFL expressions with the functions `log`, `larger`, `sin` and `cos` of UFL.
    """

    roughness: float = 0.0  # equivalent sand roughness k, 0: smooth [length]
    kappa: float = 0.41
    offset: float = 5.2

    def velocity(
        self, shear_velocity: Any, viscosity: Any, distance: Any, functions: Any = NUMPY
    ) -> Any:
        """u+ at a distance from the wall for a shear velocity u*."""
        away = functions.larger(distance * shear_velocity / viscosity, CROSSING)
        by_sand, _ = self._by_sand(shear_velocity, viscosity, functions)
        return functions.larger(functions.log(away) / self.kappa + self.offset + by_sand, LEAST)

    def share(self, shear_velocity: Any, viscosity: Any, functions: Any = NUMPY) -> Any:
        """w: 0 where the wall is hydraulically smooth, 1 where it is fully rough."""
        return functions.sin(0.5 * math.pi * self._between(shear_velocity, viscosity, functions))

    def _between(self, shear_velocity: Any, viscosity: Any, functions: Any) -> Any:
        """Where k+ is between smooth (0) and rough (1), in its logarithm."""
        sand = functions.larger(self.roughness * shear_velocity / viscosity, SMOOTH_TO)
        return -functions.larger(-functions.log(sand / SMOOTH_TO) / SCALE, -1.0)

    def _by_sand(self, shear_velocity: Any, viscosity: Any, functions: Any) -> tuple[Any, Any]:
        """What roughness adds to u+, and the derivative of that by ln u*; from smooth walls on it has a kink."""
        if not self.roughness:
            return 0.0, 0.0
        between = self._between(shear_velocity, viscosity, functions)
        share = functions.sin(0.5 * math.pi * between)
        rise = 0.5 * math.pi / SCALE * functions.cos(0.5 * math.pi * between)
        sand = functions.larger(self.roughness * shear_velocity / viscosity, SMOOTH_TO)
        lost = ROUGH - self.offset - functions.log(sand) / self.kappa
        return share * lost, rise * lost - share / self.kappa

    def shear_velocity(
        self, speed: Any, viscosity: Any, distance: Any, functions: Any = NUMPY
    ) -> Any:
        """u* for a speed at a distance from the wall, by corrections of the law u+ = 8.3 (y+)^(1/7)."""
        found = (speed / 8.3) ** (7 / 8) * (viscosity / distance) ** (1 / 8)
        for _ in range(CORRECTIONS):
            law = self.velocity(found, viscosity, distance, functions)
            slope = 1 / self.kappa + self._by_sand(found, viscosity, functions)[1]  # du+/d ln u*
            found = (speed + slope * found) / (law + slope)
        return found

    def governing(
        self, speed: Any, fluctuations: Any, viscosity: Any, distance: Any, functions: Any = NUMPY
    ) -> Any:
        """The larger of u* for a speed at a distance from a wall and of `fluctuations`, that which k stands for there.

        Where the flow separates the speed vanishes and k does not: Kuzmin, Mierka & Turek (2007).
        """
        return functions.larger(
            self.shear_velocity(speed, viscosity, distance, functions), fluctuations
        )

    def drag(
        self, speed: Any, fluctuations: Any, viscosity: Any, distance: Any, functions: Any = NUMPY
    ) -> Any:
        """Friction over the velocity, u*/u+ of the governing u*, not below that of a viscous sublayer, nu/y."""
        found = self.governing(speed, fluctuations, viscosity, distance, functions)
        return functions.larger(
            found / self.velocity(found, viscosity, distance, functions), viscosity / distance
        )

    def beyond(self, shear_velocity: float, viscosity: float, distance: float) -> float:
        """The flux between the wall and a distance from it, over u*; within the viscous sublayer u+ = y+."""
        y = distance * (np.arange(SAMPLES) + 0.5) / SAMPLES
        within = y * shear_velocity / viscosity
        law = self.velocity(shear_velocity, viscosity, y)
        return float(distance * np.mean(np.where(within < CROSSING, np.minimum(within, law), law)))

    def suitable(self, shear_velocity: float, viscosity: float) -> float:
        """The distance at which a mesh best ends: 50 nu/u*, on walls rougher than that the roughness.

        It is infinite where nothing flows.
        """
        return (
            max(AIMED_AT * viscosity / shear_velocity, self.roughness)
            if shear_velocity
            else math.inf
        )

    def bounds(self, shear_velocity: Any, viscosity: float, reach: float) -> tuple[Any, Any]:
        """Distances from which to which the law holds, arrays like those of u*; `reach` is the depth of the flow.

        From 30 nu/u* to 300 nu/u* at smooth walls; at rough ones from the roughness to a fifth of the depth, since the
        viscous sublayer lies within the roughness there; the upper bound goes from one to the other like w, in
        its logarithm.
        """
        unit = viscosity / np.maximum(shear_velocity, np.finfo(float).tiny)
        lowest = np.maximum(LOWEST * unit, self.roughness)
        if not self.roughness:
            return lowest, HIGHEST * unit
        w = self.share(shear_velocity, viscosity)
        return lowest, (HIGHEST * unit) ** (1.0 - w) * (LARGEST_SHARE * reach) ** w

    def holds(self, shear_velocity: Any, viscosity: float, distance: float, reach: float) -> Any:
        """Whether the law holds at a distance for shear velocities u*, arrays of bool for arrays."""
        lowest, highest = self.bounds(shear_velocity, viscosity, reach)
        return (lowest <= distance * (1.0 + ROUND_OFF)) & (distance <= highest * (1.0 + ROUND_OFF))

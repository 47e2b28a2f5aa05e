"""The law of the wall, smooth or rough."""

import math
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.optimize import brentq

ROUGH = (
    8.5  # u+ at the height of the roughness on rough walls (Nikuradse 1933, VDI-Forschungsheft 361)
)
# u* k/nu up to which roughness does not matter, and from which on viscosity does not: Nikuradse's measurements,
# as fitted by Cebeci & Bradshaw (1977, Momentum Transfer in Boundary Layers, section 6.4).
SMOOTH_TO, ROUGH_FROM = 2.25, 90.0
SCALE = math.log(ROUGH_FROM / SMOOTH_TO)
CROSSING = 11.06  # distance at which the law of a smooth wall meets the viscous sublayer
# Power of the blend of both frictions (Menter, Ferreira, Esch & Konno 2003 have 2): at y+ = 50 it adds 0.9%.
SHARP = 3
LEAST = 1.0  # u+ where the roughness is higher than the wall distance, on the way to a solution
# Newton's corrections of u*, which leave less than 1e-7 of it between smooth and rough walls, else 1e-12.
CORRECTIONS = 4
NUMPY = SimpleNamespace(log=np.log, larger=np.maximum, sin=np.sin, cos=np.cos, sqrt=np.sqrt)


@dataclass(frozen=True)
class WallLaw:
    """u+ = ln(y+)/kappa + B + w (8.5 - B - ln(k+)/kappa), k+ of the equivalent sand roughness: Nikuradse's.

    w is 0 on smooth walls, 1 on rough ones, and sin(pi/2 ln(k+/2.25)/ln(40)) between; u+ = y+ below its
    intersection with the law of a smooth wall. Functions take numbers, arrays, or UFL expressions with
    UFL's functions `log`, `larger`, `sin`, `cos` and `sqrt`.
    """

    roughness: float = 0.0  # k, 0: smooth [length]
    kappa: float = 0.41
    offset: float = 5.2

    def velocity(self, shear_velocity: Any, viscosity: Any, distance: Any) -> Any:
        away = distance * shear_velocity / viscosity
        return np.minimum(away, self._outer(shear_velocity, viscosity, distance, NUMPY))

    def _outer(self, shear_velocity: Any, viscosity: Any, distance: Any, functions: Any) -> Any:
        away = functions.larger(distance * shear_velocity / viscosity, CROSSING)
        by_roughness, _ = self.by_roughness(shear_velocity, viscosity, functions)
        return functions.larger(
            functions.log(away) / self.kappa + self.offset + by_roughness, LEAST
        )

    def by_roughness(self, shear_velocity: Any, viscosity: Any, functions: Any) -> tuple[Any, Any]:
        """Change of u+ by roughness, and its derivative by ln u*, with a kink from smooth walls on."""
        if not self.roughness:
            return 0.0, 0.0
        k_plus = functions.larger(self.roughness * shear_velocity / viscosity, SMOOTH_TO)
        between = -functions.larger(-functions.log(k_plus / SMOOTH_TO) / SCALE, -1.0)
        share = functions.sin(0.5 * math.pi * between)
        rise = 0.5 * math.pi / SCALE * functions.cos(0.5 * math.pi * between)
        lost = ROUGH - self.offset - functions.log(k_plus) / self.kappa
        return share * lost, rise * lost - share / self.kappa

    def shear_velocity(
        self, speed: Any, viscosity: Any, distance: Any, functions: Any = NUMPY
    ) -> Any:
        in_layer = self._in_layer(speed, viscosity, distance, functions)
        return functions.larger(in_layer, functions.sqrt(viscosity * speed / distance))

    def _in_layer(self, speed: Any, viscosity: Any, distance: Any, functions: Any) -> Any:
        """u* of the logarithmic layer, by Newton updates of the law u+ = 8.3 (y+)^(1/7)."""
        u = (speed / 8.3) ** (7 / 8) * (viscosity / distance) ** (1 / 8)
        for _ in range(CORRECTIONS):
            law = self._outer(u, viscosity, distance, functions)
            slope = 1 / self.kappa + self.by_roughness(u, viscosity, functions)[1]  # du+/d ln u*
            u = (speed + slope * u) / (law + slope)
        return u

    def drag(
        self, speed: Any, fluctuations: Any, viscosity: Any, distance: Any, functions: Any = NUMPY
    ) -> Any:
        """Friction over velocity: u*/u+, next to the wall nu/y of the viscous sublayer, blended as by Menter.

        u* is the larger of that for the speed and `fluctuations`, that from k, which does not vanish at separation
        (Kuzmin, Mierka & Turek 2007).
        """
        in_layer = self._in_layer(speed, viscosity, distance, functions)
        u = functions.larger(in_layer, fluctuations)
        outer = self._outer(u, viscosity, distance, functions)
        return ((u / outer) ** SHARP + (viscosity / distance) ** SHARP) ** (1 / SHARP)


def smooth_profile(y: Any) -> tuple[Any, Any]:
    """u+ at distances y+ from a smooth wall, from the viscous sublayer on, and its slope.

    Source: Reichardt (1951, Z. Angew. Math. Mech. 31, 208).
    """
    kappa, inner, outer = WallLaw.kappa, np.exp(-y / 11.0), np.exp(-y / 3.0)
    constant = WallLaw.offset - math.log(kappa) / kappa
    speed = np.log1p(kappa * y) / kappa + constant * (1.0 - inner - y / 11.0 * outer)
    return speed, 1.0 / (1.0 + kappa * y) + constant / 11.0 * (inner - outer + y / 3.0 * outer)


def shift(roughness: float) -> float:
    """Distance [nu/u*] of a smooth wall from a rough one with the same flow, `roughness` being u* k_s/nu.

    There the flow over the smooth wall has the velocity that roughness takes from it.
    """
    lost = -WallLaw(roughness).by_roughness(1.0, 1.0, NUMPY)[0]
    if lost <= 0.0:
        return 0.0
    return float(brentq(lambda y: smooth_profile(y)[0] - lost, 0.0, 1.0 + roughness))

"""The mean velocity of a log-law flow over a bed; `driving_force` has the force that sustains it.

With heights y and velocities in units of nu/u* and u*, the mixing length kappa (y + s) (1 - exp(-(y + s)/26)) gives

    du/dy = 2/(1 + sqrt(1 + 4 kappa^2 (y + s)^2 (1 - exp(-(y + s)/26))^2)),  s = 0.9 (sqrt(k) - k exp(-k/6)),

k being the equivalent sand roughness: u = y within the viscous sublayer of a smooth bed, the logarithmic law above (van
Driest 1956, J. Aeronaut. Sci. 23, 1007; the shift s of rough beds: Cebeci & Chang 1978, AIAA J. 16, 730). For k of 70
to 500 that is within 0.3 of Nikuradse's law, u = ln(y/k)/kappa + 8.5.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

KAPPA, DAMPING = 0.41, 26.0
# k below which a bed is hydraulically smooth, above which it is rough (Nikuradse 1933).
SMOOTH, ROUGH = 5.0, 70.0
LAYER = 10.0  # wall units, between the viscous sublayer and the logarithmic law
NODES = 400


@dataclass(frozen=True)
class MeanProfile:
    """The mean velocity over its datum, in scene units."""

    shear_velocity: float
    viscosity: float
    roughness: float  # equivalent sand roughness [length]
    depth: float  # of the flow above its datum, up to which it is tabulated

    @property
    def roughness_reynolds(self) -> float:
        """k = u* k_s/nu."""
        return self.roughness * self.per_length

    @property
    def per_length(self) -> float:
        return self.shear_velocity / self.viscosity

    @property
    def layer(self) -> float:
        """Height over which the profile bends: ten wall units, or the shift of a rough bed [length]."""
        return max(LAYER, self.shift) / self.per_length

    def regime(self) -> str:
        k = self.roughness_reynolds
        word = "smooth" if k <= SMOOTH else "rough" if k >= ROUGH else "between smooth and rough"
        return f"hydraulically {word}, u* k_s/nu = {k:.3g}"

    def speed(self, heights: np.ndarray) -> np.ndarray:
        """Mean speeds (n,) at heights (n,) above the datum, of zero to the depth."""
        return self.shear_velocity * np.asarray(self._table(heights * self.per_length))

    @cached_property
    def _table(self) -> Any:
        from scipy.interpolate import CubicHermiteSpline

        y = np.sinh(np.linspace(0.0, np.arcsinh(self.depth * self.per_length), NODES))
        points, weights = np.polynomial.legendre.leggauss(8)
        half = 0.5 * np.diff(y)
        within = y[:-1, None] + half[:, None] * (1.0 + points)
        u = np.concatenate([[0.0], np.cumsum(half * (gradient(within, self.shift, np) @ weights))])
        return CubicHermiteSpline(y, u, gradient(y, self.shift, np))

    @property
    def shift(self) -> float:
        k = self.roughness_reynolds
        return max(0.9 * (math.sqrt(k) - k * math.exp(-k / 6.0)), 0.0)


def gradient(y: Any, shift: Any, functions: Any) -> Any:
    """The gradient du/dy at y, in wall units, with the functions of numpy or of UFL."""
    mixing = KAPPA * (y + shift) * (1 - functions.exp(-(y + shift) / DAMPING))
    return 2 / (1 + functions.sqrt(1 + 4 * mixing**2))

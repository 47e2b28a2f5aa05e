"""A uniform stream with its k and omega, and the plate that it meets."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..forms.k_omega_sst import BETA_STAR

# Columns at a leading edge: the finest over the first row, since omega changes as fast there; growth with the
# distance from the edge along the plate and ahead of it; and the largest over the plate's length.
FIRST_COLUMN, COLUMN_GROWTH, GROWTH_AHEAD, LARGEST_COLUMN = 3.0, 0.4, 0.55, 0.06
ROW_GROWTH, LARGEST_ROW = (
    0.28,
    0.1,
)  # of rows with the distance from the plate; of the domain's height


@dataclass(frozen=True)
class FreeStream:
    """A uniform stream: its speed, k and omega."""

    speed: float
    energy: float
    frequency: float

    @classmethod
    def of(cls, speed: float, intensity: float, length: float) -> FreeStream:
        """The stream of an intensity and a mixing length: omega = k^(1/2)/(beta*^(1/4) length)."""
        energy = 1.5 * (intensity * speed) ** 2
        return cls(speed, energy, math.sqrt(energy) / (BETA_STAR**0.25 * length))

    @property
    def logarithms(self) -> tuple[float, float]:
        """ln k and ln omega."""
        return math.log(self.energy), math.log(self.frequency)


def thickness(reynolds: Floats) -> Floats:
    """Thickness (n,) of the boundary layer at the end of a plate over its length, by the plate's Reynolds number (n,).

    The larger by two laws, of which Blasius' is that of slow flow: White (2006), Viscous Fluid Flow, sections 6-6, 4-3.
    """
    return np.maximum(0.16 * reynolds ** (-1.0 / 7.0), 5.0 / np.sqrt(reynolds))

"""Published laws for comparison, with lengths in diameters of the grain and angles in degrees."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats

DRAG = 0.76  # of a sphere on a bed, as Feehan et al. (2023) assume after Schmeeckle et al. (2007)
KARMAN, ROUGH = 0.41, 30.0  # Nikuradse's z0 = median diameter/30 of rough walls
HEIGHTS = 400  # of the quadrature


def kirchner(percentile: ArrayLike, ratio: ArrayLike = 1.0) -> Floats:
    """Percentile of the pivot angle by the grain's diameter over the bed's median, (30 + 0.5 n)(D/K50)^-0.3.

    Kirchner, Dietrich, Iseya & Ikeda (1990), Sedimentology 37, 647, for water-worked mixtures of sand and gravel.
    """
    return np.asarray((30.0 + 0.5 * np.asarray(percentile)) * np.asarray(ratio) ** -0.3)


def with_constant_drag(pivot: float, protrusion: float, ratio: float) -> float:
    """Shields number at which a constant drag coefficient and a rough log law, without lift, move a grain.

    pivot: angle; protrusion: top above the bed's mean level, where the velocity is zero; ratio: diameter over the
    median. Infinite without protrusion, or if no force along the flow moves the grain.
    """
    if not (protrusion > 0.0 and pivot < 90.0):
        return math.inf
    heights = protrusion * (np.arange(HEIGHTS) + 0.5) / HEIGHTS
    width = 2.0 * np.sqrt(np.maximum(0.25 - (heights - protrusion + 0.5) ** 2, 0.0))
    speed = np.log(np.maximum(ROUGH * ratio * heights, 1.0)) / KARMAN
    squared = float((speed**2 * width).sum()) * protrusion / HEIGHTS
    force = math.pi / 6.0 * math.tan(math.radians(pivot))
    return force / (0.5 * DRAG * squared) if squared > 0.0 else math.inf

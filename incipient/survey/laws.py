"""What others would take: measured laws of pivot angles, and a balance of forces with one drag coefficient for all.

Lengths are in diameters of the grain, angles in degrees.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats

DRAG = 0.76  # drag coefficient of a sphere on a bed, as Feehan et al. (2023) assume after Schmeeckle et al. (2007)
KARMAN, ROUGH = (
    0.41,
    30.0,
)  # von Karman's constant; Nikuradse's z0 = median diameter/30 of rough walls
HEIGHTS = 400


def kirchner(percentile: ArrayLike, ratio: ArrayLike = 1.0) -> Floats:
    """Pivot angle that a percentage of grains falls below, by their diameter over the bed's median one.

    (30 + 0.5 n)(D/K50)^-0.3: Kirchner, Dietrich, Iseya & Ikeda (1990), Sedimentology 37, 647, for water-worked mixtures
    of sand and gravel.
    """
    return np.asarray((30.0 + 0.5 * np.asarray(percentile)) * np.asarray(ratio) ** -0.3)


def buffington(coefficients: Sequence[float], ratio: ArrayLike, sorting: float) -> Floats:
    """Pivot angle alpha (D/K50)^-beta sigma^-gamma with (alpha, beta, gamma) of a percentile, sigma the sorting.

    The form of Buffington, Dietrich & Kirchner (1992), Water Resour. Res. 28, 411; take the coefficients from there.
    """
    alpha, beta, gamma = coefficients
    return np.asarray(alpha * np.asarray(ratio) ** -beta * sorting**-gamma)


def on_triangular_pocket(ratio: ArrayLike) -> Floats:
    """Pivot angle of a sphere of D/K over the saddle between two of three equal spheres that touch.

    tan = (1/sqrt 3)/sqrt((D/K)^2 + 2 D/K - 1/3): Kirchner et al. (1990).
    """
    ratio = np.asarray(ratio)
    return np.asarray(
        np.degrees(np.arctan(1.0 / np.sqrt(3.0) / np.sqrt(ratio**2 + 2.0 * ratio - 1.0 / 3.0)))
    )


def with_constant_drag(pivot: float, protrusion: float, ratio: float) -> float:
    """Shields number at which one drag coefficient and a rough log law move a grain about its pivot, without lift.

    protrusion: its top above the bed's mean level, where the velocity is zero; ratio: its diameter over the median one.
    Infinite where it does not protrude or no force along the flow moves it.
    """
    tangent = math.tan(math.radians(pivot)) if pivot < 90.0 else math.inf
    heights = protrusion * (np.arange(HEIGHTS) + 0.5) / HEIGHTS
    width = 2.0 * np.sqrt(np.maximum(0.25 - (heights - protrusion + 0.5) ** 2, 0.0))
    speed = np.log(np.maximum(ROUGH * ratio * heights, 1.0)) / KARMAN
    squared = float((speed**2 * width).sum()) * protrusion / HEIGHTS
    if not (math.isfinite(tangent) and protrusion > 0.0 and squared > 0.0):
        return math.inf
    return math.pi / 6.0 * tangent / (0.5 * DRAG * squared)

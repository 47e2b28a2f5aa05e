"""The level plane that a periodic bed acts as in creeping shear: where the flow far above it seems to come to rest.

Far above such a bed flow of unit shear is u = y - d, and d is the effective level (the crests less the protrusion
height of Luchini, Manzo & Pozzi 1991). The depth of d below the crests was computed once with boundary elements
(Pozrikidis 1992, chapter 3; 512 panels a period); `python benchmarks/effective_level.py` prints both tables. Cubic
interpolation between them errs by less than 5e-5 of the height of the crests.
"""

from functools import cache

import numpy as np

from incipient.errors import SceneError
from incipient.geometry.plane.beds import Bed, HalfDiscs, Sinusoidal

# Depth over the radius, at diameters of 0, 0.05, ..., 1 spacings.
HALF_DISCS = (
    *(1.0, 0.876539, 0.757388, 0.647073, 0.548356, 0.46275, 0.390526, 0.330965, 0.282681),
    *(0.243944, 0.212932, 0.187931, 0.167472, 0.150409, 0.135931, 0.123505, 0.112771, 0.103447),
    *(0.095291, 0.088108, 0.081742),
)
# Depth over the amplitude, at s = 0, 0.05, ..., 1 of amplitudes s / (10 (1 - s)) wavelengths.
SINUSOIDAL = (
    *(1.0, 0.966959, 0.930425, 0.890126, 0.845733, 0.797134, 0.744284, 0.687464, 0.62737),
    *(0.565021, 0.501931, 0.439734, 0.379871, 0.32318, 0.269875, 0.219681, 0.172158, 0.127009),
    *(0.083717, 0.041825, 0.0),
)


def effective_level(bed: Bed) -> float:
    """Height above its base line of the level plane that acts on creeping shear far above as the bed does.

    Raises SceneError for beds that are not in the tables.
    """
    if isinstance(bed, HalfDiscs):
        ratio = min(2.0 * bed.radius / bed.spacing, 1.0)
        return float(bed.radius * (1.0 - _depth(HALF_DISCS, ratio)))
    if isinstance(bed, Sinusoidal):
        steepness = 10.0 * bed.amplitude / bed.wavelength
        return float(bed.amplitude * (1.0 - _depth(SINUSOIDAL, steepness / (1.0 + steepness))))
    raise SceneError(
        f'flow.datum: is "effective" over a {type(bed).__name__} bed, of which there is no table; '
        'use "crest", "mean" or a height'
    )


@cache
def _depth(table: tuple[float, ...], place: float) -> float:
    """The table interpolated at a place between 0 and 1."""
    from scipy.interpolate import CubicSpline  # which takes time to import

    return float(CubicSpline(np.linspace(0.0, 1.0, len(table)), table)(place))

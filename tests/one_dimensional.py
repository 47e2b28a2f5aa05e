"""Models of turbulence in a developed channel by finite volumes in one dimension, in k and epsilon or omega themselves.

Written for the tests, from the equations as they are printed (Launder & Spalding 1974; Menter, Kuntz & Langtry 2003):
nothing of the program is used.
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


def implicit(size, apart, diffusivity, right, loss, flux=0.0, wall=None, held=None):
    """Solve -(D u')' + loss u = right without flux on top.

    From below comes a flux, or there is a `wall` at a distance with a value; u may be `held`: volumes, and values.
    """
    bands, between = np.zeros((3, len(size))), diffusivity[1:-1] / apart
    bands[1], load = loss * size, right * size
    load[0] += flux
    if wall is not None:
        distance, value = wall
        bands[1, 0] += diffusivity[0] / distance
        load[0] += diffusivity[0] / distance * value
    bands[1, :-1] += between
    bands[1, 1:] += between
    bands[0, 1:] = bands[2, :-1] = -between
    if held is not None:
        volumes, values = held
        bands[1, volumes], load[volumes] = 1.0, values[volumes]
        bands[0, 1:][volumes[:-1]] = 0.0
        bands[2, :-1][volumes[1:]] = 0.0
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


def k_omega_channel(re_tau, cells=160, step=0.01, most=20000, sand=0.0):
    """Mean velocity over u* by the k-omega SST model, of a channel of half depth 1 and u* = 1, down to its wall.

    In k and omega themselves, from the equations as Menter, Kuntz & Langtry (2003) print them. Below y+ = 1 omega is
    6 nu/(0.075 y^2) (Wilcox); k vanishes at the wall. With a sand roughness, in wall units, k and omega at the wall are
    those of Aupoix (2015) for Nikuradse's law, and nothing is given above it.
    """
    nu, k_wall, omega_wall = 1.0 / re_tau, 0.0, 0.0
    if sand:
        rise = np.log(sand / 30.0) / np.log(8.0) + 0.5 * (1.0 - np.tanh(sand / 100.0))
        k_wall = max(0.0, np.tanh(rise * np.tanh(sand / 75.0)) / 0.3)
        omega_wall = 4e5 / sand**4 / np.tanh(1e4 / (3.0 * sand**3)) + 70.0 / sand * (
            1.0 - np.exp(-sand / 300.0)
        )
        omega_wall *= re_tau
    faces = np.concatenate([[0.0], np.geomspace((0.02 if sand else 0.2) * nu, 1.0, cells)])
    y, size = 0.5 * (faces[1:] + faces[:-1]), np.diff(faces)
    apart, stress = np.diff(y), 1.0 - y
    k = np.clip(3.3 - 2.3 * y, 0.0, None) * (1.0 - np.exp(-y / nu / 10.0)) ** 3 + 1e-10
    at_wall = 6.0 * nu / (0.075 * y**2)
    omega, given = at_wall + 1.0 / (0.3 * KAPPA * y), y < (0.0 if sand else nu)
    if sand:
        omega, k = np.minimum(omega, omega_wall), np.maximum(k, 0.3 * k_wall)

    for _ in range(most):
        slopes = np.gradient(k, y), np.gradient(omega, y)
        cross = slopes[0] * slopes[1] / omega
        viscous, turbulent = 500.0 * nu / (y**2 * omega), np.sqrt(k) / (0.09 * omega * y)
        third = 4.0 * 0.856 * k / (np.maximum(2.0 * 0.856 * cross, 1e-10) * y**2)
        inner = np.tanh(np.minimum(np.minimum(np.maximum(turbulent, viscous), third), 10.0) ** 4)
        limited = np.tanh(np.minimum(np.maximum(2.0 * turbulent, viscous), 10.0) ** 2)
        strain = np.maximum(stress / (nu + k / omega), (stress - 0.31 * k / limited) / nu)
        eddies = 0.31 * k / np.maximum(0.31 * omega, strain * limited)
        sigma_k, sigma_omega, beta, gamma = (
            inner * a + (1.0 - inner) * b
            for a, b in ((0.85, 1.0), (0.5, 0.856), (0.075, 0.0828), (5 / 9, 0.44))
        )
        made = np.minimum(eddies * strain**2, 10.0 * 0.09 * k * omega)
        spread = [nu + sigma * eddies for sigma in (sigma_k, sigma_omega)]
        on_wall = [nu + sigma * (k_wall / omega_wall if sand else 0.0) for sigma in (0.85, 0.5)]
        at_faces = [
            np.concatenate([[a], 0.5 * (one[1:] + one[:-1]), one[-1:]])
            for a, one in zip(on_wall, spread, strict=True)
        ]
        carried = 2.0 * (1.0 - inner) * 0.856 * cross
        losses = 1 / step + 0.09 * omega
        new_k = implicit(size, apart, at_faces[0], k / step + made, losses, wall=(y[0], k_wall))
        sources = omega / step + gamma * strain**2 + np.maximum(carried, 0.0) + beta * omega**2
        losses = 1 / step + 2.0 * beta * omega + np.maximum(-carried, 0.0) / omega
        walled = {"wall": (y[0], omega_wall), "held": (given, at_wall)}
        new = implicit(size, apart, at_faces[1], sources, losses, **walled)
        change = max(np.abs(new_k / k - 1)[~given].max(), np.abs(new / omega - 1).max())
        k, omega = new_k, new
        if change < 1e-7:
            break
    assert change < 1e-7
    rise = strain * size
    return float(((np.cumsum(rise) - 0.5 * rise) * size).sum())

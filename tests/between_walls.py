"""Drag of a cylinder that moves along two walls, half-way between them, in Stokes flow, by multipoles.

The walls are at y = -1 and 1, the cylinder is of radius a about the origin and moves with velocity 1 along x.
The stream function, odd in y and even in x, is a sum of singular ones at the origin, each with a regular one,
its image, that makes it and its slope vanish on the walls:

    y ln r,    r^-n sin(n t) for n = 1, 3, ...,    y r^-m cos(m t) for m = 2, 4, ...

For y > 0 they are integrals of f(k) exp(-k y) cos(k x), or of y times that, over wave numbers k; the images
are integrals of (A sinh(k y) + B y cosh(k y)) cos(k x).
"""

from __future__ import annotations

from math import factorial

import numpy as np

from incipient.arrays import Floats

HIGHEST = 15  # harmonic that is kept; 21 changes the drag by 1e-12 for a = 1/2
MODES = np.arange(1, HIGHEST + 1, 2)


def _wave_numbers() -> tuple[Floats, Floats]:
    """Gauss rule up to k = 90, where exp(-2 k) is below round-off in spite of the powers."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    ends = np.linspace(0.0, 90.0, 181)
    return (ends[:-1, None] + 0.25 * (nodes + 1.0)).ravel(), np.tile(0.25 * weights, 180)


K, WEIGHTS = _wave_numbers()


def _image(value: Floats, slope: Floats) -> tuple[Floats, Floats]:
    """A and B (wave numbers,) that cancel exp(-k) times a value and a slope by y at the wall."""
    e = np.exp(-2.0 * K)
    sinh, cosh = 0.5 * (1.0 - e), 0.5 * (1.0 + e)  # times exp(-k), as A and B are times exp(k)
    of_y_cosh = cosh + K * sinh
    determinant = sinh * of_y_cosh - K * cosh * cosh
    a = (slope * cosh - value * of_y_cosh) / determinant
    b = (value * K * cosh - slope * sinh) / determinant
    return a * e, b * e


def _harmonics(image: tuple[Floats, Floats], radius: float, uniform: float = 0.0) -> Floats:
    """(2, modes) factors of sin(n t) of an image, and of `uniform` y, at the radius; and slopes by r."""
    a, b = image
    found = np.zeros((2, len(MODES)))
    for i, n in enumerate(int(mode) for mode in MODES):
        sign = (-1) ** i
        of_y_cosh = (1 if n == 1 else 0.5) * K ** (n - 1) * b / factorial(n - 1)
        low = sign * (K**n * a / factorial(n) + of_y_cosh)
        high = sign * 0.5 * K ** (n + 1) * b / factorial(n + 1)
        first = WEIGHTS @ low + (uniform if n == 1 else 0.0)
        second = WEIGHTS @ high
        found[0, i] = first * radius**n + second * radius ** (n + 2)
        found[1, i] = n * first * radius ** (n - 1) + (n + 2) * second * radius ** (n + 1)
    return found


def _stokeslet(radius: float) -> Floats:
    """(2, modes) -y ln r and its image; -y ln r is the integral of y (exp(-k y) cos(k x) - exp(-k))/k."""
    found = _harmonics(_image(1.0 / K, (1.0 - K) / K), radius, WEIGHTS @ (np.exp(-K) / K))
    found[:, 0] += -radius * np.log(radius), -np.log(radius) - 1.0
    return found


def _dipole(n: int, radius: float) -> Floats:
    """(2, modes) (-1)^((n-1)/2) r^-n sin(n t), of f = k^(n-1)/(n-1)!, and its image."""
    f, i = K ** (n - 1) / factorial(n - 1), n // 2
    found = _harmonics(_image(f, -K * f), radius)
    found[:, i] += (-1) ** i * np.array([radius**-n, -n * radius ** (-n - 1)])
    return found


def _stresslet(m: int, radius: float) -> Floats:
    """(2, modes) (-1)^(m/2) y r^-m cos(m t), of f = k^(m-1)/(m-1)! times y, and its image."""
    f, i = K ** (m - 1) / factorial(m - 1), m // 2
    found = _harmonics(_image(f, (1.0 - K) * f), radius)
    half = 0.5 * (-1) ** i * np.array([radius ** (1 - m), (1 - m) * radius**-m])
    found[:, i] += half  # y cos(m t) = r (sin((m + 1) t) - sin((m - 1) t))/2
    found[:, i - 1] -= half
    return found


def drag(k: float) -> float:
    """Drag per length for viscosity and velocity 1, to 1e-9; k is diameter over width, up to 1/2."""
    columns = [_stokeslet(k)]
    columns += [_dipole(int(n), k) for n in MODES] + [_stresslet(int(n) - 1, k) for n in MODES[1:]]
    system = np.array([column.ravel() for column in columns]).T
    wanted = np.zeros((2, len(MODES)))
    wanted[:, 0] = k, 1.0  # the stream function y
    size = np.abs(system).max(axis=0)  # of the columns, powers of k apart
    return float(4.0 * np.pi * np.linalg.solve(system / size, wanted.ravel())[0] / size[0])

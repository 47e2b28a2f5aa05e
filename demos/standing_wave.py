"""A standing wave on a viscous layer, released from rest: frequency and decay beside the exact ones.

Scaling: depth, gravity and the tank's length 1, viscosity 0.01; the bottom and the ends are free of friction.
Cost:    a quarter of a minute on one core.
Run:     mpirun -n 2 python demos/standing_wave.py [KEY=VALUE ...]
Results: results/standing_wave: history.csv, fields.xdmf; `incipient show results/standing_wave --animate`
"""

import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.optimize import least_squares

import incipient


def exact(nu, k, g):
    """s of exp(s t): (s + 2 nu k^2)^2 + w^2 = 4 nu^2 k^3 m coth(m) tanh(k), m^2 = k^2 + s/nu, w^2 = g k tanh(k)."""
    s = 1j * np.sqrt(g * k * np.tanh(k))
    for _ in range(100):
        m = np.sqrt(k**2 + s / nu)
        s = -2 * nu * k**2 + 1j * np.sqrt(
            g * k * np.tanh(k) - 4 * nu**2 * k**3 * m * np.tanh(k) / np.tanh(m)
        )
    return s


scene = incipient.load(
    Path(__file__).parent / "scenes/standing_wave.toml", sys.argv[1:], MPI.COMM_WORLD
)
result = incipient.run(scene, "results/standing_wave")
if MPI.COMM_WORLD.rank == 0:
    s = exact(scene.viscosity, np.pi / scene.domain.length, scene.gravity.acceleration)
    history = np.genfromtxt("results/standing_wave/history.csv", delimiter=",", names=True)
    t, h = history["time"], history["elevation_1"] / abs(history["elevation_1"]).max()
    late = t > np.pi / s.imag  # what else the start has made has died away
    t, h = t[late], h[late]
    found = least_squares(lambda p: np.exp(p[2] * t) * (p[0] * np.cos(p[3] * t) + p[1] * np.sin(p[3] * t)) - h,
                          [1.0, 0.0, s.real, s.imag]).x  # fmt: skip
    print(result.text())
    print(
        f"frequency           {found[3]:.5f}, exact {s.imag:.5f}, error {found[3] / s.imag - 1:.2%}"
    )
    print(
        f"decay               {-found[2]:.5f}, exact {-s.real:.5f}, error {found[2] / s.real - 1:.2%}"
    )

"""Sloshing in a tank at Reynolds numbers 2 to 2000, released from rest: beside the exact linear solution.

Scaling: depth 1, the tank from -1 to 1, gravity 1, first elevation 0.01 cos(pi x); bottom and ends without friction.
Cost:    two to four minutes on one core for each Reynolds number.
Run:     mpirun -n 2 python demos/sloshing.py [RE ...] [KEY=VALUE ...]
Results: results/sloshing_RE: history.csv; the tank is that of Lethe's example "sloshing in a rectangular tank"
"""

import sys
import time
from pathlib import Path

import numpy as np
from mpi4py import MPI

import incipient


def released(times, nu, k=np.pi, g=1.0):
    """h(t)/h(0): (1 - w^2/D(s))/s, D(s) = (s + 2 nu k^2)^2 + w^2 - 4 nu^2 k^3 m coth(m) tanh(k), m^2 = k^2 + s/nu, back
    by the residues of its waves and a contour (Trefethen, Weideman & Schmelzer 2006); if deep, Prosperetti's (1981)."""
    T, m, d, pole = np.tanh(k), lambda s: np.sqrt(k**2 + s / nu + 0j), 1e-6, 1j * np.sqrt(g * k)
    D = lambda s: (s + 2 * nu * k**2) ** 2 + g * k * T - 4 * nu**2 * k**3 * m(s) * T / np.tanh(m(s))  # noqa: E731
    for _ in range(100):
        pole -= D(pole) * 2 * d / (D(pole + d) - D(pole - d))
    residue = -g * k * T / pole * 2 * d / (D(pole + d) - D(pole - d)) if pole.imag > 1e-3 else 0.0
    a = 0.6407 * np.pi * ((np.arange(32) + 0.5) / 16 - 1)
    z = 32 * (0.5017 / 0.6407 * a / np.tan(a) - 0.6122 + 0.2645j / 0.6407 * a)
    slope = 32 * (0.5017 * (1 / np.tan(a) - a / np.sin(a) ** 2) + 0.2645j)
    s = z / times[:, None]
    rest = (
        (1 - g * k * T / D(s)) / s - residue / (s - pole) - np.conj(residue) / (s - np.conj(pole))
    )
    inverted = (np.exp(z) * slope * rest).sum(axis=1) / (32j * times)
    return np.real(2 * residue * np.exp(pole * times) + inverted)


for reynolds in [number for number in sys.argv[1:] if "=" not in number] or [
    "2",
    "20",
    "200",
    "2000",
]:
    changes = [f"fluid.reynolds={reynolds}", *(one for one in sys.argv[1:] if "=" in one)]
    scene = incipient.load(Path(__file__).parent / "scenes/sloshing.toml", changes, MPI.COMM_WORLD)
    began, directory = time.process_time(), f"results/sloshing_{reynolds}"
    incipient.run(scene, directory)
    if MPI.COMM_WORLD.rank == 0:
        history = np.genfromtxt(f"{directory}/history.csv", delimiter=",", names=True)
        error = np.abs(
            history["elevation_1"] / 0.01 - released(history["time"], scene.viscosity)
        ).max()
        print(
            f"Re = {reynolds:<6} error {error:.2%} of the wave, {time.process_time() - began:.0f} s"
        )

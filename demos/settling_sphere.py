"""A sphere settling in a box of silicone oil: its largest velocity beside that of ten Cate et al. (2002), case 1.

Scaling: millimetres and seconds, the fluid's density 1: sphere of 15 mm and 1120 kg/m3, oil of 970 kg/m3, 0.373 Pa s.
Cost:    half a minute on one core; its cells are coarse, numerics.mesh_size=1.4 takes twice as long and changes 0.4%.
Run:     mpirun -n 2 python demos/settling_sphere.py [KEY=VALUE ...]
Results: results/settling_sphere: history.csv, fields.xdmf for ParaView; `incipient show results/settling_sphere`
"""

import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.optimize import brentq

import incipient

SCENE = Path(__file__).parent / "scenes/settling_sphere.toml"
MEASURED = 0.947  # over the velocity in an endless fluid, by particle image velocimetry


def unbounded(scene):
    """Terminal velocity of the sphere in an endless fluid, with the drag of Abraham (1970, Phys. Fluids 13, 2194)."""
    diameter, nu = scene.body.diameter, scene.viscosity
    weight = 4 / 3 * (scene.body.density - 1) * scene.gravity.acceleration * diameter  # C_D V^2
    return brentq(lambda v: 24 / 9.06**2 * (v + 9.06 * (v * nu / diameter) ** 0.5) ** 2 - weight, 1e-9, 1e9)


if __name__ == "__main__":
    scene = incipient.load(SCENE, sys.argv[1:], MPI.COMM_WORLD)
    result = incipient.run(scene, "results/settling_sphere")
    if MPI.COMM_WORLD.rank == 0:
        history = np.genfromtxt("results/settling_sphere/history.csv", delimiter=",", names=True)
        fastest, endless = history[np.argmin(history["velocity_z"])], unbounded(scene)
        peak = -fastest["velocity_z"] / endless
        print(result.text(), f"unbounded          {endless:.3f} mm/s by Abraham's drag", sep="\n")
        print(f"fastest            {peak:.3f} of it, at t = {fastest['time']:.2f} s", end="; ")
        print(f"measured {MEASURED}; difference {peak / MEASURED - 1:+.1%}")
        if fastest["time"] == history["time"][-1]:
            print("it still gains velocity at the end: set time.end later")

"""A sphere settling in a box of silicone oil: its largest velocity beside that of ten Cate et al. (2002), case 1 or 4.

Scaling: millimetres and seconds, the fluid's density 1: sphere of 15 mm and 1120 kg/m3; oil of 970 kg/m3 and 0.373 Pa s
         (case 1, Re 1.5), or of 960 kg/m3 and 0.058 Pa s (case 4, Re 32).
Cost:    case 1 takes 20 s on one core; its cells are coarse, numerics.mesh_size=1.4 changes 0.8%. Case 4: a minute.
Run:     mpirun -n 2 python demos/settling_sphere.py [4] [KEY=VALUE ...]
Results: results/settling_sphere: history.csv, fields.xdmf for ParaView; `incipient show results/settling_sphere`
"""

import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.optimize import brentq

import incipient

SCENES = Path(__file__).parent / "scenes"
# Scene; largest velocity over that in an endless fluid (their Table II), measured by particle image velocimetry, and
# computed by them with lattice-Boltzmann in a box of this size.
CASES = {"1": ("settling_sphere.toml", 0.947, 0.894), "4": ("settling_sphere_4.toml", 0.955, 0.947)}


def unbounded(scene):
    """Terminal velocity of the sphere in an endless fluid, with the drag of Abraham (1970, Phys. Fluids 13, 2194)."""
    diameter, nu = scene.body.diameter, scene.viscosity
    weight = 4 / 3 * (scene.body.density - 1) * scene.gravity.acceleration * diameter  # C_D V^2
    return brentq(
        lambda v: 24 / 9.06**2 * (v + 9.06 * (v * nu / diameter) ** 0.5) ** 2 - weight, 1e-9, 1e9
    )


if __name__ == "__main__":
    name, measured, computed = CASES["4" if "4" in sys.argv[1:] else "1"]
    given = [word for word in sys.argv[1:] if "=" in word]
    scene = incipient.load(SCENES / name, given, MPI.COMM_WORLD)
    result = incipient.run(scene, "results/settling_sphere")
    if MPI.COMM_WORLD.rank == 0:
        history = np.genfromtxt("results/settling_sphere/history.csv", delimiter=",", names=True)
        fastest, endless = history[np.argmin(history["velocity_z"])], unbounded(scene)
        peak = -fastest["velocity_z"] / endless
        print(result.text(), f"unbounded          {endless:.3f} mm/s by Abraham's drag", sep="\n")
        print(
            f"fastest            {peak:.3f} of it, at t = {fastest['time']:.2f} s of {scene.time.end:g}"
        )
        for who, value in (("measured  ", measured), ("computed by them", computed)):
            print(f"{who:<18} {value} by ten Cate et al.; difference {peak / value - 1:+.1%}")

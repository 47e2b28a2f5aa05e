"""A disc settling between walls until it meets the bottom, beside Faxén's drag; or an ellipse, which drifts.

Scaling: the disc's diameter 1, viscosity 10, twice as dense as the fluid; the box is 4 wide.
Cost:    ten seconds on one core.
Run:     mpirun -n 2 python demos/settling.py [disc | ellipse] [KEY=VALUE ...]
Results: results/settling_SHAPE: history.csv, fields.xdmf; `incipient show results/settling_disc --animate`
"""

import sys
from math import log
from pathlib import Path

import numpy as np
from mpi4py import MPI

import incipient
from incipient.scene import Ellipse


def faxen(scene):
    """Terminal velocity of a disc of the grain's area, midway between walls, without inertia (Faxén 1946)."""
    area, acceleration = scene.grain.volume, scene.gravity.acceleration
    weight = (scene.body.density - 1) * area * acceleration
    s = (
        2 * (area / np.pi) ** 0.5 / scene.domain.length
    )  # diameter over width; off by 4e-4 at 1/3, 5% at 1/2
    factor = -log(s) - 0.9157 + 1.7244 * s**2 - 1.7302 * s**4 + 2.4056 * s**6 - 4.5913 * s**8
    return weight * factor / (4 * np.pi * scene.viscosity)


shape, *settings = sys.argv[1:] or ["disc"]
scene = incipient.load(Path(__file__).parent / "scenes/settling.toml", settings, MPI.COMM_WORLD)
if shape == "ellipse":  # of the disc's area, aslant
    keys = scene.body.model_dump(exclude={"shape", "diameter", "angle"})
    scene = scene.model_copy(update={"body": Ellipse(semi_axes=(0.7, 0.3571), angle=30.0, **keys)})
result = incipient.run(scene, f"results/settling_{shape}")
if MPI.COMM_WORLD.rank == 0:
    history = np.genfromtxt(f"results/settling_{shape}/history.csv", delimiter=",", names=True)
    under_way = np.argmax(history["y"] < 0.8 * scene.body.centre[1])
    print(result.text(), f"velocity under way  {-history['velocity_y'][under_way]:.5f}", sep="\n")
    print(f"terminal velocity   {faxen(scene):.5f} of a disc by Faxén's drag")

"""A disc in a pocket of an open channel: its safety factor below a free surface and below a rigid lid in its place.

Scaling: the disc's diameter and the mean velocity 1, depth 3, viscosity 0.01, Froude number 0.5.
Cost:    three minutes on one core, nearly all of it the run in time towards the steady surface.
Run:     mpirun -n 2 python demos/grain_in_channel.py [KEY=VALUE ...]
Results: results/grain_in_channel and results/grain_below_lid; `incipient show results/grain_in_channel`
"""

import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI

import incipient

SCENE = incipient.load(
    Path(__file__).parent / "scenes/grain_in_channel.toml", sys.argv[1:], MPI.COMM_WORLD
)


def told(name, scene):
    """Run a scene, print its loads and verdict, and return where its results are."""
    result = incipient.run(scene, f"results/{name}")
    if MPI.COMM_WORLD.rank == 0:
        force, verdict = result.force.flow, result.verdict
        print(
            f"{name:<18}force ({force[0]:.4f}, {force[1]:.4f})  torque {result.torque.flow[2]:+.4f}  "
            f"safety factor {verdict['safety_factor']:.4f}"
        )
    return Path("results") / name


lid = SCENE.domain.model_copy(update={"top": "slip"})
told("grain_below_lid", SCENE.model_copy(update={"domain": lid, "surface": None, "time": None}))
history = np.genfromtxt(
    told("grain_in_channel", SCENE) / "history.csv", delimiter=",", names=True, dtype=None
)
if MPI.COMM_WORLD.rank == 0:
    places = ", ".join(f"{x[0]:g}" for x in SCENE.surface.places())
    levels = ", ".join(
        f"{history[f'elevation_{n}'][-1]:+.4f}" for n in range(1, len(SCENE.surface.stations) + 1)
    )
    change = np.ptp(history["safety_factor"][history["time"] > 0.9 * history["time"][-1]])
    print(f"elevations at x = {places}: {levels}")
    print(f"safety factor within {change:.4f} over the last tenth of the time")

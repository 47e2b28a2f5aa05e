"""A disc in a pocket below a standing wave: its safety factor in time, and the wave under which it first moves.

Scaling: the disc's diameter 1, depth 4, gravity 10; the disc is 1.3 times as dense as the fluid, viscosity 0.01.
Cost:    two minutes on one core: three waves, of which the last is the critical one, once more without convection.
Run:     mpirun -n 2 python demos/grain_under_waves.py [KEY=VALUE ...]
Results: results/grain_under_waves: history.csv, fields.xdmf; `incipient show results/grain_under_waves --animate`
"""

import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI

import incipient

DIRECTORY = "results/grain_under_waves"
SCENE = incipient.load(
    Path(__file__).parent / "scenes/grain_under_waves.toml", sys.argv[1:], MPI.COMM_WORLD
)
HEIGHT = float(SCENE.surface.height(np.zeros((3, 1)))[0])


def history_below(height, **sections):
    """The history of the disc below a wave of a first elevation at the left end."""
    elevation = f"{height / HEIGHT!r}*({SCENE.surface.elevation})"
    surface = SCENE.surface.model_copy(update={"elevation": elevation})
    incipient.run(SCENE.model_copy(update={"surface": surface, **sections}), DIRECTORY)
    return np.genfromtxt(
        f"{DIRECTORY}/history.csv", delimiter=",", names=True, dtype=None, encoding="utf-8"
    )


def told(of, history):
    """Print the smallest safety factor of a history, and when it is; return it."""
    row = history[np.argmin(history["safety_factor"])]
    if MPI.COMM_WORLD.rank == 0:
        factor, time, end = (float(row[name]) for name in ("safety_factor", "time", "elevation_1"))
        print(f"{of:<34}safety factor {factor:.3f} at t = {time:.2f}, {end:+.3f} at the end")
    return float(row["safety_factor"])


height = HEIGHT
for _ in range(3):  # the load grows nearly in proportion to the wave
    height *= told(f"wave of {height:.3f}", history_below(height))
told(
    "without convection",
    history_below(height, effects=SCENE.effects.model_copy(update={"inertia": False})),
)

"""A light disc that rises below a free surface until it comes to it, where the run stops by name.

Scaling: the disc's diameter 1, half as dense as the fluid, viscosity 0.05, gravity 4; the water is 4 deep.
Cost:    ten seconds on one core.
Run:     mpirun -n 2 python demos/floating_body.py [KEY=VALUE ...]
Results: results/floating_body: history.csv, fields.xdmf; `incipient show results/floating_body --animate`
"""

import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI

import incipient
from incipient.errors import IncipientError

scene = incipient.load(
    Path(__file__).parent / "scenes/floating_body.toml", sys.argv[1:], MPI.COMM_WORLD
)
try:
    incipient.run(scene, "results/floating_body")
except IncipientError as error:
    if MPI.COMM_WORLD.rank == 0:
        print(f"stopped             {error}")
if MPI.COMM_WORLD.rank == 0:
    history = np.genfromtxt("results/floating_body/history.csv", delimiter=",", names=True)
    last, volume = history[-1], np.ptp(history["volume_above_level"])
    print(
        f"grain at            y = {last['y']:.4f} at t = {last['time']:.3f}, rising at {last['velocity_y']:.4f}"
    )
    print(f"surface above it    {last['elevation_1']:+.4f}; volume changed by {volume:.1e}")
    print(
        f"iterations          {history['interface'].mean():.2f} corrections a step, {last['meshes']:.0f} meshes"
    )

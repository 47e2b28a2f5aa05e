"""An ellipse turning in shear, beside Jeffery's orbit in unbounded fluid without inertia.

Scaling: major semi-axis 1, shear rate 1, as dense as the fluid; the channel is 32 high, the Reynolds number 0.01.
Cost:    fifteen seconds on one core.
Run:     mpirun -n 2 python demos/shear_orbit.py [KEY=VALUE ...], such as time.step=0.1
Results: results/shear_orbit: history.csv, fields.xdmf; `incipient show results/shear_orbit --animate`
"""

import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.interpolate import CubicSpline

import incipient

scene = incipient.load(
    Path(__file__).parent / "scenes/shear_orbit.toml", sys.argv[1:], MPI.COMM_WORLD
)
result = incipient.run(scene, "results/shear_orbit")
if MPI.COMM_WORLD.rank == 0:
    history = np.genfromtxt("results/shear_orbit/history.csv", delimiter=",", names=True)
    angle = CubicSpline(history["time"], history["angle"])
    begin, end = (
        angle.solve(-np.pi * k, extrapolate=False)[0] for k in (0.5, 1.5)
    )  # upright, and so again half an orbit later
    r = scene.body.semi_axes[0] / scene.body.semi_axes[1]
    period = 2 * np.pi * (r + 1 / r)  # Jeffery (1922), with tan(turned) = r tan(phase)
    times = np.linspace(begin, end, 200)
    phase = 2 * np.pi * (times - begin) / period
    turned = np.unwrap(np.arctan2(r * np.sin(phase), np.cos(phase)))
    away = np.abs(angle(times) - angle(begin) + turned).max()
    print(
        result.text(),
        f"largest difference  {np.degrees(away):.2f} degrees from Jeffery's orbit",
        sep="\n",
    )
    print(f"period              {2 * (end - begin):.4f}, Jeffery's is {period:.4f}")
    print(f"error of the period {200 * (end - begin) / period - 100:+.2f}%")

"""A sphere that nearly touches a plane, in creeping shear u = G z: force and couple against the exact ones.

Scaling: diameter 1, shear rate G = 1, viscosity mu = 1; the exact numbers are those of Goldman, Cox & Brenner (1967),
         force over 6 pi mu a G h and couple over 4 pi mu a^3 G, a the radius, h the height of the centre.
Cost:    ten seconds a gap on one core.
Run:     mpirun -n 2 python demos/sphere_on_plane.py [--set KEY=VALUE] [GAP ...]
Results: results/sphere_GAP; `incipient show results/sphere_0.01`
"""

import argparse
from math import pi
from pathlib import Path

from mpi4py import MPI

import incipient

SCENE = Path(__file__).parent / "scenes/sphere_on_plane.toml"
# By gaps in diameters: force and couple, from bispherical coordinates in two resolutions.
EXACT = {
    0.05: (1.6325438, 0.95179124),
    0.025: (1.6649234, 0.94805328),
    0.01: (1.685911, 0.94565455),
}
EXACT[0.005] = (1.6931902, 0.94482758)

if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("gaps", nargs="*", type=float, default=[0.05, 0.01])
    parser.add_argument("--set", action="append", default=["numerics.error_bars=false"])
    given = parser.parse_args()
    for gap in given.gaps:
        scene = incipient.load(SCENE, [*given.set, f"contact.gap={gap}"], MPI.COMM_WORLD)
        result = incipient.run(scene, f"results/sphere_{gap:g}")
        a, h = 0.5, 0.5 + gap
        force = result.force.computed[0] / (6 * pi * scene.viscosity * a * h)
        couple = result.torque.computed[1] / (4 * pi * scene.viscosity * a**3)
        if MPI.COMM_WORLD.rank == 0:
            exact = "exact {:.4f}, {:.4f}".format(*EXACT[gap]) if gap in EXACT else ""
            print(f"gap {gap:g}: force {force:.4f}, couple {couple:.4f}; {exact}")
            print(result.text(), flush=True)

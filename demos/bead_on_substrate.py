"""A bead in a pocket of a regular substrate of equal fixed spheres, in shear: what flow begins to move it?

Scaling: spheres of the bed of diameter 1, domain 12 by 12 by 6 beads; creeping flow, or a Reynolds number, shear times
         diameter squared over viscosity, near which gravity then puts the critical flow.
Cost:    a minute or two on one core, most of it for the error bars; with inertia twice that.
Run:     mpirun -n 2 python demos/bead_on_substrate.py [square 1.2 1.0 [REYNOLDS]] [KEY=VALUE ...]
Results: results/bead_ARRANGEMENT_SPACING_SIZE[_REYNOLDS]; many of them: benchmarks/beads.py, docs/validation/beads.md
"""

import sys
from math import sqrt
from pathlib import Path

from mpi4py import MPI

import incipient

SCENE = Path(__file__).parent / "scenes/bead_on_substrate.toml"
# From the middle of a pocket to the nearest centres of the bed, in spacings, squared; angle of the rows.
POCKETS = {"square": (1 / 2, 0.0), "triangular": (1 / 3, 90.0)}


def settings(kind, spacing=1.0, size=1.0, reynolds=0.0):
    """The settings of the scene for a bead behind two spheres of the bed, on one or two more or on the base plane."""
    x, apart, (around, angle) = 6 * size, 0.5 + size / 2, POCKETS[kind]
    height = sqrt(max(apart**2 - around * spacing**2, size**2 / 4))
    ahead = sqrt(
        apart**2 - height**2 - spacing**2 / 4
    )  # to the line through the centres of the two
    bed = [f'arrangement="{kind}"', f"spacing={spacing}", f"angle={angle}"]
    bed += [f"offset=[{x + ahead!r}, {x + spacing / 2!r}]"]
    chosen = [*(f"bed.{one}" for one in bed), f"body.x={x}", f"body.diameter={size}"]
    if reynolds:  # a Shields number of 0.018, as in creeping flow on touching spheres
        gravity = size / (1.65 * 0.018 * reynolds)
        chosen += [
            "fluid.inertia=true",
            f"fluid.reynolds={reynolds}",
            f"gravity.acceleration={gravity}",
        ]
    return [*chosen, f"domain.length={2 * x}", f"domain.width={2 * x}", f"domain.height={x}"]


if __name__ == "__main__":
    kind, *numbers = [word for word in sys.argv[1:] if "=" not in word] or ["square"]
    given = [word for word in sys.argv[1:] if "=" in word]
    scene = incipient.load(SCENE, settings(kind, *map(float, numbers)) + given, MPI.COMM_WORLD)
    found = incipient.threshold(scene, "_".join(["results/bead", kind, *numbers]))
    if MPI.COMM_WORLD.rank == 0:
        print(found.text())

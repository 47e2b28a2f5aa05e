"""A bead in a pocket of a regular substrate of equal fixed spheres, in creeping shear: what flow begins to move it?

Scaling: spheres of the bed of diameter 1, domain 12 by 12 by 6 beads; no viscosity, density or gravity matters.
Cost:    half a minute to a minute a bead on one core, most of it for the error bars.
Run:     mpirun -n 2 python demos/bead_on_substrate.py [square 1.2 1.0] [--set KEY=VALUE]
Results: results/bead_ARRANGEMENT_SPACING_SIZE; `incipient show results/bead_square_1_1`; all together: docs/beads.md
"""

import argparse
from math import sqrt
from pathlib import Path

from mpi4py import MPI

import incipient

SCENE = Path(__file__).parent / "scenes/bead_on_substrate.toml"
# From the middle of a pocket to the nearest centres of the bed, in spacings, squared; angle of the rows.
POCKETS = {"square": (1 / 2, 0.0), "triangular": (1 / 3, 90.0)}
STUDY = [(kind, spacing, 1.0) for kind in POCKETS for spacing in (1.0, 1.1, 1.2, 1.3, 1.4)]
STUDY += [(kind, 1.0, size) for kind in POCKETS for size in (0.5, 0.7, 1.4, 2.0)]


def settings(kind, spacing, size):
    """The settings of the scene for a bead behind two spheres of the bed, on one or two more or on the base plane."""
    x, apart, (around, angle) = 6 * size, 0.5 + size / 2, POCKETS[kind]
    height = sqrt(max(apart**2 - around * spacing**2, size**2 / 4))
    ahead = sqrt(apart**2 - height**2 - spacing**2 / 4)  # to the line through the centres of the two
    bed = [f'arrangement="{kind}"', f"spacing={spacing}", f"angle={angle}"]
    bed += [f"offset=[{x + ahead!r}, {x + spacing / 2!r}]"]
    domain = [f"domain.length={2 * x}", f"domain.width={2 * x}", f"domain.height={x}"]
    return [*(f"bed.{one}" for one in bed), *domain, f"body.diameter={size}", f"body.x={x}"]


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("bead", nargs="*", help="arrangement, spacing, size; by default all of docs/beads.md")
    parser.add_argument("--set", action="append", default=[])
    given = parser.parse_args()
    for case in [(given.bead[0], *map(float, given.bead[1:]))] if given.bead else STUDY:
        scene = incipient.load(SCENE, settings(*case) + given.set, MPI.COMM_WORLD)
        found = incipient.threshold(scene, "results/bead_{}_{:g}_{:g}".format(*case))
        if MPI.COMM_WORLD.rank == 0:
            print("{}, spacing {:g}, size {:g}".format(*case), found.text(), sep="\n", flush=True)

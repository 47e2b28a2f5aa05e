"""A bead in a pocket of a regular substrate of equal fixed spheres, in shear: what flow begins to move it?

Scaling: spheres of the bed of diameter 1, domain 12 by 12 by 6 beads. In creeping flow no viscosity, density or gravity
         matters; with inertia gravity is chosen so that the critical flow is near the Reynolds number asked for.
Cost:    half a minute to a minute a bead on one core, most of it for the error bars; with inertia three times that.
Run:     mpirun -n 2 python demos/bead_on_substrate.py [square 1.2 1.0 [--reynolds 20]] [--set KEY=VALUE]
Results: results/bead_ARRANGEMENT_SPACING_SIZE[_REYNOLDS]; `incipient show results/bead_square_1_1`; all: docs/beads.md
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
STUDY += [("triangular", 1.0, 1.0, reynolds) for reynolds in (2.0, 5.0, 10.0, 20.0, 50.0, 100.0)]
EXPECTED = 0.018  # Shields number that gravity is chosen by, where inertia makes the Reynolds number matter


def settings(kind, spacing, size):
    """The settings of the scene for a bead behind two spheres of the bed, on one or two more or on the base plane."""
    x, apart, (around, angle) = 6 * size, 0.5 + size / 2, POCKETS[kind]
    height = sqrt(max(apart**2 - around * spacing**2, size**2 / 4))
    ahead = sqrt(apart**2 - height**2 - spacing**2 / 4)  # to the line through the centres of the two
    bed = [f'arrangement="{kind}"', f"spacing={spacing}", f"angle={angle}"]
    bed += [f"offset=[{x + ahead!r}, {x + spacing / 2!r}]"]
    domain = [f"domain.length={2 * x}", f"domain.width={2 * x}", f"domain.height={x}"]
    return [*(f"bed.{one}" for one in bed), *domain, f"body.diameter={size}", f"body.x={x}"]


def with_inertia(scene, reynolds):
    """The settings of inertia for a critical flow of about `reynolds`: shear times diameter squared over nu."""
    size, rate = scene.body.diameter, scene.flow.rate
    viscosity = rate * size**2 / reynolds
    gravity = viscosity * rate / ((scene.body.density - 1) * EXPECTED * size)
    scaled = scene.fluid.reynolds * scene.viscosity / viscosity
    return ["fluid.inertia=true", f"fluid.reynolds={scaled}", f"gravity.acceleration={gravity}"]


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("bead", nargs="*", help="arrangement, spacing, size; by default all of docs/beads.md")
    parser.add_argument(
        "--reynolds", nargs="*", type=float, default=[], help="of the shear and the bead; none: creeping flow"
    )
    parser.add_argument("--set", action="append", default=[])
    given = parser.parse_args()
    asked = [(given.bead[0], *map(float, given.bead[1:]))] if given.bead else STUDY
    if given.reynolds:
        asked = [
            (*case[:3], reynolds)
            for case in dict.fromkeys(case[:3] for case in asked)
            for reynolds in given.reynolds
        ]
    for case in asked:
        wanted = settings(*case[:3]) + given.set
        scene = incipient.load(SCENE, wanted, MPI.COMM_WORLD)
        if case[3:]:
            scene = incipient.load(SCENE, wanted + with_inertia(scene, *case[3:]), MPI.COMM_WORLD)
        found = incipient.threshold(
            scene, "results/bead_{}_{}".format(case[0], "_".join(f"{x:g}" for x in case[1:]))
        )
        if MPI.COMM_WORLD.rank == 0:
            print(f"{case[0]}, spacing {case[1]:g}, size {case[2]:g}", found.text(), sep="\n", flush=True)

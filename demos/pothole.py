"""The pebble in a pothole, the paper's Fig. 1: a die bead released at rest in the middle of a driven cavity.

Scaling: small semi-axis of the bead 1, side of the cavity 40, lid's speed 40, Reynolds number on the side 1.
Cost:    five seconds a case on one core, with steps of 0.2 and cells twice as wide as in the scene files.
Run:     mpirun -n 2 python demos/pothole.py [1 2 3 4] [--reading neutral] [--shape disc] [--set KEY=VALUE]
Results: results/pothole_CASE; `incipient show results/pothole_1`; readings and error bars: docs/explanation/moving.md
"""

import argparse
from pathlib import Path

from mpi4py import MPI

import incipient
from incipient.scene import Disc, Ellipse, Rectangle

READINGS = {
    "printed": [],
    "neutral": [],
    "grain": ["flow.velocity=1.0"],
    "rest": ['time.start="rest"'],
}
SHAPES = {
    "ellipse": Ellipse(semi_axes=(2, 1), x=0),
    "disc": Disc(diameter=8**0.5, x=0),
}  # all of area 2 pi
SHAPES["square"] = Rectangle(width=2.5508, height=2.5508, corner_radius=0.51016, x=0)


def scene(case, reading="printed", shape="ellipse", settings=()):
    """A case of the figure; "neutral": the bead is as dense as the fluid, its radius of gyration the same."""
    path = Path(__file__).parent / f"scenes/pothole_{case}.toml"
    made = incipient.load(path, [*READINGS[reading], *settings], MPI.COMM_WORLD)
    share = SHAPES[shape].grain.volume / made.body.mass if reading == "neutral" else 1.0
    keys = {"x": None, "mass": share * made.body.mass, "inertia": share * made.body.inertia}
    keys |= made.body.model_dump(include={"centre", "motion"})
    return made.model_copy(update={"body": SHAPES[shape].model_copy(update=keys)})


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("cases", nargs="*", type=int, default=[1, 2, 3, 4])
    parser.add_argument("--reading", choices=READINGS, default="printed")
    parser.add_argument("--shape", choices=SHAPES, default="ellipse")
    parser.add_argument(
        "--set", action="append", default=["time.step=0.2", "numerics.mesh_size=2.0"]
    )
    given = parser.parse_args()
    for case in given.cases:
        made = scene(case, given.reading, given.shape, given.set)
        result = incipient.run(made, f"results/pothole_{case}")
        if MPI.COMM_WORLD.rank == 0:
            print(result.title, result.text(), sep="\n")

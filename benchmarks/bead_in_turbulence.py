"""A bead in its pocket in a turbulent stream by k-omega SST: its drag, and the speed at which it leaves.

The bead of Wu & Shih (2012, J. Geophys. Res. 117, F03006): 8 mm, density 2500 kg/m^3, on a bed of equal spheres that
touch, in water. Its velocity is that of the stream which enters at the height of its centre.

Cost:    two to five minutes of one core for each row
Run:     python benchmarks/bead_in_turbulence.py [1300:2.2 1300:2.2:1 2600:1.5 2600:2.2:1 2600:1.6:1 3437:2.2:1],
         Reynolds numbers by mean speed and diameter with mesh sizes, and the sand roughness of the bed upstream [d] if
         it is rough
Results: benchmarks/bead_in_turbulence.json, a row for each, of docs/validation/beads.md
"""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
from tables import ROOT, read_json, write_json

import incipient
from incipient.setup.setup import Setup

STORE = ROOT / "benchmarks/bead_in_turbulence.json"
DIAMETER, VISCOSITY, DENSITY, GRAVITY = (
    0.008,
    1e-6,
    2.5,
    9.81,
)  # of the bead and of water [m, m^2/s, -, m/s^2]
SCENE = """
[domain]
length = 9.0
width = 5.0
height = 5.866
[fluid]
reynolds = {reynolds}
scale = "grain"
[flow]
kind = "open-channel"
[body]
shape = "sphere"
diameter = 1.0
x = 4.0
density = {density}
[bed]
kind = "spheres"
radius = 0.5
spacing = 1.0
arrangement = "triangular"
angle = 90.0
offset = [4.288675134594813, 3.0]
[gravity]
acceleration = {gravity}
[effects]
turbulence = true
[turbulence]
model = "k-omega-sst"
upstream_roughness = {upstream}
[contact]
friction = 0.5
gap = {gap}
[numerics]
mesh_size = {size}
order = 2
error_bars = false
"""


def computed(
    reynolds: float, size: float, upstream: float = 0.0, gap: float = 0.05
) -> dict[str, Any]:
    """Loads on the bead and its verdict in a stream of a Reynolds number by mean speed and diameter.

    upstream: equivalent sand roughness of the bed upstream [d]
    """
    speed = reynolds * VISCOSITY / DIAMETER  # mean speed [m/s]
    gravity = GRAVITY * DIAMETER / speed**2
    of_row = {"reynolds": reynolds, "size": size, "upstream": upstream, "gap": gap}
    scene = incipient.scene.loads(SCENE.format(density=DENSITY, gravity=gravity, **of_row))
    result = incipient.run(scene)
    setup = Setup(scene)
    walls = setup.walls
    centre = scene.placement.centre[2] - walls.datum
    at_centre = float(walls.inflow.velocity_at(np.array([centre]))[0, 0])
    force = result.force.flow
    pressure = 0.5 * at_centre**2 * math.pi / 4.0
    factor = float(result.verdict["safety_factor"])
    return {
        "reynolds": reynolds,
        "mesh_size": size,
        "upstream": upstream,
        "gap": gap,
        "shear_reynolds": walls.shear_velocity * reynolds,
        "centre": centre,
        "at_centre": at_centre * speed,
        "drag": force[0] / pressure,
        "lift": force[2] / pressure,
        "safety_factor": factor,
        "leaves_at": at_centre * speed * math.sqrt(factor),
        "shields": factor * walls.shear_velocity**2 / ((DENSITY - 1.0) * gravity),
        "converged": bool(result.turbulence.converged),
        "spread": result.turbulence.spread,
    }


def main() -> None:
    """Compute the rows asked for, and store them."""
    known = read_json(STORE, [])
    rows = {(row["upstream"], row["reynolds"], -row["mesh_size"]): row for row in known}
    for word in sys.argv[1:]:
        reynolds, size, upstream = (*map(float, word.split(":")), 0.0)[:3]
        rows[upstream, reynolds, -size] = computed(reynolds, size, upstream)
        write_json(STORE, [rows[key] for key in sorted(rows)])
    for key in sorted(rows):
        print(*(f"{name} {value:.4g}" for name, value in rows[key].items()), sep=", ")


if __name__ == "__main__":
    main()

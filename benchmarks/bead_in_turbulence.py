"""A bead in its pocket in a turbulent stream by k-omega SST: its drag, and the speed at which it leaves.

The bead of Wu & Shih (2012, J. Geophys. Res. 117, F03006): 8 mm, density 2500 kg/m^3, on a bed of equal spheres that
touch, in water. Its velocity is that of the stream which enters at the height of its centre. Schmeeckle, Nelson &
Shreve (2007, J. Geophys. Res. 112, F02003) measured the drag on a sphere near a gravel bed.

Cost:    two to five minutes of one core for each row
Run:     python benchmarks/bead_in_turbulence.py [1300:2.2 1300:2.2:1 2600:1.5 2600:2.2:1 2600:1.6:1 3437:2.2:1],
         Reynolds numbers by mean speed and diameter with mesh sizes, and the sand roughness of the bed upstream [d] if
         it is rough
Results: benchmarks/bead_in_turbulence.json, a row for each; the table "turbulent"; quartiles of the measured drag
"""

from __future__ import annotations

import csv
import json
import math
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from tables import publish

import incipient
from incipient.planning.flow_setup import Setup

ROOT = Path(__file__).parents[1]
STORE = ROOT / "benchmarks/bead_in_turbulence.json"
DRAG = ROOT / "benchmarks/reference/sphere_near_bed_drag.csv"
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
    given = {"reynolds": reynolds, "size": size, "upstream": upstream, "gap": gap}
    scene = incipient.scene.loads(SCENE.format(density=DENSITY, gravity=gravity, **given))
    result = incipient.run(scene)
    setup = Setup(scene)
    walls = setup.walls
    centre = scene.placement.centre[2] - walls.ground
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


def bins() -> list[tuple[float, float, float, float]]:
    """Mean speed [m/s], quartiles and median of the measured drag coefficients in bins of the velocity."""
    lines = [line for line in DRAG.read_text().splitlines() if not line.startswith("#")]
    rows = [(float(row["u"]) / 100.0, float(row["drag"])) for row in csv.DictReader(lines)]
    speeds, drags = np.array(rows).T
    edges = np.quantile(speeds, np.linspace(0.0, 1.0, 6))
    found = []
    for low, high in pairwise(edges):
        chosen = (speeds >= low) & (speeds <= high)
        found.append(
            (
                float(speeds[chosen].mean()),
                *map(float, np.quantile(drags[chosen], (0.25, 0.5, 0.75))),
            )
        )
    return found


def balanced(drag: float = 0.76, lift: float = 0.85 * 0.76, protrusion: float = 0.86) -> float:
    """Speed [m/s] at which a balance of forces with assumed coefficients lets the bead go (benchmarks/shields.py)."""
    angle = math.acos(1.0 - 2.0 * protrusion)
    exposed, whole = 0.25 * (angle - math.sin(angle) * math.cos(angle)), 0.25 * math.pi
    friction = (1.0 / math.sqrt(3.0)) / math.sqrt(
        8.0 / 3.0
    )  # of the pivot between two equal spheres
    weight = math.pi / 3.0 * GRAVITY * DIAMETER * (DENSITY - 1.0) * friction
    return math.sqrt(weight / (drag * exposed + friction * lift * whole))


def table(rows: list[dict[str, Any]]) -> str:
    """The rows of the page."""
    head = (
        "u* d/ν",
        "mesh_size",
        "bed upstream",
        "speed at the centre",
        "C_D",
        "C_L",
        "S",
        "leaves at",
        "Shields number of the mean stream",
        "loads still change by",
    )
    lines = [f"| {' | '.join(head)} |", "|" + " --- |" * len(head)]
    for row in rows:
        cells = (
            f"{row['shear_reynolds']:.0f}",
            f"{row['mesh_size']:g}",
            f"rough, k_s = {row['upstream']:g} d" if row["upstream"] else "smooth",
            f"{row['at_centre']:.3f} m/s",
            *(f"{row[name]:.3f}" for name in ("drag", "lift")),
            f"{row['safety_factor']:.3f}",
            f"{row['leaves_at']:.3f} m/s",
            f"{row['shields']:.4f}",
            f"{100 * row['spread']:.2g}%",
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Compute the rows asked for, and write the page's table."""
    known = json.loads(STORE.read_text()) if STORE.exists() else []
    rows = {(row["upstream"], row["reynolds"], -row["mesh_size"]): row for row in known}
    for word in sys.argv[1:]:
        reynolds, size, upstream = (*map(float, word.split(":")), 0.0)[:3]
        rows[upstream, reynolds, -size] = computed(reynolds, size, upstream)
        STORE.write_text(json.dumps([rows[key] for key in sorted(rows)], indent=1) + "\n")
    publish("turbulent", table([rows[key] for key in sorted(rows)]))
    print(f"balance of forces: {balanced():.3f} m/s")
    print(
        *(
            f"{speed:.3f} m/s: {low:.2f}, {middle:.2f}, {high:.2f}"
            for speed, low, middle, high in bins()
        ),
        sep="\n",
    )


if __name__ == "__main__":
    main()

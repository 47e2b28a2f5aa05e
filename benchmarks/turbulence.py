"""Developed turbulent channels: against finite volumes in one dimension, and against direct simulations.

Cost:    about a minute.
Run:     python benchmarks/turbulence.py
Results: docs/figures/turbulence.png, the table "channels"
"""

import csv
import sys
from pathlib import Path
from typing import Any

import numpy as np
from tables import publish

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))

FIGURE = ROOT / "docs/figures/turbulence.png"
PROFILES = ROOT / "tests/reference/channel_dns.csv"
# U_b+ and C_f by direct simulation, at Re_tau (Hoyas & Jimenez 2006; Lee & Moser 2015).
DIRECT = {546.74: (18.401, 0.00591), 1000.5: (19.990, 0.005005)}
FIRST_PLACES = (30.5, 60.0, 100.0)
LENGTH, MESH_SIZE = 80.0, 1.0
COLOURS = ("#2166ac", "#b2182b")

Run = dict[str, Any]


def measured(re_tau: float, y_plus: float) -> Run:
    """One channel at the bulk Reynolds number that the direct simulation has."""
    from one_dimensional import developed_channel

    import incipient
    from incipient.mesh.sampling import sample
    from incipient.scene import Domain, Effects, Fluid, Numerics, OpenChannel, Scene, Turbulence

    mean, friction = DIRECT[re_tau]
    scene = Scene(
        domain=Domain(length=LENGTH, height=1.0),
        fluid=Fluid(reynolds=mean * re_tau, scale="flow"),
        flow=OpenChannel(),
        effects=Effects(turbulence=True),
        turbulence=Turbulence(wall_distance=y_plus / re_tau),
        numerics=Numerics(mesh_size=MESH_SIZE, order=2),
    )
    result = incipient.run(scene)
    walls = result.turbulence
    assert walls is not None
    found, over_shear = walls.at_outflow / scene.viscosity, 1.0 / walls.at_outflow
    heights = np.geomspace(1.0001 * walls.distance, 0.9999, 60)
    places = np.column_stack([np.full(60, 0.99 * LENGTH), heights])
    return {
        "re_tau": re_tau,
        "asked": y_plus,
        "found": found,
        "over_shear": over_shear,
        "by_volumes": developed_channel(found, found * walls.distance),
        "direct": mean,
        "friction": walls.friction,
        "direct_friction": friction,
        "profile": (heights * found, sample(result.velocity, places)[:, 0] * over_shear),
    }


def table(runs: list[Run]) -> str:
    """The table of the page."""
    lines = [
        "| Re_tau prescribed / computed | y+ | U_b+ | from finite volumes | from simulation | C_f | from simulation |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for run in runs:
        apart = [
            f"{100 * (run[mine] / run[name] - 1):+.2f}%"
            for name, mine in (
                ("by_volumes", "over_shear"),
                ("direct", "over_shear"),
                ("direct_friction", "friction"),
            )
        ]
        lines.append(
            f"| {run['re_tau']:g} / {run['found']:.1f} | {run['asked']:g} | {run['over_shear']:.3f} | {apart[0]} | "
            f"{apart[1]} | {run['friction']:.6f} | {apart[2]} |"
        )
    return "\n".join(lines)


def draw(runs: list[Run]) -> None:
    """Profiles of the mean velocity beside those of direct simulations."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    with PROFILES.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    figure, axes = plt.subplots(figsize=(7, 4.2), layout="constrained")
    for re_tau, colour in zip(DIRECT, COLOURS, strict=True):
        points = [row for row in rows if abs(float(row["re_tau"]) - re_tau) < 1.0]
        y, u = (np.array([float(row[name]) for row in points]) for name in ("y_plus", "U_plus"))
        axes.plot(y, u, "o", color=colour, markersize=4, label=f"direct simulation, {re_tau:g}")
        for run in runs:
            if run["re_tau"] == re_tau:
                label = f"k-epsilon, {re_tau:g}" if run["asked"] == FIRST_PLACES[0] else None
                axes.plot(*run["profile"], color=colour, linewidth=1.2, label=label)
    axes.set(xscale="log", xlabel="y u*/nu", ylabel="U/u*", xlim=(1, 1100))
    axes.legend(frameon=False)
    figure.savefig(FIGURE, dpi=130)


def main() -> None:
    """Run, draw, write."""
    runs = [measured(re_tau, y_plus) for re_tau in DIRECT for y_plus in FIRST_PLACES]
    draw(runs)
    publish("channels", table(runs))


if __name__ == "__main__":
    main()

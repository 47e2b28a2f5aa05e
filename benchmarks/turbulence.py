"""Developed turbulent channels: against finite volumes in one dimension, and against direct simulations.

Cost:    about a minute.
Run:     python benchmarks/turbulence.py
Results: docs/figures/turbulence.png, the table "channels"
"""

import sys
from typing import Any

import numpy as np
from pictures import FIGURES, drawn, plain
from tables import ROOT, publish, read_rows, table

sys.path.insert(0, str(ROOT / "tests"))

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
    computed, over_shear = walls.at_outflow / scene.viscosity, 1.0 / walls.at_outflow
    heights = np.geomspace(1.0001 * walls.distance, 0.9999, 60)
    places = np.column_stack([np.full(60, 0.99 * LENGTH), heights])
    return {
        "re_tau": re_tau,
        "y_plus": y_plus,
        "computed": computed,
        "over_shear": over_shear,
        "by_volumes": developed_channel(computed, computed * walls.distance),
        "direct": mean,
        "friction": walls.friction,
        "direct_friction": friction,
        "profile": (heights * computed, sample(result.velocity, places)[:, 0] * over_shear),
    }


HEADS: tuple[str, ...] = (
    "Re_tau prescribed / computed",
    "y+",
    "U_b+",
    "from finite volumes",
    "from simulation",
)
HEADS += ("C_f", "from simulation")


def cells(run: Run) -> list[str]:
    """A row of the table."""

    def apart(value: str, reference: str) -> str:
        return f"{100 * (run[value] / run[reference] - 1):+.2f}%"

    return [
        f"{run['re_tau']:g} / {run['computed']:.1f}",
        f"{run['y_plus']:g}",
        f"{run['over_shear']:.3f}",
        apart("over_shear", "by_volumes"),
        apart("over_shear", "direct"),
        f"{run['friction']:.6f}",
        apart("friction", "direct_friction"),
    ]


def draw(runs: list[Run]) -> None:
    """Profiles of the mean velocity beside those of direct simulations."""
    simulated = read_rows(PROFILES)
    with drawn(FIGURES / "turbulence.png", (7, 4.2)) as (_, panels):
        axes = panels[0, 0]
        for re_tau, colour in zip(DIRECT, COLOURS, strict=True):
            points = [row for row in simulated if abs(row["re_tau"] - re_tau) < 1.0]
            y, u = ([row[name] for row in points] for name in ("y_plus", "U_plus"))
            axes.plot(y, u, "o", color=colour, ms=4, label=f"direct simulation, {re_tau:g}")
            for run in runs:
                if run["re_tau"] == re_tau:
                    label = f"k-epsilon, {re_tau:g}" if run["y_plus"] == FIRST_PLACES[0] else None
                    axes.plot(*run["profile"], color=colour, linewidth=1.2, label=label)
        axes.set(xscale="log", xlabel="y u*/nu", ylabel="U/u*", xlim=(1, 1100))
        plain(panels)
        axes.legend()


def main() -> None:
    """Run, draw, write."""
    runs = [measured(re_tau, y_plus) for re_tau in DIRECT for y_plus in FIRST_PLACES]
    draw(runs)
    publish("channels", table(HEADS, map(cells, runs)))


if __name__ == "__main__":
    main()

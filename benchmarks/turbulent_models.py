"""A stone on a level bed by both models of turbulence: what its loads cost, on meshes of several sizes.

The stone is that of benchmarks/turbulent_stone.py on a level bed, in a flow slow enough for k-omega SST, which reaches
the walls, and fast enough for the law of the wall of k-epsilon.

Cost:    three minutes.
Run:     python benchmarks/turbulent_models.py
Results: the table "models"
"""

from __future__ import annotations

import time
from dataclasses import dataclass

from tables import publish
from turbulent_step import extrapolated
from turbulent_stone import DIAMETER, scene

import incipient
from incipient import scene as of
from incipient.errors import ConvergenceError

REYNOLDS = 45_000.0
MODELS = {"k-epsilon": "k-epsilon", "k-omega-sst": "k-omega SST"}
# Each 1.41 times as fine as the one before; k-epsilon, which the law of the wall starts, is far from its limit on 1.
MESH_SIZES = {
    "k-epsilon": (2.0, 2.0**0.5, 1.0, 2.0**-0.5, 0.5, 0.5**1.5),
    "k-omega-sst": (2.0, 2.0**0.5, 1.0),
}


@dataclass(frozen=True)
class Found:
    """Drag and lift coefficients by a model on one mesh, unknowns, rounds or steps of pseudo-time, processor time."""

    model: str
    mesh_size: float
    unknowns: int
    drag: float
    lift: float
    rounds: int
    seconds: float


def computed(model: str, mesh_size: float) -> Found | None:
    """The steady loads on one mesh; None: no steady flow was found."""
    asked = scene(mesh_size, bed=of.Flat(), turbulence=of.Turbulence(model=model))
    slower = of.Fluid(reynolds=REYNOLDS, scale="flow")
    began = time.process_time()
    try:
        result = incipient.run(asked.model_copy(update={"fluid": slower}))
    except ConvergenceError:
        return None
    seconds = time.process_time() - began
    assert result.force is not None
    drag, lift = result.force.flow[:2] / (0.5 * DIAMETER)
    unknowns = result.cost["unknowns"] + result.cost["effects"]["turbulence"]["unknowns"]
    rounds = result.cost["iterations"]["turbulence"]
    return Found(model, mesh_size, unknowns, float(drag), float(lift), rounds, seconds)


def table(found: list[Found]) -> str:
    """The table of the page."""
    lines = [
        "| model | `mesh_size` | unknowns | drag | lift | rounds or steps | processor time |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for model, words in MODELS.items():
        mine = [one for one in found if one.model == model]
        lines += [
            f"| {words} | {one.mesh_size:.3g} | {one.unknowns} | {one.drag:.3f} | {one.lift:.3f} | {one.rounds} | "
            f"{one.seconds:.2g} s |"
            for one in mine
        ]
        if len(mine) == len(MESH_SIZES[model]):
            limits = [
                extrapolated([getattr(one, name) for one in mine[-3:]]) for name in ("drag", "lift")
            ]
            told = " | ".join(f"{limit:.3f} ± {wide:.3f}" for limit, wide in limits)
            lines.append(f"| {words}, extrapolated | | | {told} | | |")
    return "\n".join(lines)


def main() -> None:
    """Run, write."""
    computed("k-epsilon", 4.0)  # what is compiled and imported once is no part of the times
    found = []
    for model in MODELS:
        for mesh_size in MESH_SIZES[model]:
            if (one := computed(model, mesh_size)) is not None:
                found.append(one)
            print(model, mesh_size, one, flush=True)
    publish("models", table(found))


if __name__ == "__main__":
    main()

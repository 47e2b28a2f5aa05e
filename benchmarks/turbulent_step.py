"""A backward-facing step in turbulent flow: where it reattaches, on three meshes, beside OpenFOAM and measurements.

By k-epsilon with wall functions, and by k-omega SST to the wall, without OpenFOAM.

Cost:    five to seven minutes; without OpenFOAM (Debian's package `openfoam`) its rows are left out.
Run:     python benchmarks/turbulent_step.py
Results: the tables "step" and "step to the wall"
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tables import publish

ROOT = Path(__file__).parents[1]
SCENE = ROOT / "demos/scenes/backward_facing_step.toml"
MEASURED = 6.26  # +- 0.10, Driver & Seegmiller (1985), AIAA J. 23, 163
FINER = 2.0**0.5
MESH_SIZES = (2.0, 2.0 / FINER, 1.0)
WALL_CELLS = (0.08, 0.08 / FINER, 0.04)  # OpenFOAM's cells at the step
ROWS = 400


@dataclass(frozen=True)
class Found:
    """What one program has found on one mesh; y+ next to the floor and ahead of the step."""

    program: str
    cells: int
    unknowns: int
    reattachment: float
    y_plus: tuple[float, float]
    iterations: int
    seconds: float


def by_incipient(mesh_size: float) -> Found:
    """The scene with its cells times a factor."""
    import incipient
    from incipient.scene.file import load

    scene = load(SCENE)
    scene = scene.model_copy(
        update={"numerics": scene.numerics.model_copy(update={"mesh_size": mesh_size})}
    )
    began = time.process_time()
    result = incipient.run(scene)
    seconds, walls = time.process_time() - began, result.turbulence
    assert walls is not None and result.velocity is not None
    mesh = result.velocity.function_space.mesh
    counted = result.cost["effects"]
    unknowns = counted["turbulence"]["unknowns"] + result.cost["unknowns"]
    rounds = result.cost["iterations"]["turbulence"]
    _, end = max(walls.backward, key=lambda span: span[1] - span[0])
    cells = mesh.topology.index_map(2).size_global
    return Found("incipient", cells, unknowns, end, (walls.least, walls.largest), rounds, seconds)


def to_the_wall(mesh_size: float) -> Found:
    """The scene by the k-omega SST model, whose mesh reaches the walls."""
    import incipient
    from incipient.scene.file import load

    scene = load(SCENE)
    assert scene.turbulence is not None
    sections = {
        "turbulence": scene.turbulence.model_copy(
            update={"model": "k-omega-sst", "wall_distance": None}
        ),
        "numerics": scene.numerics.model_copy(update={"mesh_size": mesh_size, "error_bars": False}),
    }
    began = time.process_time()
    result = incipient.run(scene.model_copy(update=sections))
    seconds, walls = time.process_time() - began, result.turbulence
    assert walls is not None and result.velocity is not None
    unknowns = result.cost["effects"]["turbulence"]["unknowns"] + result.cost["unknowns"]
    _, end = max(walls.backward, key=lambda span: span[1] - span[0])
    cells = result.velocity.function_space.mesh.topology.index_map(2).size_global
    rounds = result.cost["iterations"]["turbulence"]
    return Found("k-omega SST", cells, unknowns, end, (walls.least, walls.largest), rounds, seconds)


def table_to_the_wall(found: list[Found]) -> str:
    """The table of the k-omega SST model: every mesh."""
    lines = [
        "| `mesh_size` | cells | reattaches at | largest y+ | processor time |",
        "| --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| {size:.3g} | {one.cells} | {one.reattachment:.3f} | {one.y_plus[1]:.1f} | {one.seconds:.0f} s |"
        for size, one in zip(MESH_SIZES, found, strict=True)
    ]
    return "\n".join(lines)


def by_openfoam(size: float) -> Found:
    """The same inflow, viscosity and walls."""
    from programs import openfoam_step

    with tempfile.TemporaryDirectory() as directory:
        found = openfoam_step.solve(Path(directory), _inflow(), size)
    unknowns = 5 * found.cells
    return Found(
        *(
            "OpenFOAM",
            found.cells,
            unknowns,
            found.reattachment,
            found.y_plus,
            found.iterations,
            found.seconds,
        )
    )


def _inflow() -> Any:
    """What enters the scene, by heights above the upper floor."""
    from programs import openfoam_step

    from incipient.planning.flow_setup import Setup
    from incipient.scene.file import load

    setup = Setup(load(SCENE))
    walls = setup.walls
    heights = walls.ground + (walls.ceiling - walls.ground) * 0.5 * (
        1.0 - np.cos(np.pi * np.linspace(0.0, 1.0, ROWS))
    )
    x = np.zeros((3, ROWS))
    x[walls.up] = heights
    parts = (walls.inflow.velocity(x, 0.0)[0], *np.exp(walls.inflow.logarithms(x)))
    return openfoam_step.Inflow(np.column_stack([heights - walls.ground, *parts]), walls.viscosity)


def extrapolated(values: list[float]) -> tuple[float, float]:
    """The limit of three meshes, each finer by the same factor, and how far the finest one is from it.

    Where the differences do not fall the limit is not known: it is the last value, give or take both differences.
    """
    first, second = np.diff(values)
    ratio = first / second if second else np.inf
    if ratio <= 1.0:
        return values[-1], float(np.ptp(values))
    return values[-1] + second / (ratio - 1.0), abs(second / (ratio - 1.0))


def table(found: list[Found]) -> str:
    """The table of the page: the coarsest and the finest mesh, and what all tell."""
    lines = [
        "| program | unknowns | reattaches at | of the measured 6.26 | time |",
        "| --- | --- | --- | --- | --- |",
    ]
    for program in dict.fromkeys(one.program for one in found):
        mine = [one for one in found if one.program == program]
        lines += [
            f"| {program} | {one.unknowns} | {one.reattachment:.3f} | {_short(one.reattachment)} | "
            f"{one.seconds:.1f} s |"
            for one in mine[::2]
        ]
        limit, away = extrapolated([one.reattachment for one in mine])
        lines.append(
            f"| {program}, extrapolated | | {limit:.2f} +- {away:.2f} | {_short(limit)} | |"
        )
    return "\n".join(lines)


def _short(place: float) -> str:
    return f"{100 * (place / MEASURED - 1):+.1f}%"


def main() -> None:
    """Run, write."""
    from programs import openfoam_step

    walls = []
    for mesh_size in MESH_SIZES:
        walls.append(to_the_wall(mesh_size))
        print(walls[-1], flush=True)
    publish("step to the wall", table_to_the_wall(walls))
    there, found = openfoam_step.is_installed(), []
    for mesh_size, size in zip(MESH_SIZES, WALL_CELLS, strict=True):
        found.append(by_incipient(mesh_size))
        print(found[-1], flush=True)
        if there:
            found.append(by_openfoam(size))
            print(found[-1], flush=True)
    if not there:
        sys.exit("OpenFOAM is not installed: the table stays as it is")
    publish("step", table(found))


if __name__ == "__main__":
    main()

"""A backward-facing step and a stone in turbulent flow: three meshes, their limit, and OpenFOAM.

OpenFOAM's rows, benchmarks/reference/openfoam_*.md, are those of simpleFoam, version 1912, with the same constants,
inflow and walls; its walls lie as far beyond the outlines as those that the law of the wall of incipient stands for.

Cost:    ten minutes.
Run:     python benchmarks/turbulent_meshes.py
Results: the tables "step" and "stone"; printed, limits of a stone on a level bed by both models
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from tables import publish

import incipient
from incipient.results.result import Result

ROOT = Path(__file__).parents[1]
MESH_SIZES = (2.0, 2.0**0.5, 1.0)
# k-epsilon, which begins with the law of the wall, is far from its limit on larger cells of a stone on a level bed.
ON_LEVEL_BED = {"k-epsilon": (2.0**-0.5, 0.5, 0.5**1.5), "k-omega-sst": MESH_SIZES}
MEASURED = 6.26  # +- 0.10, Driver & Seegmiller (1985), AIAA J. 23, 163
DIAMETER, BEHIND = (
    0.2,
    (5.0, 6.0),
)  # of the stone; where u* of the bed is averaged: four of its waves
STEP = "| program | unknowns | reattaches at | of the measured 6.26 | time |"
STONE = "| program | cells | drag | lift | u* behind the stone |"


def runs(
    path: Path, sizes: tuple[float, ...] = MESH_SIZES, *settings: str
) -> list[tuple[Result, float]]:
    """Results of a scene on three meshes, and their processor times [s]."""
    computed = []
    for size in sizes:
        began = time.process_time()
        result = incipient.run(incipient.load(path, [f"numerics.mesh_size={size}", *settings]))
        computed.append((result, time.process_time() - began))
    return computed


def extrapolated(values: list[float]) -> tuple[float, float]:
    """The limit of three meshes, each finer by the same factor, and how far the finest one is from it.

    Where the differences do not fall the limit is not known: it is the last value, give or take both differences.
    """
    first, second = np.diff(values)
    ratio = first / second if second else np.inf
    if ratio <= 1.0:
        return values[-1], float(np.ptp(values))
    return values[-1] + second / (ratio - 1.0), abs(second / (ratio - 1.0))


def step_rows() -> list[str]:
    """Rows of the coarsest and the finest mesh, and of the limit."""

    def short(place: float) -> str:
        return f"{100 * (place / MEASURED - 1):+.1f}%"

    lines, places = [], []
    for result, seconds in runs(ROOT / "demos/scenes/backward_facing_step.toml"):
        _, end = max(result.turbulence.backward, key=lambda span: span[1] - span[0])
        unknowns = result.cost["effects"]["turbulence"]["unknowns"] + result.cost["unknowns"]
        lines.append(f"| incipient | {unknowns} | {end:.3f} | {short(end)} | {seconds:.1f} s |")
        places.append(end)
    limit, away = extrapolated(places)
    told = f"| incipient, extrapolated | | {limit:.2f} +- {away:.2f} | {short(limit)} | |"
    return [*lines[::2], told]


def stone_rows() -> list[str]:
    """Rows of the coarsest and the finest mesh, and of the limits."""
    lines, numbers = [], []
    for result, _ in runs(ROOT / "benchmarks/scenes/stone_on_waves.toml"):
        drag, lift = result.force.flow[:2] / (0.5 * DIAMETER)
        bed = result.turbulence.along["bed"]
        speeds = np.sqrt(0.5 * np.abs(bed["friction"]))
        behind = float(np.interp(np.linspace(*BEHIND, 2001), bed["x"], speeds).mean())
        cells = result.velocity.function_space.mesh.topology.index_map(2).size_global
        lines.append(f"| incipient | {cells} | {drag:.3f} | {lift:.3f} | {behind:.4f} |")
        numbers.append((float(drag), float(lift), behind))
    limits = [extrapolated([*values]) for values in zip(*numbers, strict=True)]
    told = " | ".join(f"{limit:.4f} +- {away:.4f}" for limit, away in limits)
    return [*lines[::2], f"| incipient, extrapolated | | {told} |"]


def print_limits_of_models() -> None:
    """Limits of drag and lift of a stone on a level bed by both models."""
    path = ROOT / "benchmarks/scenes/stone_on_level_bed.toml"
    for model, sizes in ON_LEVEL_BED.items():
        loads = [one.force.flow[:2] for one, _ in runs(path, sizes, f'turbulence.model="{model}"')]
        drag, lift = (extrapolated([*values]) for values in np.array(loads).T / (0.5 * DIAMETER))
        print(f"{model}: drag {drag[0]:.3f} +- {drag[1]:.3f}, lift {lift[0]:.3f} +- {lift[1]:.3f}")


def table(name: str, heads: str, rows: Callable[[], list[str]]) -> None:
    """Compute and publish a table with OpenFOAM's rows."""
    rule = "| --- | --- | --- | --- | --- |"
    others = (ROOT / f"benchmarks/reference/openfoam_{name}.md").read_text().strip()
    publish(name, "\n".join([heads, rule, *rows(), others]))


if __name__ == "__main__":
    table("step", STEP, step_rows)
    table("stone", STONE, stone_rows)
    print_limits_of_models()

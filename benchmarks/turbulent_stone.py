"""A stone on the wavy bed of a turbulent open channel, that of demos/large_grain.py: its load beside OpenFOAM's.

The same model, what enters, and walls: OpenFOAM's lie as far beyond the outline of bed and stone as those that
incipient's law of the wall stands for, and the centres of its cells next to them lie on that outline. What no flow
reaches of the stone has the pressure at the lines that close the space at its contacts, in both.

Cost:    five minutes; without OpenFOAM (Debian's package `openfoam`) the table stays as it is.
Run:     python benchmarks/turbulent_stone.py
Results: the table "stone"
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
from turbulent_step import extrapolated

ROOT = Path(__file__).parents[1]
NU, DIAMETER = 5e-6, 0.2
FINER = 2.0**0.5
MESH_SIZES = (2.0, 2.0 / FINER, 1.0)
CELLS = (0.0132, 0.0132 / FINER, 0.0066)  # OpenFOAM's along the stone
BED_CELLS, BED_GROWTH = (
    1.5,
    0.05,
)  # over those: the largest along the bed; their growth with the distance from the stone
GAP = 0.08  # where the space at contacts is closed: wider than OpenFOAM's cells at walls
ROWS = 400
CONVECTION = {
    "linear upwind": "linearUpwind grad(U)",
    "upwind": "upwind",
}  # of the velocity, in OpenFOAM
BEHIND = (5.0, 6.0)  # from where to where u* of the bed is averaged: four of its waves


@dataclass(frozen=True)
class Found:
    """What one program has found on one mesh: coefficients of drag and lift, u* of the bed, y+, and what it took."""

    program: str
    cells: int
    drag: float
    lift: float
    shear_velocity: float
    y_plus: tuple[float, float]
    iterations: int
    seconds: float


def scene(mesh_size: float, **changed: Any) -> Any:
    """The stone of the demo, with other sections, as `bed` or `turbulence`."""
    from incipient import scene as of

    bed = changed.pop("bed", of.Sinusoidal(amplitude=0.02, wavelength=0.25))

    return of.Scene(
        domain=of.Domain(length=6.0, height=1.0),
        body=of.Disc(diameter=DIAMETER, x=2.9375, density=2.65),
        bed=bed,
        gravity=of.Gravity(acceleration=10.0),
        contact=of.Contact(friction=0.6, gap=GAP),
        fluid=of.Fluid(reynolds=1 / NU, scale="flow"),
        flow=of.OpenChannel(),
        effects=of.Effects(turbulence=True),
        numerics=of.Numerics(mesh_size=mesh_size, order=2, error_bars=False),
        **changed,
    )


def by_incipient(mesh_size: float, **changed: Any) -> Found:
    """The scene with its cells times a factor."""
    import incipient

    began = time.process_time()
    result = incipient.run(scene(mesh_size, **changed))
    seconds, walls = time.process_time() - began, result.turbulence
    assert walls is not None and result.velocity is not None and result.force is not None
    drag, lift = result.force.flow[:2] / (0.5 * DIAMETER)
    bed = walls.along["bed"]
    x, friction = np.array(bed["x"]), np.array(bed["friction"])
    cells = result.velocity.function_space.mesh.topology.index_map(2).size_global
    return Found(
        *("incipient", cells, float(drag), float(lift), behind(x, np.sqrt(0.5 * np.abs(friction)))),
        (walls.least, walls.largest),
        result.cost["iterations"]["turbulence"],
        seconds,
    )


def by_openfoam(size: float, name: str = "upwind", **changed: Any) -> Found:
    """The inflow, viscosity, outline and walls of the scene, with a convection scheme of `CONVECTION`."""
    from programs import openfoam_stone

    from incipient.coupled.tractions import load_of
    from incipient.setup.setup import Setup

    asked = scene(1.0, **changed)
    walls, closing = Setup(asked).walls, Setup(asked).geometry.closing
    outline = _outline(asked, closing, size)
    with tempfile.TemporaryDirectory() as directory:
        found = openfoam_stone.solve(
            *(Path(directory), outline, walls.ceiling, inflow_of(asked, walls), walls.distance),
            (walls.law.kappa, walls.law.offset),
            CONVECTION[name],
        )
    along = np.diff(outline.points, axis=0)
    lengths = np.linalg.norm(along, axis=1)
    into_stone = np.column_stack([along[:, 1], -along[:, 0]])
    left, stone, right = (outline.walls == k for k in (1, 2, 3))
    force = found.pressure[stone] @ into_stone[stone] + lengths[stone] @ found.friction[stone]
    ends = [np.average(found.pressure[side], weights=lengths[side]) for side in (left, right)]
    places = np.vstack([closing.left.end, closing.contacts, closing.right.end])
    enclosed, _ = load_of(places, np.linspace(ends[0], ends[1], len(closing.contacts) + 1))
    drag, lift = (force + enclosed[:2]) / (0.5 * DIAMETER)
    bed = outline.walls == 0
    middles = 0.5 * (outline.points[1:] + outline.points[:-1])[bed, 0]
    speeds = np.linalg.norm(found.friction[bed], axis=1) ** 0.5
    reached = np.quantile(found.y_plus, (0.0, 1.0))
    return Found(
        *(f"OpenFOAM, {name}", found.cells, float(drag), float(lift), behind(middles, speeds)),
        (float(reached[0]), float(reached[1])),
        found.iterations,
        found.seconds,
    )


def behind(x: np.ndarray, shear_velocity: np.ndarray) -> float:
    """The mean of u* (n,) at ascending x (n,) along the bed behind the stone."""
    places = np.linspace(*BEHIND, 2001)
    return float(np.interp(places, x, shear_velocity).mean())


def _outline(asked: Any, closing: Any, size: float) -> Any:
    """Bed, lines and stone in pieces of a size along the stone, larger along the bed."""
    from programs.openfoam_stone import Outline

    bed, domain = asked.bed_shape, asked.domain
    middle, reach = asked.placement.centre[0], 0.5 * DIAMETER
    ends = (domain.left, closing.left.start[0], closing.right.start[0], domain.right)

    def bed_between(low: float, high: float) -> np.ndarray:
        x = np.linspace(low, high, 4001)
        y = bed.height(x)
        asked_size = np.minimum(
            size + BED_GROWTH * np.maximum(np.abs(x - middle) - reach, 0.0), BED_CELLS * size
        )
        steps = np.hypot(np.diff(x), np.diff(y)) / (0.5 * (asked_size[1:] + asked_size[:-1]))
        number = np.append(0.0, np.cumsum(steps))
        at = np.interp(np.linspace(0.0, number[-1], round(number[-1]) + 1), number, x)
        return np.column_stack([at, bed.height(at)])

    def along(curve: Any, least: int) -> np.ndarray:
        return curve.point(np.linspace(0.0, 1.0, max(round(curve.length / size), least) + 1))

    stone = np.vstack(
        [along(curve, 1)[1 if k else 0 :] for k, curve in enumerate(closing.outline)]
    )[::-1]
    parts = [
        bed_between(*ends[:2]),
        along(closing.left, 1),
        stone,
        along(closing.right, 1)[::-1],
        bed_between(*ends[2:]),
    ]
    points = np.vstack([parts[0], *(part[1:] for part in parts[1:])])
    walls = np.repeat([0, 1, 2, 3, 0], [len(part) - 1 for part in parts])
    return Outline(points, walls)


def inflow_of(asked: Any, walls: Any) -> Any:
    """What enters the scene, by heights."""
    from programs.openfoam import Inflow

    heights = walls.ground + (walls.ceiling - walls.ground) * 0.5 * (
        1.0 - np.cos(np.pi * np.linspace(0.0, 1.0, ROWS))
    )
    x = np.zeros((3, ROWS))
    x[walls.up] = heights
    parts = (walls.inflow.velocity(x, 0.0)[0], *np.exp(walls.inflow.logarithms(x)))
    return Inflow(np.column_stack([heights, *parts]), asked.viscosity)


def table(found: list[Found]) -> str:
    """The table of the page: the coarsest and the finest mesh, and what all tell."""
    lines = [
        "| program | cells | drag | lift | u* behind the stone |",
        "| --- | --- | --- | --- | --- |",
    ]
    for program in dict.fromkeys(one.program for one in found):
        mine = [one for one in found if one.program == program]
        lines += [
            f"| {program} | {one.cells} | {one.drag:.3f} | {one.lift:.3f} | {one.shear_velocity:.4f} |"
            for one in mine[::2]
        ]
        limits = [
            extrapolated([getattr(one, name) for one in mine])
            for name in ("drag", "lift", "shear_velocity")
        ]
        told = " | ".join(f"{limit:.4f} +- {away:.4f}" for limit, away in limits)
        lines.append(f"| {program}, extrapolated | | {told} |")
    return "\n".join(lines)


def main() -> None:
    """Run, write."""
    from programs import openfoam_stone

    if not openfoam_stone.is_installed():
        sys.exit("OpenFOAM is not installed: the table stays as it is")
    found = []
    for mesh_size, size in zip(MESH_SIZES, CELLS, strict=True):
        found += [by_incipient(mesh_size), *(by_openfoam(size, name) for name in CONVECTION)]
        print(*found[-3:], sep="\n", flush=True)
    publish("stone", table(found))


if __name__ == "__main__":
    main()

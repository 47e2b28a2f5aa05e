"""Turbulent flow over steep waves of a bed, without a grain, beside OpenFOAM's with several schemes of convection.

Amplitude 0.02 and length 0.25 of the depth, Re 2,000,000, the law of the wall from 0.003, the walls of both on the
waves. What is seen is the ninth and the tenth wave. It tells what the difference from OpenFOAM is made of.

Cost:    ten minutes; without OpenFOAM (Debian's package `openfoam`) the table stays as it is.
Run:     python benchmarks/turbulent_waves.py
Results: the table "waves"
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from programs import openfoam, openfoam_stone
from tables import publish
from turbulent_stone import inflow_of

NU, DISTANCE, WAVELENGTH, AMPLITUDE, LENGTH = 5e-7, 0.003, 0.25, 0.02, 3.0
SEEN = (2.0, 2.5)
COLUMNS = 32  # of OpenFOAM's cells on a wave
GROWTH, LARGEST = 1.15, 0.04  # of its layers from the bed upwards
ITERATIONS = 2500  # of a scheme that does not converge
CONVECTION = {
    "linear upwind": "linearUpwind grad(U)",
    "linear upwind, gradient limited": "linearUpwind limited",
    "limited linear": "limitedLinear 1",
    "limited linear, of vectors": "limitedLinearV 1",
    "upwind": "upwind",
}
LIMITED = "limited cellMDLimited Gauss linear 1; }"


@dataclass(frozen=True)
class Waves:
    """What one program has found: mean friction, the share of the bed with backward flow, cells, convergence."""

    program: str
    cells: int
    friction: float
    backward: float
    converged: bool

    @classmethod
    def of(
        cls, program: str, cells: int, x: np.ndarray, friction: np.ndarray, converged: bool
    ) -> Waves:
        """From friction (n,) at ascending x (n,)."""
        seen = np.interp(np.linspace(*SEEN, 2001), x, friction)
        return cls(program, cells, float(seen.mean()), float((seen < 0.0).mean()), converged)

    def row(self) -> str:
        """A row of the table."""
        name = self.program if self.converged else f"{self.program}, not converged"
        return f"| {name} | {self.friction:.5f} | {self.backward:.0%} |"


def scene() -> Any:
    """The waves."""
    from incipient import scene as of

    return of.Scene(
        domain=of.Domain(length=LENGTH, height=1.0),
        bed=of.Sinusoidal(amplitude=AMPLITUDE, wavelength=WAVELENGTH),
        fluid=of.Fluid(reynolds=1.0 / NU, scale="flow"),
        flow=of.OpenChannel(),
        effects=of.Effects(turbulence=True),
        turbulence=of.Turbulence(wall_distance=DISTANCE),
        numerics=of.Numerics(order=2, error_bars=False),
    )


def by_incipient() -> Waves:
    """The waves by this program."""
    import incipient

    result = incipient.run(scene())
    assert result.turbulence is not None and result.velocity is not None
    bed = result.turbulence.along["bed"]
    cells = result.velocity.function_space.mesh.topology.index_map(2).size_global
    return Waves.of("incipient", cells, np.array(bed["x"]), 0.5 * np.array(bed["friction"]), True)


def by_openfoam(name: str) -> Waves:
    """The waves by OpenFOAM in layers of quadrilaterals along the bed, with a scheme of `CONVECTION`."""
    from incipient.setup.setup import Setup

    asked, walls = scene(), Setup(scene()).walls
    x = np.linspace(0.0, LENGTH, round(LENGTH / WAVELENGTH * COLUMNS) + 1)
    wall = np.column_stack([x, asked.bed_shape.height(x)])
    flat, cells = _layers(wall, walls.ceiling)
    kappa, offset = walls.law.kappa, walls.law.offset
    law = f"kappa {kappa:g}; E {np.exp(kappa * offset):.8g}; "
    schemes = openfoam.Schemes(1, openfoam_stone.RELAXATION, CONVECTION[name])
    inflow = inflow_of(asked, walls)
    with tempfile.TemporaryDirectory() as folder:
        case = Path(folder)
        for file, text in openfoam.case(
            inflow, openfoam_stone.WALLS, ("lid",), law, schemes
        ).items():
            (case / file).parent.mkdir(parents=True, exist_ok=True)
            text = text.replace(
                "default Gauss linear; }\ndiv", f"default Gauss linear; {LIMITED}\ndiv"
            )
            for key in ("endTime", "writeInterval"):
                text = text.replace(f"{key} {openfoam.ITERATIONS}", f"{key} {ITERATIONS}")
            (case / file).write_text(text, encoding="utf-8")
        bed = np.zeros(len(x) - 1, dtype=int)
        openfoam_stone.write_cells(case / "waves.msh", flat, cells, bed, walls.ceiling)
        openfoam.run(case, "gmshToFoam", "waves.msh")
        openfoam_stone.name_kinds(case / "constant/polyMesh/boundary")
        converged = "SIMPLE solution converged" in openfoam.run(case, "simpleFoam")
        openfoam.run(case, "simpleFoam", "-postProcess", "-latestTime", "-func", "wallShearStress")
        last = max(int(one.name) for one in case.iterdir() if one.name.isdigit())
        read = (case, str(last), wall, walls.distance, inflow.viscosity, ("bed",))
        _, stress, _ = openfoam_stone.read_walls(*read)
    along = np.diff(wall, axis=0)
    friction = (stress * along).sum(axis=1) / np.linalg.norm(along, axis=1)
    return Waves.of(f"OpenFOAM, {name}", len(cells[1]), 0.5 * (x[1:] + x[:-1]), friction, converged)


def _layers(wall: np.ndarray, ceiling: float) -> tuple[np.ndarray, list[np.ndarray]]:
    """Points (n, 2), those of the wall (m, 2) first, and corners: of triangles, which are none, and of cells."""
    heights = [0.0, 2.0 * DISTANCE]
    while heights[-1] < ceiling:
        heights.append(heights[-1] + min(GROWTH * (heights[-1] - heights[-2]), LARGEST))
    level = np.array(heights)
    level[2:] = level[1] + (level[2:] - level[1]) * (ceiling - level[1]) / (level[-1] - level[1])
    room = ceiling - wall[:, 1] - level[-1]
    y = wall[:, 1] + level[:, None] + room * (level[:, None] / level[-1]) ** 2
    points = np.stack([np.broadcast_to(wall[:, 0], y.shape), y], axis=-1).reshape(-1, 2)
    number = np.arange(y.size).reshape(y.shape)
    corners = (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1])
    return points, [np.empty((0, 3), dtype=int), np.stack(corners, axis=-1).reshape(-1, 4)]


def table(found: list[Waves]) -> str:
    """The table of the page."""
    head = ["| program | mean friction | backward flow |", "| --- | --- | --- |"]
    return "\n".join([*head, *(one.row() for one in found)])


def main() -> None:
    """Run, write."""
    if not openfoam_stone.is_installed():
        sys.exit("OpenFOAM is not installed: the table stays as it is")
    found = [by_incipient()]
    for name in CONVECTION:
        found.append(by_openfoam(name))
        print(found[-1], flush=True)
    publish("waves", table(found))


if __name__ == "__main__":
    main()

"""A smooth hump on a wall in a turbulent boundary layer, as a held grain: its form drag and lift against measurements.

The wall-mounted hump of Greenblatt et al. (2006), AIAA J. 44, 2820, Re 936,000 by its chord; data of NASA's
Turbulence Modeling Resource in benchmarks/reference. The flow separates from its lee and reattaches at 1.11 +- 0.003.

Cost:    two to three minutes.
Run:     python benchmarks/turbulent_hump.py
Results: the tables in docs/large_grains.md
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import dolfinx
import numpy as np
from mpi4py import MPI

from incipient import scene as of
from incipient.simulation.build import prepared

ROOT = Path(__file__).parents[1]
PAGE, DATA = ROOT / "docs/large_grains.md", ROOT / "benchmarks/reference"
BEGIN, END = "<!-- hump: begin -->", "<!-- hump: end -->"
REYNOLDS, HEIGHT, UPSTREAM, DOWNSTREAM = 936000.0, 0.90905, -2.14, 3.0  # over the chord
INCH = 25.4 / 420.0
RUNS = ((0.002, 1.41), (0.001, 2.0), (0.001, 1.41))  # distance of the law, mesh_size
STATIONS = (0.1, 0.3, 0.5, 0.6, 0.7, 0.8, 0.9)


def rows(name: str) -> np.ndarray:
    """A table of numbers (n, 2) of benchmarks/reference."""
    lines = (DATA / f"{name}.csv").read_text(encoding="utf-8").splitlines()
    return np.array([line.split(",") for line in lines if line[0] not in "#xy"], dtype=float)


@dataclass(frozen=True)
class Pressures:
    """Pressure coefficients (n,) on the hump at x (n,), and what else was found."""

    name: str
    x: np.ndarray
    coefficients: np.ndarray
    y_plus: str = ""
    separated: str = ""
    cells: int = 0
    seconds: float = 0.0

    def at(self, x: np.ndarray) -> np.ndarray:
        """Coefficients (m,) at x (m,), beyond the first and the last as there."""
        return np.interp(x, self.x, self.coefficients)

    def loads(self, shape: np.ndarray) -> tuple[float, float]:
        """Form drag and lift over V^2/2 and the chord; below the hump is the mean of the pressures at both its ends."""
        x = np.linspace(0.0, 1.0, 4001)
        y, pressure = np.interp(x, *shape.T), self.at(x)
        middle = 0.5 * (pressure[1:] + pressure[:-1])
        return float(middle @ np.diff(y)), float(0.5 * (pressure[0] + pressure[-1]) - middle @ np.diff(x))


def scene(shape: np.ndarray, distance: float, mesh_size: float) -> of.Scene:
    """The hump on a flat bed below a ceiling without friction, with the measured profile entering."""
    outline = shape[::-1]
    following = np.roll(outline, -1, axis=0)
    twice = outline[:, 0] * following[:, 1] - following[:, 0] * outline[:, 1]
    centre = float((outline[:, 0] + following[:, 0]) @ twice / (3.0 * twice.sum()))
    enters = [(y * INCH, speed) for y, speed in rows("hump_inflow")] + [(0.12, 1.0), (0.9, 1.0)]
    return of.Scene(
        domain=of.Domain(length=DOWNSTREAM - UPSTREAM, height=HEIGHT, origin=(UPSTREAM, 0.0)),
        fluid=of.Fluid(reynolds=REYNOLDS * HEIGHT, scale="flow"),
        flow=of.OpenChannel(),
        bed=of.Flat(),
        body=of.Polygon(vertices=outline.tolist(), x=centre),
        contact=of.Contact(friction=0.5, gap=0.002),
        effects=of.Effects(turbulence=True),
        turbulence=of.Turbulence(
            wall_distance=distance, inflow="profile", profile=enters, intensity=0.005, length=0.0075
        ),
        numerics=of.Numerics(mesh_size=mesh_size, order=2, error_bars=False),
    )


def computed(shape: np.ndarray, distance: float, mesh_size: float) -> Pressures:
    """The flow by the k-epsilon model."""
    began = time.process_time()
    with prepared(scene(shape, distance, mesh_size), MPI.COMM_SELF) as run:
        run.part("turbulence").solve(run)
        space, unknowns = run.fluid.state.function_space.sub(1).collapse()
        pressure, places = run.fluid.state.x.array[unknowns], space.tabulate_dof_coordinates()

        def along(name: str) -> tuple[np.ndarray, np.ndarray]:
            nodes = dolfinx.fem.locate_dofs_topological(space, 1, run.domain.facets_of(name))
            nodes = nodes[np.argsort(places[nodes, 0])]
            return places[nodes, 0], pressure[nodes]

        x, found = along("body")
        level = np.interp(UPSTREAM + 0.05, *along("bed"))
        walls = run.wall_report()
        friction = np.array([walls.along["body"][name] for name in ("x", "friction")])
        back = friction[0, friction[1] < 0.0]
        cells = run.domain.mesh.topology.index_map(2).size_global
    return Pressures(
        name=f"k-epsilon, the law from {distance:g}",
        x=x,
        coefficients=2.0 * (found - level),
        y_plus=f"{walls.least:.0f} to {walls.largest:.0f}",
        separated=f"{back.min():.2f} to {back.max():.2f}" if len(back) else "nowhere",
        cells=cells,
        seconds=time.process_time() - began,
    )


def tables(found: list[Pressures], shape: np.ndarray) -> str:
    """Loads, and pressures at stations."""
    lines = [
        "| | y+ | cells | form drag | lift | separated on the hump |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for one in found:
        drag, lift = one.loads(shape)
        of_run = (one.y_plus, one.cells or "", f"{drag:.4f}", f"{lift:.3f}", one.separated)
        lines.append(f"| {' | '.join(map(str, (one.name, *of_run)))} |")
    lines += ["", f"| x | {' | '.join(f'{x:g}' for x in STATIONS)} |", "| --- |" + " --- |" * len(STATIONS)]
    for one in {one.name: one for one in found}.values():  # the finest mesh of each
        values = " | ".join(f"{value:.2f}" for value in one.at(np.array(STATIONS)))
        lines.append(
            f"| {one.name}, {one.cells} cells | {values} |" if one.cells else f"| {one.name} | {values} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Run, write."""
    shape = rows("hump_shape")
    found = [Pressures("measured", *rows("hump_pressure").T, separated="0.67 to the end")]
    for distance, mesh_size in RUNS:
        found.append(computed(shape, distance, mesh_size))
        print(found[-1].name, found[-1].loads(shape), found[-1].seconds, flush=True)
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    _, after = rest.split(END)
    PAGE.write_text(f"{before}{BEGIN}\n{tables(found, shape)}\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()

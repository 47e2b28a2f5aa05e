"""A smooth hump on a wall in a turbulent boundary layer: its form drag and lift against measurements.

The wall-mounted hump of Greenblatt et al. (2006), AIAA J. 44, 2820, Re 936,000 by its chord; data of NASA's
Turbulence Modeling Resource in benchmarks/reference. The flow separates from its lee and reattaches at 1.11 +- 0.003.
By k-epsilon the hump is a held grain, by k-omega SST a smooth bed.

Cost:    about ten minutes.
Run:     python benchmarks/turbulent_hump.py
Results: the tables "hump" and "hump to the wall"
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import dolfinx
import numpy as np
from mpi4py import MPI
from pictures import FIGURES, drawn, plain
from tables import ROOT, publish, read_rows, table

from incipient import scene as of
from incipient.simulation.build import prepared
from incipient.simulation.steady import solve_with_turbulence

REYNOLDS, HEIGHT, UPSTREAM, DOWNSTREAM = 936000.0, 0.90905, -2.14, 3.0  # over the chord
INCH = 25.4 / 420.0
RUNS = ((0.002, 1.41), (0.001, 2.0), (0.001, 1.41))  # distance of the law, mesh_size
MESH_SIZES = (2.0, 2.0**0.5, 1.0)  # of k-omega SST
STATIONS = (0.1, 0.3, 0.5, 0.6, 0.7, 0.8, 0.9)


def rows(name: str) -> np.ndarray:
    """A table of numbers (n, 2) of benchmarks/reference."""
    return np.array(
        [[*row.values()] for row in read_rows(ROOT / f"benchmarks/reference/{name}.csv")]
    )


@dataclass(frozen=True)
class Pressures:
    """Pressure coefficients (n,) on the hump at x (n,), and what else was found."""

    name: str
    x: np.ndarray
    coefficients: np.ndarray
    y_plus: str = ""
    separated: tuple[float, ...] = ()
    cells: int = 0
    seconds: float = 0.0
    friction: tuple[Any, Any] = ((), ())  # x and C_f along the bed

    def at(self, x: np.ndarray) -> np.ndarray:
        """Coefficients (m,) at x (m,), beyond the first and the last as there."""
        return np.interp(x, self.x, self.coefficients)

    def loads(self, shape: np.ndarray) -> tuple[float, float]:
        """Form drag and lift over V^2/2 and the chord; below the hump is the mean of the pressures at both its ends."""
        x = np.linspace(0.0, 1.0, 4001)
        y, pressure = np.interp(x, *shape.T), self.at(x)
        middle = 0.5 * (pressure[1:] + pressure[:-1])
        return float(middle @ np.diff(y)), float(
            0.5 * (pressure[0] + pressure[-1]) - middle @ np.diff(x)
        )


def scene(shape: np.ndarray, distance: float, mesh_size: float) -> of.Scene:
    """The hump on a flat bed below a ceiling without friction, with the measured profile entering."""
    outline = shape[::-1]
    following = np.roll(outline, -1, axis=0)
    twice = outline[:, 0] * following[:, 1] - following[:, 0] * outline[:, 1]
    centre = float((outline[:, 0] + following[:, 0]) @ twice / (3.0 * twice.sum()))
    return of.Scene(
        **_tunnel(mesh_size),
        bed=of.Flat(),
        body=of.Polygon(vertices=outline.tolist(), x=centre),
        contact=of.Contact(friction=0.5, gap=0.002),
        turbulence=of.Turbulence(wall_distance=distance, **_inflow()),
    )


def scene_to_the_wall(shape: np.ndarray, mesh_size: float) -> of.Scene:
    """The hump as a smooth bed, by k-omega SST."""
    points = [(UPSTREAM - 1.0, 0.0), *map(tuple, shape.tolist()), (DOWNSTREAM + 1.0, 0.0)]
    return of.Scene(
        **_tunnel(mesh_size),
        bed=of.Polyline(points=points, smooth=True),
        turbulence=of.Turbulence(model="k-omega-sst", **_inflow()),
    )


def _tunnel(mesh_size: float) -> dict[str, Any]:
    """What both scenes have in common."""
    return {
        "domain": of.Domain(length=DOWNSTREAM - UPSTREAM, height=HEIGHT, origin=(UPSTREAM, 0.0)),
        "fluid": of.Fluid(reynolds=REYNOLDS * HEIGHT, scale="flow"),
        "flow": of.OpenChannel(),
        "effects": of.Effects(turbulence=True),
        "numerics": of.Numerics(mesh_size=mesh_size, order=2, error_bars=False),
    }


def _inflow() -> dict[str, Any]:
    """The measured profile, in a stream of little turbulence."""
    enters = [(y * INCH, speed) for y, speed in rows("hump_inflow")] + [(0.12, 1.0), (0.9, 1.0)]
    return {"inflow": "profile", "profile": enters, "intensity": 0.005, "length": 0.0075}


def computed(name: str, scene: of.Scene, hump: str) -> Pressures:
    """The flow of a scene, whose hump is a named boundary or a part of it."""
    began = time.process_time()
    with prepared(scene, MPI.COMM_SELF) as run:
        solve_with_turbulence(run, run.fluid, run.turbulence)
        space, unknowns = run.fluid.state.function_space.sub(1).collapse()
        pressure, places = run.fluid.state.x.array[unknowns], space.tabulate_dof_coordinates()

        def along(name: str) -> tuple[np.ndarray, np.ndarray]:
            nodes = dolfinx.fem.locate_dofs_topological(space, 1, run.domain.facets_of(name))
            nodes = nodes[np.argsort(places[nodes, 0])]
            return places[nodes, 0], pressure[nodes]

        x, on_hump = along(hump)
        level = np.interp(UPSTREAM + 0.05, *along("bed"))
        walls = run.wall_report()
        if hump == "bed":
            back = np.array([span for span in walls.backward if span[1] > 0.5]).ravel()
        else:
            friction = np.array([walls.along[hump][name] for name in ("x", "friction")])
            back = friction[0, friction[1] < 0.0]
        cells = run.domain.mesh.topology.index_map(2).size_global
    return Pressures(
        name=name,
        x=x,
        coefficients=2.0 * (on_hump - level),
        y_plus=f"{walls.least:.2g} to {walls.largest:.3g}",
        separated=(float(back.min()), float(back.max())) if len(back) else (),
        cells=cells,
        seconds=time.process_time() - began,
        friction=(walls.along["bed"]["x"], walls.along["bed"]["friction"]),
    )


HEADS = ("", "y+", "cells", "form drag", "lift", "separated on the hump")


def tables(flows: list[Pressures], shape: np.ndarray) -> str:
    """Loads, and pressures at stations."""
    loads, pressures = [], {}
    for flow in flows:
        drag, lift = flow.loads(shape)
        apart = " to ".join(f"{x:.2f}" for x in flow.separated) or "nowhere"
        cells = str(flow.cells or "")
        loads.append([flow.name, flow.y_plus, cells, f"{drag:.4f}", f"{lift:.3f}", apart])
        # Of each name those on the finest mesh, which comes last.
        name = f"{flow.name}, {flow.cells} cells" if flow.cells else flow.name
        pressures[flow.name] = [name, *(f"{value:.2f}" for value in flow.at(np.array(STATIONS)))]
    stations = ("x", *(f"{x:g}" for x in STATIONS))
    return f"{table(HEADS, loads)}\n\n{table(stations, pressures.values())}"


def draw(ours: Pressures, others: Pressures, measured: Pressures) -> None:
    """Pressure and friction along the hump."""
    looks = (
        (measured, "measured", {"color": "k", "marker": ".", "ms": 3, "ls": "none"}),
        (others, "CFL3D, SST", {"color": "C3", "ls": "--", "lw": 1}),
        (ours, "incipient, k-omega SST", {"color": "C0", "lw": 1.2}),
    )
    with drawn(FIGURES / "turbulent_hump.png", (9, 3.6), columns=2) as (_, panels):
        pressure, friction = panels[0]
        for flow, label, look in looks:
            pressure.plot(flow.x, flow.coefficients, label=label, **look)
            friction.plot(*flow.friction, **look)
        for axes, label in ((pressure, "pressure coefficient"), (friction, "C_f")):
            axes.set(xlim=(-0.5, 1.6), xlabel="x over the chord", ylabel=label)
        plain(panels)
        pressure.legend()


def main() -> None:
    """Run, write."""
    shape = rows("hump_shape")
    measured, others = (
        Pressures(
            name=name,
            x=rows(f"hump_pressure{ending}")[:, 0],
            coefficients=rows(f"hump_pressure{ending}")[:, 1],
            separated=separated,
            cells=cells,
            friction=(rows(f"hump_friction{ending}")[:, 0], rows(f"hump_friction{ending}")[:, 1]),
        )
        for name, ending, separated, cells in (
            ("measured", "", (0.665, 1.11), 0),
            ("CFL3D, SST", "_sst", (0.653, 1.269), 176256),
        )
    )
    to_wall = []
    for mesh_size in MESH_SIZES:
        name = f"k-omega SST, `mesh_size` = {mesh_size:.3g}"
        to_wall.append(computed(name, scene_to_the_wall(shape, mesh_size), "bed"))
        print(to_wall[-1].name, to_wall[-1].separated, to_wall[-1].loads(shape), flush=True)
    draw(to_wall[-1], others, measured)
    flows = [measured]
    for distance, mesh_size in RUNS:
        name = f"k-epsilon, the law from {distance:g}"
        flows.append(computed(name, scene(shape, distance, mesh_size), "body"))
        print(flows[-1].name, flows[-1].loads(shape), flows[-1].seconds, flush=True)
    publish("hump", tables([*flows, to_wall[-1], others], shape))


if __name__ == "__main__":
    main()

"""Loads of spheres in flow with inertia from mesh to mesh, plain and corrected by their estimates, and what each takes.

A free sphere at Re 100, 200 and 300, and a sphere on a plane in shear at G d^2/nu = 200 and 400, on meshes of
`numerics.mesh_size` 2 to 0.5: every flow is to be found, and the corrected loads are to agree.

Cost:    an hour and a half, and 6 GiB for the largest meshes.
Run:     python benchmarks/meshes_in_space.py [free or plane] [--mesh-size 1.0 0.7]
Results: benchmarks/meshes_in_space.json and, from all that it has, the tables "meshes of free" and "meshes of plane"
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import measure
from tables import publish

ROOT = Path(__file__).resolve().parents[1]
STORED = Path(__file__).parent / "meshes_in_space.json"
SCENES = ROOT / "benchmarks" / "scenes"
MESH_SIZES = (2.0, 1.4, 1.0, 0.7, 0.5)
HEADS = {
    "free": "| Re | mesh_size | unknowns | C_D | corrected | C_L | corrected | wake, d | iterations a correction "
    "| flow s | estimate s |",
    "plane": "| G d^2/nu | mesh_size | unknowns | drag | corrected | lift | corrected | couple | corrected "
    "| iterations | flow s | estimate s |",
}
AREA = math.pi / 4.0  # of a sphere of diameter 1 as the stream sees it


@dataclass(frozen=True)
class Case:
    """A scene, what is changed in it, and the Reynolds numbers that it is solved at."""

    path: Path
    settings: tuple[str, ...]
    reynolds: tuple[float, ...]


CASES = {
    "free": Case(SCENES / "free_sphere.toml", ("domain.sides=stream",), (100.0, 200.0, 300.0)),
    "plane": Case(SCENES / "sphere_in_shear.toml", (), (200.0, 400.0)),
}


@dataclass(frozen=True)
class Row:
    """One flow: loads in units of density, speed or shear, and diameter; processor seconds of flow and estimate.

    wake: length of the backward flow behind the sphere; iterations: of a correction, the mean of those of the flow
    why: why there is no flow or no estimate
    """

    name: str
    reynolds: float
    mesh_size: float
    unknowns: int = 0
    drag: float = math.nan
    lift: float = math.nan
    couple: float = math.nan
    corrected: tuple[float, float, float] = (math.nan, math.nan, math.nan)
    wake: float = math.nan
    iterations: float = math.nan
    seconds: float = math.nan
    estimate_seconds: float = math.nan
    mib: float = math.nan
    why: str = ""

    def cells(self) -> tuple[str, ...]:
        """Cells of the table, from the mesh size on."""
        if self.name == "free":
            loads = [
                f"{one / (0.5 * AREA):.4f}"
                for one in (self.drag, self.corrected[0], self.lift, self.corrected[1])
            ]
            numbers = (*loads, f"{self.wake:.3f}")
        else:
            pairs = zip((self.drag, self.lift, self.couple), self.corrected, (4, 4, 5), strict=True)
            numbers = tuple(f"{one:.{digits}f}" for *both, digits in pairs for one in both)
        taken = (f"{self.iterations:.0f}", f"{self.seconds:.0f}", f"{self.estimate_seconds:.0f}")
        found = (f"{self.mesh_size}", f"{self.unknowns:,}", *numbers, *taken)
        return tuple("" if one == "nan" else one for one in found)


def solved(name: str, reynolds: float, mesh_size: float, estimates: bool = True) -> Row:
    """Solve one flow in this process and estimate its errors."""
    from time import process_time

    from mpi4py import MPI

    from incipient.accuracy.dual import GoalErrors
    from incipient.errors import IncipientError
    from incipient.results.timing import peak_memory_mib
    from incipient.scene import load
    from incipient.simulation.build import prepared
    from incipient.simulation.steady import loads_at

    case = CASES[name]
    changes = (*case.settings, f"fluid.reynolds={reynolds}", f"numerics.mesh_size={mesh_size}")
    scene = load(case.path, changes)
    found: dict[str, Any] = {"name": name, "reynolds": reynolds, "mesh_size": mesh_size}
    try:
        with prepared(scene, MPI.COMM_WORLD) as run:
            found["unknowns"], began = run.fluid.space.unknowns, process_time()
            force, couple = loads_at(run, 1.0)
            found["seconds"] = process_time() - began
            counts = run.fluid.solver.statistics
            found["iterations"] = counts.krylov_iterations / counts.solves
            found |= {"drag": force.flow[0], "lift": force.flow[2], "couple": couple.flow[1]}
            if name == "free":
                found["wake"] = wake_of(run)
            if not estimates:
                return Row(**found, mib=peak_memory_mib())
            began = process_time()
            with GoalErrors(run.fluid, "body", run.layout.placement.centre) as goals:
                if goals.is_upwinded:
                    goals.correct_again()
                loads = goals.loads(run.fluid.reynolds / run.plan.reynolds)
            found["corrected"] = (
                float(loads.force[0]),
                float(loads.force[2]),
                float(loads.torque[1]),
            )
            found["estimate_seconds"] = process_time() - began
    except IncipientError as error:
        found["why"] = str(error)
    return Row(**found, mib=peak_memory_mib())


def wake_of(run: Any) -> float:
    """Length of the backward flow on the axis behind the sphere, in diameters."""
    import numpy as np

    from incipient.mesh.sampling import sample

    behind = np.linspace(0.5, 5.0, 901)[1:]
    points = np.asarray(run.layout.placement.centre) + np.outer(behind, [1.0, 0.0, 0.0])
    return float(behind[np.argmax(sample(run.fluid.velocity, points)[:, 0] > 0.0)] - 0.5)


def table(name: str, rows: Sequence[Row]) -> str:
    """The table of one case, by Reynolds number and from large cells to small ones."""
    columns = HEADS[name].count("|") - 1
    lines = [HEADS[name], "|" + " --: |" * columns]
    before = None
    for row in sorted(rows, key=lambda row: (row.reynolds, -row.mesh_size)):
        number = "" if row.reynolds == before else f"{row.reynolds:.0f}"
        before = row.reynolds
        lines.append(f"| {number} | {' | '.join(row.cells())} |".replace("|  |", "| |"))
        if row.why:
            lines[-1] = f"| {number} | {row.mesh_size} | {row.unknowns:,} | {row.why} |"
    return "\n".join(lines)


def renew(rows: Sequence[Row]) -> None:
    """Write the tables into the page."""
    for name in CASES:
        publish(f"meshes of {name}", table(name, [row for row in rows if row.name == name]))


def main() -> int:
    """Solve what is wanted, each flow in a process of its own, and renew the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("wanted", nargs="*", default=list(CASES), help="free, plane")
    parser.add_argument("--mesh-size", type=float, nargs="*", default=list(MESH_SIZES))
    parser.add_argument("--reynolds", type=float, nargs="*", help="only these")
    parser.add_argument("--flow-only", action="store_true", help="no estimates")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        row = solved(
            options.wanted[0], options.reynolds[0], options.mesh_size[0], not options.flow_only
        )
        print(json.dumps(asdict(row)))
        return 0
    stored = json.loads(STORED.read_text()) if STORED.is_file() else []
    rows = {(one["name"], one["reynolds"], one["mesh_size"]): Row(**one) for one in stored}
    for name in options.wanted:
        for reynolds in CASES[name].reynolds:
            for size in options.mesh_size:
                if options.reynolds and reynolds not in options.reynolds:
                    continue
                given = [name, "--one", "--reynolds", str(reynolds), "--mesh-size", str(size)]
                given += ["--flow-only"] if options.flow_only else []
                usage = measure.measure([sys.executable, __file__, *given])
                if usage.exit_code:
                    raise SystemExit(usage.errors)
                row = Row(**json.loads(usage.output.strip().splitlines()[-1]))
                print(row, flush=True)
                rows[name, reynolds, size] = row
                STORED.write_text(
                    json.dumps([asdict(one) for one in rows.values()], indent=1) + "\n"
                )
                renew(list(rows.values()))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

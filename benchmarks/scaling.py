"""How the solver by blocks scales in space: half a sphere above a plane, each case in a process of its own.

    make scaling ARGS="--quick"

Prints what docs/scaling.md shows: iterations, processor seconds of the whole process, memory an unknown.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

from mpi4py import MPI  # first: PyPI's dolfinx finds its MPI only then

# isort: split
import gmsh
from cases.half_sphere import conditions, from_file, half_sphere

from incipient.coupled.tractions import TractionProbe
from incipient.fluid import FlowModel, Fluid
from incipient.mesh.domain import build

SIZES = (0.15, 0.05, 0.035, 0.0245)
GAPS = (0.1, 0.01, 0.003)
GAP = 0.01
OF_MPI = ("PMIX_", "OMPI_MCA_", "OMPI_COMM_", "OMPI_UNIVERSE", "OMPI_FILE", "ORTE_")


def solve(mesh: Path, reynolds: float, gap: float) -> dict[str, Any]:
    """Stokes flow, or at Re = G d^2/(2 nu) from nothing: what it took, on however many ranks there are."""
    domain = build(MPI.COMM_WORLD, partial(from_file, mesh))
    inertia = reynolds > 0
    model = FlowModel(inertia=inertia, upwind=inertia, solver="block")
    with Fluid(domain, model, conditions(), 2 * reynolds or 1.0) as fluid:
        counts: list[int] = []
        fluid.watch = lambda k, size: counts.append(
            fluid.solver.statistics.krylov_iterations - sum(counts)
        )
        report = fluid.solve(1e-6)
        load = TractionProbe(fluid, "body", (0.0, 0.0, 0.5 + gap)).resultant()
        times = os.times()
        seconds = domain.comm.allreduce(times.user + times.system)
        memory = domain.comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
        return {
            "unknowns": fluid.space.unknowns,
            "ranks": domain.comm.size,
            "iterations": counts,
            "converged": report.converged,
            "force": float(load.force[0] * fluid.reynolds),
            "seconds": seconds,
            "kilobytes": memory / fluid.space.unknowns,
        }


def run(mesh: Path, reynolds: float, gap: float, ranks: int = 1) -> dict[str, Any]:
    """`solve` in processes of its own."""
    arguments = [
        str(Path(__file__)),
        "--mesh",
        str(mesh),
        "--reynolds",
        str(reynolds),
        "--gap",
        str(gap),
    ]
    start = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    # This process has begun MPI, and mpirun refuses to start within what that leaves in the environment.
    free = {name: value for name, value in os.environ.items() if not name.startswith(OF_MPI)}
    command = [*start, sys.executable, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=free)
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def row(name: str, found: dict[str, Any]) -> str:
    """One line of the table."""
    counts = ", ".join(map(str, found["iterations"]))
    return (
        f"| {name} | {found['unknowns']} | {found['ranks']} | {counts} | {found['seconds']:.1f} | "
        f"{found['kilobytes']:.1f} | {found['force']:.4f} |"
    )


def drawn(directory: Path, size: float, gap: float) -> Path:
    """A mesh in a file of its own, so that drawing is not measured."""
    path = directory / f"{size}_{gap}.msh"
    with half_sphere(size, gap):
        gmsh.write(str(path))
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the two coarser meshes only")
    parser.add_argument("--mesh", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--reynolds", type=float, default=0.0, help=argparse.SUPPRESS)
    parser.add_argument("--gap", type=float, default=GAP, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.mesh is not None:
        found = solve(given.mesh, given.reynolds, given.gap)
        if found["converged"] and MPI.COMM_WORLD.rank == 0:
            print(json.dumps(found))
        return
    sizes = SIZES[:2] if given.quick else SIZES
    print(
        "| flow | unknowns | ranks | iterations | processor s | kB an unknown | force / (nu G d) |"
    )
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        meshes = {size: drawn(Path(name), size, GAP) for size in sizes}
        for reynolds in (0.0, 20.0, 200.0):
            flow = f"Re = {reynolds:g}" if reynolds else "Stokes"
            for size in sizes:
                print(row(flow, run(meshes[size], reynolds, GAP)), flush=True)
        print(row("Stokes", run(meshes[sizes[-1]], 0.0, GAP, ranks=2)), flush=True)
        for gap in GAPS:
            print(
                row(f"Stokes, gap {gap:g}", run(drawn(Path(name), SIZES[0], gap), 0.0, gap)),
                flush=True,
            )


if __name__ == "__main__":
    main()

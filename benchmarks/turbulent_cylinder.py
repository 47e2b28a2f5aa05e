"""A smooth cylinder in a uniform turbulent stream by k-omega SST, Re 100,000 and 3.6 million, beside measurements.

Measured from Re 3.5 million on: C_D 0.7, a Strouhal number of 0.27 (Roshko 1961, J. Fluid Mech. 10, 345, the abstract).
The other numbers of Achenbach (1968), J. Fluid Mech. 34, 625, and the Strouhal number at Re 100,000 are as commonly
quoted, not read off the papers.

Cost:    an hour.
Run:     python benchmarks/turbulent_cylinder.py
Results: the table in docs/k_omega.md
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tables import put

ROOT = Path(__file__).parents[1]
PAGE, SCENE = ROOT / "docs/k_omega.md", ROOT / "benchmarks/scenes/turbulent_cylinder.toml"
BEGIN, END = "<!-- cylinder: begin -->", "<!-- cylinder: end -->"
PERIODIC = 20.0  # time from which means are taken
# Reynolds number, numerics.stabilisation and numerics.mesh_size.
CASES = ((1e5, "auto", 2.0), (1e5, "auto", 2.0**0.5), (3.6e6, "on", 2.0), (3.6e6, "on", 2.0**0.5))
MEASURED = (
    "| measured | 1e+05 |  |  |  | 1.2 | 0.18 to 0.2 |  | 80 |  |",
    "| measured | 3.6e+06 |  |  |  | 0.7 to 0.76 | 0.27 |  | 115 |  |",
)


@dataclass(frozen=True)
class Found:
    """Means over whole periods of one run, and what it cost."""

    reynolds: float
    mesh_size: float
    unknowns: int
    periods: int
    drag: float
    strouhal: float
    lift: float  # root mean square
    separates: float  # degrees from the front
    y_plus: float
    seconds: float


def computed(reynolds: float, stabilisation: str, mesh_size: float) -> Found:
    """The scene at a Reynolds number on cells of a size, its velocity upwinded or not."""
    import incipient
    from incipient.scene.file import load

    scene = load(SCENE)
    sections = {
        "fluid": scene.fluid.model_copy(update={"reynolds": reynolds}),
        "numerics": scene.numerics.model_copy(
            update={"stabilisation": stabilisation, "mesh_size": mesh_size}
        ),
        "output": scene.output.model_copy(update={"fields": False}),
    }
    began = time.process_time()
    with tempfile.TemporaryDirectory() as place:
        result = incipient.run(scene.model_copy(update=sections), place, overwrite=True)
        rows = np.genfromtxt(
            Path(place) / "history.csv", delimiter=",", names=True, dtype=None, encoding=None
        )
    unknowns = result.cost["effects"]["turbulence"]["unknowns"] + result.cost["unknowns"]
    return of_rows(rows, (reynolds, mesh_size), unknowns, time.process_time() - began)


def of_rows(rows: np.ndarray, case: tuple[float, float], unknowns: int, seconds: float) -> Found:
    """Means over the periods of a history, which end where the lift rises through zero."""
    rows = rows[rows["time"] >= PERIODIC]
    instants, lift = rows["time"], rows["lift"] - rows["lift"].mean()
    (rising,) = np.nonzero((lift[:-1] < 0.0) & (lift[1:] >= 0.0))
    ends = instants[rising] - lift[rising] * np.diff(instants)[rising] / np.diff(lift)[rising]
    within = (instants >= ends[0]) & (instants <= ends[-1])

    def mean(values: np.ndarray) -> float:
        middles = 0.5 * (values[within][1:] + values[within][:-1])
        return float(middles @ np.diff(instants[within]) / np.ptp(instants[within]))

    both = 0.5 * (rows["separation_above"] + rows["separation_below"])
    return Found(
        reynolds=case[0],
        mesh_size=case[1],
        unknowns=unknowns,
        periods=len(ends) - 1,
        drag=mean(rows["drag"]),
        strouhal=float((len(ends) - 1) / (ends[-1] - ends[0])),
        lift=mean(rows["lift"] ** 2) ** 0.5,
        separates=mean(both),
        y_plus=float(rows["y_plus_max"].max()),
        seconds=seconds,
    )


def table(found: list[Found]) -> str:
    """The table of the page."""
    lines = [
        "| | Re | `mesh_size` | unknowns | periods | C_D | Strouhal number | C_L, root mean square | leaves at | "
        "processor time |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| k-omega SST | {one.reynolds:.2g} | {one.mesh_size:.3g} | {one.unknowns} | {one.periods} | {one.drag:.3f} | "
        f"{one.strouhal:.3f} | {one.lift:.3f} | {one.separates:.0f} | {one.seconds:.0f} s |"
        for one in found
    ]
    return "\n".join([*lines, *MEASURED])


def main() -> None:
    """Run, write."""
    found = []
    for case in CASES:
        found.append(computed(*case))
        print(found[-1], flush=True)
    put(PAGE, table(found), BEGIN, END)


if __name__ == "__main__":
    main()

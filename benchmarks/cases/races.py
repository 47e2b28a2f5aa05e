"""Driven cavity from rest and DFG 2D-1: errors against time, for two programs run alternately."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import callers
from measure import Session
from references import CAVITY, CAVITY_PLACES, CYLINDER, errors
from tables import Row, cheapest, failures, seconds, small, table


@dataclass(frozen=True)
class Race:
    """Variants of two programs that compute the same numbers.

    work: what they compute; scene: of the demos; sizes: mesh sizes of incipient by order
    script: of NGSolve; others: its arguments by the name of the variant
    reference: the true numbers; targets: largest relative errors
    values: the numbers by what a row of incipient has
    heads, shown: errors in the table, and these of a row
    text: of the section
    """

    work: str
    scene: str
    sizes: Mapping[int, tuple[float, ...]]
    script: str
    others: Mapping[str, tuple[float, ...]]
    reference: Mapping[str, float]
    targets: Mapping[str, float]
    values: Callable[[Row], Mapping[str, float]]
    heads: tuple[str, ...]
    shown: Callable[[Row], list[float]]
    text: str

    def measure(self, session: Session) -> dict[str, Any]:
        """Rows of all variants, each with its errors."""
        programs = [
            callers.incipient(
                session,
                self.scene,
                f"P{order}-P{order - 1}, mesh_size = {size:g}",
                {"numerics.order": order, "numerics.mesh_size": size},
            )
            for order, sizes in self.sizes.items()
            for size in sizes
        ]
        if callers.ngsolve_version():
            programs += [
                callers.ngsolve(self.script, name, *arguments)
                for name, arguments in self.others.items()
            ]
        return {"rows": [self._with_errors(row) for row in session.compare(programs)]}

    def _with_errors(self, row: Row) -> Row:
        if "error" in row:
            return row
        values = row if row["family"] == callers.NGSOLVE else self.values(row)
        numbers = {name: values[name] for name in self.reference}
        return {**row, **numbers, "errors": errors(numbers, self.reference)}

    def reaches(self, row: Row) -> bool:
        """Whether all errors are within the targets."""
        return all(row["errors"][name] <= most for name, most in self.targets.items())

    def describe(self, data: dict[str, Any]) -> str:
        """The section of the page."""
        heads = ["program", "unknowns", *self.heads, "wall [s]", "CPU [s]", "memory [MiB]"]
        cells = [
            [
                f"{row['family']}: {row['name']}",
                str(row["unknowns"]),
                *map(small, self.shown(row)),
                seconds(row["wall"]),
                seconds(row["cpu"]),
                f"{row['peak_mib']:.0f}",
            ]
            for row in cheapest(data["rows"], self.reaches).values()
        ]
        return f"{self.text}\n\n{table(heads, cells)}\n\n{failures(data['rows'])}"


EXTREMA = ", ".join(
    f"{name} {value:.7f} at {CAVITY_PLACES[name]:g}" for name, value in CAVITY.items()
)
ALL = {
    "cylinder": Race(
        work="DFG 2D-1",
        scene="cylinder",
        sizes={2: (1.0, 0.5, 0.35), 3: (1.5, 1.0, 0.5), 4: (2.0, 1.5, 1.0, 0.75, 0.5)},
        script="ngsolve_cylinder",
        others={
            f"P4-P3, curved cells, {near:g} to {far:g}": (4, near, far)
            for near, far in ((0.02, 0.08), (0.015, 0.06), (0.012, 0.055), (0.01, 0.05))
        },
        reference=CYLINDER,
        targets={"drag": 1e-6, "lift": 1e-3},
        values=lambda row: row["coefficients"],
        heads=("error of C_D", "error of C_L"),
        shown=lambda row: [*row["errors"].values()],
        text=f"""### Cylinder in a channel, Re = 20 (DFG 2D-1)

Cheapest runs with errors below 1e-06 of C_D = {CYLINDER["drag"]} and 0.001 of
C_L = {CYLINDER["lift"]} (Schäfer & Turek 1996, digits of Nabh 1998). All compute the force from the residual.""",
    ),
    "cavity": Race(
        work="the cavity at Re = 1000",
        scene="cavity",
        sizes={2: (1.0, 0.5), 3: (1.0, 0.75), 4: (1.25, 1.0, 0.75)},
        script="ngsolve_cavity",
        others={
            f"P{order}-P{order - 1}, {cells} x {cells} x 2 cells": (order, cells)
            for order, cells in ((3, 32), (3, 40), (4, 18), (4, 20), (4, 24))
        },
        reference=CAVITY,
        targets=dict.fromkeys(CAVITY, 1e-4),
        values=lambda row: {name: line["value"] for name, line in row["centrelines"].items()},
        heads=("largest error",),
        shown=lambda row: [max(row["errors"].values())],
        text=f"""### Driven cavity, Re = 1000, from rest

Cheapest runs whose extreme velocities on the centrelines are within 0.0001 (relative) of those of Botella &
Peyret (1998): {EXTREMA}. NGSolve steps over Re = 100 and 400; incipient chooses its own steps.""",
    ),
}

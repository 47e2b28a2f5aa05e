"""Driven cavity at Re = 1000 from rest: error of the centreline extrema against time, for two programs."""

from __future__ import annotations

from typing import Any

import callers
from measure import Session
from references import CAVITY, CAVITY_PLACES, errors
from tables import Row, cheapest, expense, failures, seconds, small, table

TARGET = 1e-4
SIZES = {2: (1.0, 0.5), 3: (1.0, 0.75), 4: (1.25, 1.0, 0.75)}
NGSOLVE = ((3, 32), (3, 40), (4, 18), (4, 20), (4, 24))


def measure(session: Session) -> dict[str, Any]:
    """Rows of all variants, each with its errors."""
    programs = [
        callers.incipient(
            session,
            "cavity",
            f"P{order}-P{order - 1}, mesh_size = {size:g}",
            {"numerics.order": order, "numerics.mesh_size": size},
        )
        for order, sizes in SIZES.items()
        for size in sizes
    ]
    if callers.prepare_ngsolve(session):
        for order, cells in NGSOLVE:
            name = f"P{order}-P{order - 1}, {cells} x {cells} x 2 cells"
            programs.append(callers.ngsolve("ngsolve_cavity", name, order, cells))
    return {"rows": [_with_errors(row) for row in session.compare(programs)]}


def _with_errors(row: Row) -> Row:
    if "error" in row:
        return row
    lines = row.pop("centrelines", {})
    found = {name: lines[name]["value"] if lines else row[name] for name in CAVITY}
    return {**row, **found, "errors": errors(found, CAVITY)}


def worst(row: Row) -> float:
    """Largest relative error of the three extrema."""
    return max(row["errors"].values())


def describe(data: dict[str, Any]) -> str:
    """The section of the page."""
    rows = data["rows"]
    heads = ["program", "unknowns", "largest error", "wall [s]", "CPU [s]", "memory [MiB]"]
    cells = [
        [
            f"{r['family']}: {r['name']}",
            str(r["unknowns"]),
            small(worst(r)),
            seconds(r["wall"]),
            *expense(r),
        ]
        for r in cheapest(rows, lambda row: worst(row) <= TARGET).values()
    ]
    extrema = ", ".join(
        f"{name} {value:.7f} at {CAVITY_PLACES[name]:g}" for name, value in CAVITY.items()
    )
    return f"""### Driven cavity, Re = 1000, from rest

Cheapest runs whose extreme velocities on the centrelines are within {TARGET:g} (relative) of those of Botella &
Peyret (1998): {extrema}. NGSolve steps over Re = 100 and 400; incipient chooses its own steps.

{table(heads, cells)}

{failures(rows)}"""

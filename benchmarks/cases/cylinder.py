"""DFG 2D-1: error of drag and lift against time, for two programs run alternately."""

from __future__ import annotations

from typing import Any

import callers
from measure import Session
from references import CYLINDER, errors
from tables import Row, cheapest, expense, failures, seconds, small, table

TARGET = {"drag": 1e-6, "lift": 1e-3}
SIZES = {2: (1.0, 0.5, 0.35), 3: (1.5, 1.0, 0.5), 4: (2.0, 1.5, 1.0, 0.75, 0.5)}
NGSOLVE = ((4, 0.02, 0.08), (4, 0.015, 0.06), (4, 0.012, 0.055), (4, 0.01, 0.05))


def measure(session: Session) -> dict[str, Any]:
    """Rows of all variants, each with its errors."""
    programs = [
        callers.incipient(
            session,
            "cylinder",
            f"P{order}-P{order - 1}, mesh_size = {size:g}",
            {"numerics.order": order, "numerics.mesh_size": size},
        )
        for order, sizes in SIZES.items()
        for size in sizes
    ]
    if callers.prepare_ngsolve(session):
        for order, near, far in NGSOLVE:
            name = f"P{order}-P{order - 1}, curved cells, {near:g} to {far:g}"
            programs.append(callers.ngsolve("ngsolve_cylinder", name, order, near, far))
    return {"rows": [_with_errors(row) for row in session.compare(programs)]}


def _with_errors(row: Row) -> Row:
    if "error" in row:
        return row
    found = row.pop("coefficients", row)
    kept = {key: row[key] for key in row if key not in ("force", "couple", "moment")}
    return {**kept, **{name: found[name] for name in CYLINDER}, "errors": errors(found, CYLINDER)}


def reaches(row: Row) -> bool:
    """Whether drag and lift are as good as the target asks."""
    return all(row["errors"][name] <= most for name, most in TARGET.items())


def describe(data: dict[str, Any]) -> str:
    """The section of the page."""
    rows = data["rows"]
    heads = [
        "program",
        "unknowns",
        "error of C_D",
        "error of C_L",
        "wall [s]",
        "CPU [s]",
        "memory [MiB]",
    ]
    cells = [
        [
            f"{r['family']}: {r['name']}",
            str(r["unknowns"]),
            *map(small, r["errors"].values()),
            seconds(r["wall"]),
            *expense(r),
        ]
        for r in cheapest(rows, reaches).values()
    ]
    return f"""### Cylinder in a channel, Re = 20 (DFG 2D-1)

Cheapest runs with errors below {TARGET["drag"]:g} of C_D = {CYLINDER["drag"]} and {TARGET["lift"]:g} of
C_L = {CYLINDER["lift"]} (Schäfer & Turek 1996, digits of Nabh 1998). All compute the force from the residual.

{table(heads, cells)}

{failures(rows)}"""

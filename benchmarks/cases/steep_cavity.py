"""Driven cavity over Reynolds numbers: profiles beside Ghia's, and Re = 4000 against a finer run of our own."""

from __future__ import annotations

from typing import Any

import callers
import figures
from measure import Program, Session
from references import errors
from tables import Row, seconds, small

REYNOLDS = (100, 400, 1000, 3200, 4000)
HARDEST, FINE = 4000, 0.5
SIZES = (1.5, 1.0)


def measure(session: Session) -> dict[str, Any]:
    """Profiles, deviations from Ghia's points, cost and error at the highest Reynolds number."""
    profiles = {}
    for reynolds in REYNOLDS:
        profile = session.once(callers.script(f"Re = {reynolds}", "profiles", reynolds))
        if "error" in profile:
            return {"error": profile["error"]}
        profiles[str(reynolds)] = profile
    figures.cavity(profiles)
    rows = session.compare([_at_hardest(session, size) for size in SIZES])
    fine = session.once(_at_hardest(session, FINE))
    return {
        "deviations": {key: _deviations(profile["points"]) for key, profile in profiles.items()},
        "rows": [_compared(row, fine) for row in rows],
        "fine": fine,
    }


def _at_hardest(session: Session, size: float) -> Program:
    settings = {"fluid.reynolds": HARDEST, "numerics.mesh_size": size}
    return callers.incipient(session, "cavity", f"mesh_size = {size:g}", settings)


def _deviations(points: list[Row]) -> dict[str, Any]:
    """Largest difference from the printed value on either line and where; empty without printed values."""
    largest: dict[str, Any] = {}
    for point in sorted(points, key=lambda point: abs(point["found"] - point["value"])):
        deviation = abs(point["found"] - point["value"])
        largest[point["line"]] = {"deviation": deviation, "position": point["position"]}
    return largest


def _compared(row: Row, fine: Row) -> Row:
    if "error" in row or "error" in fine:
        return row
    values, true = (
        {name: line["value"] for name, line in each["centrelines"].items()} for each in (row, fine)
    )
    return {**row, "errors": errors(values, true)}


def describe(data: dict[str, Any]) -> str:
    """The section of the page."""
    if "error" in data:
        return f"### Driven cavity up to Re = 4000\n\nCould not be run: `{data['error']}`."
    deviations = [
        f"{max(part['deviation'] for part in parts.values()):.3f} (Re {key})"
        for key, parts in data["deviations"].items()
        if parts
    ]
    cost = [
        f"{small(max(r['errors'].values()))} with {r['name']} ({r['unknowns']} unknowns, {seconds(r['cpu'])} s)"
        for r in data["rows"]
        if "error" not in r
    ]
    fine = data["fine"]
    return f"""### Driven cavity up to Re = 4000, from rest

![Velocity on the centrelines of the driven cavity](../figures/cavity.png)

The paper's Fig. 2. Lines: `demos/scenes/cavity.toml` (P4-P3, mesh_size = 1); markers: Ghia, Ghia & Shin (1982),
`benchmarks/reference/cavity_ghia_1982.csv`, without known misprints. Largest deviations from their table (about three
digits): {", ".join(deviations)}.

At Re = {HARDEST} the largest error of the three extrema against {fine["name"]} ({fine["unknowns"]} unknowns,
{seconds(fine["cpu"])} s of CPU time) is {" and ".join(cost)}."""

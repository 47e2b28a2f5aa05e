"""Driven cavity over Reynolds numbers: profiles beside Ghia's, and Re = 4000 against a finer run of our own."""

from __future__ import annotations

import json
from typing import Any

import callers
from measure import Session
from tables import Row, seconds, small

REYNOLDS = (100, 400, 1000, 3200, 4000)
HARDEST, FINE = 4000, 0.5
SIZES = (1.5, 1.0)
FIGURE = "docs/figures/cavity.png"


def measure(session: Session) -> dict[str, Any]:
    """Profiles, deviations from Ghia's points, cost and error at the highest Reynolds number."""
    profiles = {}
    for reynolds in REYNOLDS:
        row = session.once(
            callers.script(f"Re = {reynolds}", "benchmarks/profiles.py", reynolds, 1.0)
        )
        if "error" in row:
            return {"error": row["error"]}
        profiles[str(reynolds)] = {
            key: row[key] for key in ("positions", "lines", "points", "extrema")
        }
        session.say(f"profiles at Re = {reynolds}")
    _draw(session, profiles)
    reference = _at_hardest(session, FINE)
    rows = session.compare([_at_hardest(session, size) for size in SIZES])
    fine = session.once(reference)
    return {
        "deviations": {key: _deviations(profile["points"]) for key, profile in profiles.items()},
        "extrema": {key: profile["extrema"] for key, profile in profiles.items()},
        "rows": [_compared(row, fine) for row in rows],
        "fine": fine,
    }


def _at_hardest(session: Session, size: float) -> Any:
    settings = {"fluid.reynolds": HARDEST, "numerics.mesh_size": size}
    return callers.incipient(session, "cavity", f"mesh_size = {size:g}", settings)


def _deviations(points: list[Row]) -> dict[str, Any]:
    """Largest |found - printed| on either line and where; empty without printed values."""
    worst: dict[str, Any] = {}
    for line in ("u", "v"):
        here = [(abs(p["found"] - p["value"]), p["position"]) for p in points if p["line"] == line]
        if here:
            worst[line] = dict(zip(("deviation", "position"), max(here), strict=True))
    return worst


def _compared(row: Row, fine: Row) -> Row:
    if "error" in row or "error" in fine:
        return row
    lines, true = row["centrelines"], fine["centrelines"]
    found = {name: abs(lines[name]["value"] / true[name]["value"] - 1) for name in true}
    return {**row, "errors": found}


def _draw(session: Session, profiles: dict[str, Any]) -> None:
    data = session.directory().with_suffix(".json")
    data.write_text(json.dumps(profiles))
    row = session.once(callers.script("figure", "benchmarks/figures.py", "cavity", data, FIGURE))
    session.say(row.get("error", f"drew {FIGURE}"))


def describe(data: dict[str, Any]) -> str:
    """The section of the page."""
    if "error" in data:
        return f"### Driven cavity up to Re = 4000\n\nCould not be run: `{data['error']}`."
    deviations = [
        f"{max(part['deviation'] for part in found.values()):.3f} (Re {key})"
        for key, found in data["deviations"].items()
        if found
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

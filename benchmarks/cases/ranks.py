"""One scene on one and on two ranks: whether the numbers agree, and the times."""

from __future__ import annotations

import os
from typing import Any

import callers
from measure import Session
from references import CYLINDER, errors
from tables import seconds, small

RANKS = 2
SETTINGS = {"numerics.order": 4, "numerics.mesh_size": 0.35}


def measure(session: Session) -> dict[str, Any]:
    """Rows on one and two ranks, run alternately, with all cores to choose from."""
    if len(session.cores) < RANKS:
        return {"error": f"{len(session.cores)} core to run on"}
    os.sched_setaffinity(0, session.cores)
    try:
        launcher = ("mpirun", "-n", str(RANKS))
        programs = [
            callers.incipient(session, "cylinder", "1 rank", SETTINGS),
            callers.incipient(session, "cylinder", f"{RANKS} ranks", SETTINGS, launcher),
        ]
        rows = session.compare(programs)
    finally:
        os.sched_setaffinity(0, session.cores[-1:])
    for row in rows:
        if "error" in row:
            return {"error": row["error"]}
    serial, parallel = ({name: row["coefficients"][name] for name in CYLINDER} for row in rows)
    return {"rows": rows, "differences": errors(parallel, serial)}


def describe(data: dict[str, Any]) -> str:
    """The section of the page."""
    head = "### Two ranks against one"
    if "error" in data:
        return f"{head}\n\nCould not be run: {data['error']}."
    cells = [
        f"{r['name']} {seconds(r['wall'])} s of wall and {seconds(r['cpu'])} s of CPU time"
        for r in data["rows"]
    ]
    drag, lift = (small(value) for value in data["differences"].values())
    size = data["rows"][0]["unknowns"]
    return f"""{head}

`mpirun -n {RANKS} incipient run demos/scenes/cylinder.toml --set numerics.mesh_size=0.35` ({size} unknowns):
{", ".join(cells)}. Relative difference: {drag} in C_D, {lift} in C_L."""

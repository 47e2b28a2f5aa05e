"""Outlines and scans of very many vertices: processor time until a scene is planned, and until a grain lies."""

from __future__ import annotations

from statistics import median
from typing import Any

import callers
from measure import Session
from tables import table

VERTICES, FREQUENCY = 10_000, 40
WORK = {
    "lowered": f"an outline of {VERTICES} vertices lowered onto a bed and planned",
    "settled": "the same outline settled on the bed and planned",
    "scanned": f"a scanned pebble of {20 * FREQUENCY**2} triangles laid on a plane",
}


def measure(session: Session) -> dict[str, Any]:
    """Processor seconds of each round."""
    program = callers.script(
        "outlines", "benchmarks/programs/outline_times.py", VERTICES, FREQUENCY
    )
    rounds = []
    for turn in range(session.repeat):
        row = session.once(program)
        if "error" in row:
            return {"error": row["error"]}
        rounds.append(row["seconds"])
        session.say(f"round {turn + 1} of {session.repeat}: {rounds[-1]} s")
    return {
        "rounds": rounds,
        "seconds": {name: median(one[name] for one in rounds) for name in WORK},
    }


def describe(data: dict[str, Any]) -> str:
    """The section of the page."""
    head = "### Outlines of many vertices"
    if "error" in data:
        return f"{head}\n\nCould not run here: `{data['error']}`."
    rows = [
        [
            WORK[name],
            f"{data['seconds'][name]:.2f}",
            ", ".join(f"{one[name]:.2f}" for one in data["rounds"]),
        ]
        for name in WORK
    ]
    return f"{head}\n\n{table(['', 'processor time [s]', 'of each round'], rows)}\n"

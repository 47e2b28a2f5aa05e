"""Both questions of the exact judge to random grains on four contacts in space: CPU time of an answer."""

from __future__ import annotations

from statistics import median
from typing import Any

import callers
from measure import Session

CASES = 3000
WORK = {"safety_factors": "safety factors", "incipient_motions": "incipient motions"}


def measure(session: Session) -> dict[str, Any]:
    """Milliseconds of each round, and their median."""
    program = callers.script("random grains", "contact_throughput", CASES)
    rounds = []
    for _ in range(session.repeat):
        row = session.once(program)
        if "error" in row:
            return {"error": row["error"]}
        rounds.append({name: round(value, 4) for name, value in row["milliseconds"].items()})
    times = {name: median(each[name] for each in rounds) for name in WORK}
    return {"cases": CASES, "contacts": 4, "rounds": rounds, "milliseconds": times}


def describe(data: dict[str, Any]) -> str:
    """The section of the page."""
    head = "### Contact: the exact criterion"
    if "error" in data:
        return f"{head}\n\nCould not run here: `{data['error']}`."
    times = ", ".join(f"{WORK[name]} {data['milliseconds'][name]:.2f} ms" for name in WORK)
    return f"""{head}

CPU time for each of {data["cases"]} random grains (`tests/random_contacts.py`): {times}.
"""

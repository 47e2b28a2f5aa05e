"""Both questions of the exact judge to random grains on four contacts in space: answers a second on one core."""

from __future__ import annotations

from statistics import median
from typing import Any

import callers
from measure import Session
from tables import table

CASES = 3000
GOALS = {"safety_factors": 2000, "incipient_motions": 1000}  # a second
WORK = {"safety_factors": "safety factors", "incipient_motions": "incipient motions"}


def measure(session: Session) -> dict[str, Any]:
    """Milliseconds of each round, and answers a second by their median."""
    program = callers.script("random grains", "benchmarks/programs/contact_throughput.py", CASES)
    rounds = []
    for turn in range(session.repeat):
        row = session.once(program)
        if "error" in row:
            return {"error": row["error"]}
        rounds.append({name: round(value, 4) for name, value in row["milliseconds"].items()})
        session.say(f"round {turn + 1} of {session.repeat}: {rounds[-1]} ms")
    times = {name: median(one[name] for one in rounds) for name in GOALS}
    rates = {name: round(1e3 / value, 1) for name, value in times.items()}
    return {"cases": CASES, "contacts": 4, "rounds": rounds, "milliseconds": times, "rates": rates}


def describe(data: dict[str, Any]) -> str:
    """The section of the page."""
    head = "## Contact: the exact judge"
    if "error" in data:
        return f"{head}\n\nCould not run here: `{data['error']}`."
    rows = [
        [
            WORK[name],
            f"{data['milliseconds'][name]:.2f}",
            f"{data['rates'][name]:.0f}",
            f"{GOALS[name]}",
        ]
        for name in GOALS
    ]
    heads = ["", "processor time each [ms]", "a second", "goal"]
    return f"""{head}

{data["cases"]} random grains on {data["contacts"]} contacts in space, one after the other on one core: spheres,
irregular grains and contacts anywhere (`tests/stability/random_contacts.py`). A motion includes the search for other
motions that the laws allow, more than two fifths of its time, and the smallest contact forces of each.

{table(heads, rows)}
"""

"""Safety factors and incipient motions a second, on random grains with four contacts in space.

Usage: contact_throughput.py CASES. One process, processor time, cases made beforehand: those of
tests/random_contacts.py that have four contacts, all three kinds of grains.
"""

from __future__ import annotations

import itertools
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

from random_contacts import Case, random_case

from incipient.contact import incipient_motion, safety_factor

CONTACTS, FIRST, WARM_UP = 4, 5_000_000, 50


def main() -> None:
    """Print one line of JSON."""
    cases = _cases(int(sys.argv[1]))
    questions: dict[str, Callable[[Case], Any]] = {
        "safety_factors": lambda case: safety_factor(case.load, case.contacts, case.friction),
        "incipient_motions": lambda case: incipient_motion(
            case.load, case.contacts, case.friction, case.mass, case.inertia
        ),
    }
    times = {name: _milliseconds(ask, cases) for name, ask in questions.items()}
    print(json.dumps({"cases": len(cases), "contacts": CONTACTS, "milliseconds": times}))


def _cases(count: int) -> list[Case]:
    cases = map(random_case, itertools.count(FIRST))
    return list(itertools.islice((c for c in cases if len(c.contacts) == CONTACTS), count))


def _milliseconds(ask: Callable[[Case], Any], cases: list[Case]) -> float:
    for case in cases[:WARM_UP]:
        ask(case)
    began = time.process_time()
    for case in cases:
        ask(case)
    return 1e3 * (time.process_time() - began) / len(cases)


main()

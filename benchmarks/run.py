"""Measure incipient beside other programs; write benchmarks/results.json and docs/validation/performance.md.

Run: .venv/bin/python benchmarks/run.py [--only NAME ...] [--repeat N] [--report]
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import callers
import cases
import machine
import report
from measure import Session, say
from tables import read_json, write_json

RESULTS = Path(__file__).parent / "results.json"


def main() -> None:
    """Measure what is asked for, keep what was measured before of the rest, write both files."""
    parser = argparse.ArgumentParser(description="Measure incipient beside other programs.")
    parser.add_argument(
        "--only", action="append", choices=list(cases.ALL), help="only this part (repeatable)"
    )
    parser.add_argument("--repeat", type=int, default=3, help="measured rounds (default 3)")
    parser.add_argument(
        "--report", action="store_true", help="write the page again from what was measured"
    )
    options = parser.parse_args()
    results = read_json(RESULTS, {"schema_version": 1, "sessions": {}, "cases": {}})
    if not options.report:
        with tempfile.TemporaryDirectory(prefix="incipient-bench-") as scratch:
            cores = tuple(sorted(os.sched_getaffinity(0)))
            measure(options.only or cases.ALL, Session(options.repeat, scratch, cores), results)
    report.write(results)


def measure(names: Iterable[str], session: Session, results: dict[str, Any]) -> None:
    """Measure parts, each on the last core, and store them after each, so that an interruption loses only one."""
    os.sched_setaffinity(0, session.cores[-1:])
    results |= {"machine": machine.describe(), "versions": machine.versions()}
    if version := callers.ngsolve_version():
        results["versions"]["ngsolve"] = version
    for name in names:
        say(f"--- {name}")
        # Processes that wanted to run over the last minute: more than a few tenths spoil the times.
        began, load = time.perf_counter(), round(os.getloadavg()[0], 2)
        results["cases"][name] = cases.ALL[name].measure(session)
        results["sessions"][name] = {
            "load_before": load,
            "seconds": round(time.perf_counter() - began),
            "repeat": session.repeat,
        }
        write_json(RESULTS, results)


if __name__ == "__main__":
    main()

"""Measure incipient beside other programs; write benchmarks/results.json and docs/validation/performance.md.

Run: .venv/bin/python benchmarks/run.py [--only NAME ...] [--repeat N] [--report]
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import callers
import cases
import machine
import report
from measure import Session, on_cores

RESULTS = Path(__file__).parent / "results.json"
SCHEMA_VERSION = 1


def main() -> int:
    """Measure what is asked for, keep what was measured before of the rest, write both files."""
    options = _options()
    results = _stored()
    if not options.report:
        with tempfile.TemporaryDirectory(prefix="incipient-bench-") as scratch:
            _measure(
                options.only or list(cases.ALL), Session(options.repeat, Path(scratch)), results
            )
    report.write(results)
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Measure incipient beside other programs.")
    parser.add_argument(
        "--only", action="append", choices=list(cases.ALL), help="only this part (repeatable)"
    )
    parser.add_argument("--repeat", type=int, default=3, help="measured rounds (default 3)")
    parser.add_argument(
        "--report", action="store_true", help="write the page again from what was measured"
    )
    return parser.parse_args()


def _measure(names: list[str], session: Session, results: dict[str, Any]) -> None:
    on_cores(session.cores[-1:])
    results |= {"machine": machine.describe(), "versions": machine.versions()}
    if version := callers.prepare_ngsolve(session):
        results["versions"]["ngsolve"] = version
    for name in names:
        began, load = time.perf_counter(), machine.load()
        session.say(f"--- {name}")
        results["cases"][name] = cases.ALL[name].measure(session)
        seconds = round(time.perf_counter() - began)
        results["sessions"][name] = {
            "load_before": load,
            "seconds": seconds,
            "repeat": session.repeat,
        }
        # After each part, so that an interruption loses no more than the part under way.
        _store(results)


def _stored() -> dict[str, Any]:
    if RESULTS.exists():
        return json.loads(RESULTS.read_text())
    return {
        "schema_version": SCHEMA_VERSION,
        "machine": {},
        "versions": {},
        "sessions": {},
        "cases": {},
    }


def _store(results: dict[str, Any]) -> None:
    kept = {
        **results,
        "cases": {name: _without_paths(data) for name, data in results["cases"].items()},
    }
    RESULTS.write_text(json.dumps(kept, indent=1) + "\n")


def _without_paths(data: Any) -> Any:
    """The data without the directories that the programs wrote to."""
    if isinstance(data, dict):
        return {key: _without_paths(value) for key, value in data.items() if key != "directory"}
    return [_without_paths(item) for item in data] if isinstance(data, list) else data


if __name__ == "__main__":
    sys.exit(main())

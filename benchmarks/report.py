"""The page docs/performance.md, written from results.json."""

from __future__ import annotations

from typing import Any

import cases
import goals
from measure import ROOT

PAGE = ROOT / "docs" / "performance.md"

HEAD = """# Speed and accuracy

Written by `make bench` from `benchmarks/results.json`; do not edit by hand. One part of it: `.venv/bin/python
benchmarks/run.py --only cylinder` (also {names}); `--repeat N` measures N rounds; `--report` writes this page
again without measuring.

**How it is measured.** Whole processes, from start to exit, imports, meshing and written files included; forms
compiled by a round of warm-up. One core (the process is bound to it; one thread). Programs that are compared run
alternately, round by round, and what stands in the tables is the median of the rounds. *Wall* is the time on the
clock, *processor* the user and system time of the process, *memory* its peak resident size. Where another process
wanted the core, wall exceeds processor.

**On what.** {processor}, {cores} cores, {memory_gib} GiB, {system}; {versions}.
{load}

The other programs are small scripts of ours, in `benchmarks/programs/`, as a user who knows the library would write
them: *plain dolfinx* assembles and factorises afresh in every Newton iteration; *NGSolve* (from PyPI, in an
environment of its own) uses static condensation and the fastest direct solver to be had with it. They are not the
best that can be done with those libraries. None of them estimates its error, so
*incipient* is run without its error bars beside them, as the scene of the vortex street has it; on the grain on a bed
it has them.
"""


def write(results: dict[str, Any]) -> None:
    """Write the page."""
    measured = results["cases"]
    parts = [_head(results), "## Goals\n\n" + goals.summary(measured)]
    parts += [case.describe(measured[name]).strip() for name, case in cases.ALL.items() if name in measured]
    parts.append(_shortcomings(measured))
    PAGE.parent.mkdir(exist_ok=True)
    PAGE.write_text("\n\n".join(part.strip() for part in parts) + "\n")


def _head(results: dict[str, Any]) -> str:
    names = ", ".join(f"`{name}`" for name in cases.ALL if name != "cylinder")
    versions = ", ".join(f"{name} {version}" for name, version in results["versions"].items())
    loads = [part["load_before"] for part in results["sessions"].values()]
    load = f"Load of the machine before the parts began: {min(loads):g} to {max(loads):g}."
    return HEAD.format(names=names, versions=versions, load=load, **results["machine"])


def _shortcomings(measured: dict[str, Any]) -> str:
    items = goals.shortcomings(measured) or ["Nothing of what is measured here."]
    return "## What falls short\n\n" + "\n".join(f"- {item}" for item in items)

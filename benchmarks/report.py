"""The page docs/performance.md, written from results.json."""

from __future__ import annotations

from typing import Any

import cases
import goals
from measure import ROOT

PAGE = ROOT / "docs" / "performance.md"

HEAD = """# Speed and accuracy

How fast and how accurate the program is on published benchmarks, beside scripts for other programs
(`benchmarks/programs/`). What accuracy costs on scenes of all kinds: [cost.md](cost.md).

```sh
make bench                                         # measures all, writes this page: do not edit it by hand
.venv/bin/python benchmarks/run.py --only cylinder # one part; --repeat N: N rounds; --report: the page alone
```

Other parts: {names}. All runs: `benchmarks/results.json`.

**Method.** Whole processes on one core, with imports, meshing and files; forms are compiled before. Programs run
alternately; tables have the median of the rounds. *Processor* is user and system time, *memory* peak resident size.
*Plain dolfinx* assembles and factorises in every Newton iteration, *NGSolve* (from PyPI) uses static condensation and
its fastest direct solver. None estimates its error, so *incipient* has no error bars here.

**Machine.** {processor}, {cores} cores, {memory_gib} GiB, {system}; {versions}.
"""


def write(results: dict[str, Any]) -> None:
    """Write the page."""
    measured = results["cases"]
    parts = [_head(results), "## Goals\n\n" + goals.summary(measured)]
    parts += [
        case.describe(measured[name]).strip()
        for name, case in cases.ALL.items()
        if name in measured
    ]
    parts.append(_shortcomings(measured))
    PAGE.parent.mkdir(exist_ok=True)
    PAGE.write_text("\n\n".join(part.strip() for part in parts) + "\n")


def _head(results: dict[str, Any]) -> str:
    names = ", ".join(f"`{name}`" for name in cases.ALL if name != "cylinder")
    versions = ", ".join(f"{name} {version}" for name, version in results["versions"].items())
    return HEAD.format(names=names, versions=versions, **results["machine"])


def _shortcomings(measured: dict[str, Any]) -> str:
    items = goals.shortcomings(measured) or ["Nothing else."]
    return "## Shortcomings beside missed goals\n\n" + "\n".join(f"- {item}" for item in items)

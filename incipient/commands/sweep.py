"""`incipient sweep` and `incipient table`."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Set
from pathlib import Path
from shlex import quote

from ..errors import ConvergenceError
from ..files import csv_text
from ..parallel import Comm
from ..progress import telling
from ..scene import Scene
from ..scene.section import is_number, unit_of
from ..sweep import table as tables
from ..sweep.procedure import SweepProgress, run
from ..sweep.store import DONE, FAILED, Store
from ..sweep.table import HEADS, size_classes

# Options with the names of arguments of `sweep.run`.
SHARED = (
    *("do", "zip", "cases", "jobs", "wall", "retry", "refine", "most", "quantity"),
    *("scheduler", "tries", "limit", "dry_run"),
)
WIDE = 160  # width of a table without a terminal, in characters
FIRST = 300  # number of cases printed


def sweep(options: argparse.Namespace, comm: Comm) -> int:
    """Compute the missing cases of the file, and print a summary."""
    with telling(comm.rank) as voice:
        progress = run(
            options.scenes,
            options.out,
            options.over,
            settings=options.overrides,
            memory_mib=options.memory,
            voice=voice,
            **{name: getattr(options, name) for name in SHARED},
        )
    if options.dry_run:
        left = progress.total - progress.known
        counts = f"{progress.known} already in {progress.file}, {left} to compute"
        print(f"cases               {progress.total}: {counts}")
    else:
        _tell(progress)
    return ConvergenceError.exit_code if progress.failed else 0


def _tell(progress: SweepProgress) -> None:
    failed = f", {progress.failed} failed (repeat them with --retry)" if progress.failed else ""
    done = f"{progress.done} computed{failed}, {progress.known} computed before"
    print(f"cases               {progress.total}: {done}")
    print("".join(f"{line}\n" for line in progress.refined), end="")
    print(f"numbers             {progress.file}; incipient table {quote(str(progress.file))}")
    print(f"pictures            incipient show {quote(str(progress.file))}", flush=True)


def table(options: argparse.Namespace) -> None:
    """Print the cases of a sweep, one per row."""
    if options.size_classes is not None:
        classes = size_classes(options.file, options.size_classes, options.size)
        print(csv_text(HEADS, classes), end="", flush=True)
    elif options.csv:
        rows = tables.rows(options.file)
        print(csv_text(tables.columns(rows), rows), end="", flush=True)
    else:
        _print(options.file)


def _print(file: Path) -> None:
    from rich.console import Console
    from rich.table import Table

    with Store(file) as store:
        keys = store.keys()
    rows = tables.rows(file)
    first = rows[:FIRST]
    heads = [name for name in tables.columns(first) if name in keys or name == "source"]
    if len({row["source"] for row in first}) == 1:
        heads.remove("source")
    shown = Table(box=None)
    for head in heads:
        unit = _unit(head, {row["task"] for row in first})
        numbers = all(is_number(row[head]) for row in first if row.get(head) is not None)
        shown.add_column(f"{head}{unit}", overflow="fold", justify="right" if numbers else "left")
    shown.add_column("status", overflow="fold")
    shown.add_column("", overflow="fold")
    shown.add_column("time [s]", overflow="fold", justify="right")
    for row in first:
        words = tables.in_words(row) if row["status"] in (DONE, FAILED) else ""
        time = "" if row["wall"] is None else f"{row['wall']:.1f}"
        shown.add_row(*(_cell(row.get(head)) for head in heads), row["status"], words, time)
    Console(width=None if sys.stdout.isatty() else WIDE, markup=False, emoji=False).print(shown)
    if len(rows) > FIRST:
        counts = ", ".join(
            f"{n} {status}" for status, n in Counter(row["status"] for row in rows).items()
        )
        print(f"{len(rows)} cases: {counts}; the first {FIRST} are shown, --csv has all")


def _unit(key: str, tasks: Set[str]) -> str:
    from ..judging.case import Case

    unit = unit_of(Case if tasks == {"judge"} else Scene, key)
    return f" [{unit}]" if unit else ""


def _cell(value: object) -> str:
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)

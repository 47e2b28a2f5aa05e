"""`incipient table`: the cases of a sweep, a row each."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Set
from pathlib import Path

from ..files import csv_text
from ..parallel import Comm, collectively
from ..scene import Scene
from ..scene.key_units import unit_of
from ..sweep import table as tables
from ..sweep.size_classes import HEADS, size_classes
from ..sweep.store import Store

WIDE = 160  # columns of a table that goes to a file
FIRST = 300  # cases of a large sweep that are printed


def table(options: argparse.Namespace, comm: Comm) -> int:
    """Print or write the cases of a sweep, a row each."""
    with collectively(comm):
        if comm.rank == 0 and options.parquet is not None:
            tables.write_parquet(options.file, options.parquet)
            print(options.parquet)
        elif comm.rank == 0 and options.size_classes is not None:
            classes = size_classes(options.file, options.size_classes, options.size)
            print(csv_text(HEADS, classes), end="", flush=True)
        elif comm.rank == 0 and options.csv:
            tables.write_csv(options.file, sys.stdout)
        elif comm.rank == 0:
            _print(options.file)
    return 0


def _print(file: Path) -> None:
    """The columns that differ between cases, and those of results, for a reader."""
    from rich.console import Console
    from rich.table import Table

    with Store(file) as store:
        keys, is_large = store.keys(), store.is_large
        counts = store.counts() if is_large else {}
    found = tables.rows(file, FIRST if is_large else None)
    heads = [name for name in tables.columns(found) if name in keys or name == "source"]
    if len({row["source"] for row in found}) == 1:
        heads.remove("source")
    shown = Table(box=None)
    for head in heads:
        unit = _unit(head, {row["task"] for row in found})
        numbers = all(_is_number(row[head]) for row in found if row.get(head) is not None)
        shown.add_column(f"{head}{unit}", overflow="fold", justify="right" if numbers else "left")
    shown.add_column("status", overflow="fold")
    shown.add_column("", overflow="fold")
    shown.add_column("time [s]", overflow="fold", justify="right")
    for row in found:
        said = tables.in_words(row) if row["status"] in ("done", "failed", "damaged") else ""
        time = "" if row["wall"] is None else f"{row['wall']:.1f}"
        shown.add_row(*(_cell(row.get(head)) for head in heads), row["status"], said, time)
    Console(width=None if sys.stdout.isatty() else WIDE, markup=False, emoji=False).print(shown)
    if is_large:
        counted = ", ".join(f"{number} {status}" for status, number in counts.items())
        print(
            f"{sum(counts.values())} cases: {counted}; the first {len(found)} are shown, --csv or --parquet has all"
        )


def _unit(key: str, tasks: Set[str]) -> str:
    """The unit of a key in brackets, after a space; nothing where it has none."""
    from ..simulation.judge_case import Case

    unit = unit_of(Case if tasks == {"judge"} else Scene, key)
    return f" [{unit}]" if unit else ""


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _cell(value: object) -> str:
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)

"""The runs of a study in its file cost.csv, a row each, appended when a run is over."""

from __future__ import annotations

import csv
import os
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from ..errors import OutputError
from ..files import append_row, csv_text, reported, write_text_atomically
from ..input_files import reading
from .measurement import Counts, MeasuredRun, Variant

Key = tuple[int, str, str, str]

TABLE = "cost.csv"
SOLVER, AFTER = "solver", "step"  # a column that files of earlier versions lack, and that before it


def append(columns: Sequence[str], run: MeasuredRun, directory: Path) -> None:
    """Add a run to the file in a directory. Not collective. Raises OutputError: it cannot be written."""
    append_row(directory / TABLE, row_of(columns, run))


def row_of(columns: Sequence[str], run: MeasuredRun) -> dict[str, float | int | str]:
    """A run as a row, with its numbers in `columns`; what a failed run lacks is empty."""
    good, (order, mesh_size, step, solver) = not run.failed, run.variant.key
    row: dict[str, float | int | str] = {
        "order": order,
        "mesh_size": mesh_size,
        AFTER: step,
        SOLVER: solver,
        "failed": run.failed,
        "wall [s]": round(run.wall, 3),
        "processor [s]": round(run.cpu, 3),
        "start [s]": round(run.start, 3) if good else "",
        "memory [MiB]": round(run.peak_mib, 1) if good else "",
        "cells": run.cells if good else "",
        "unknowns": run.unknowns if good else "",
    }
    row |= {name: count if good else "" for name, count in vars(run.counts).items()}
    return row | {name: repr(run.found[name]) if good else "" for name in columns}


def known_runs(columns: Sequence[str], directory: Path) -> dict[Key, MeasuredRun]:
    """The runs in the file of a directory, by the keys of their variants. Not collective; raises OutputError.

    Half a row at its end, of a writer that was killed, is cut off. In a file of an earlier version all runs were
    solved as the scene says.
    """
    path = directory / TABLE
    if not path.exists():
        return {}
    with reported(path), reading(path, "delete it to begin anew", error=OutputError):
        text = path.read_bytes()
        whole = text.rfind(b"\n") + 1
        if whole < len(text):
            os.truncate(path, whole)
    with reading(path, "delete it to begin anew", error=OutputError):
        rows = csv.DictReader(text[:whole].decode().splitlines())
        runs = [_run_of(columns, row) for row in rows]
    return {run.variant.key: run for run in runs}


def _run_of(columns: Sequence[str], row: Mapping[str, str]) -> MeasuredRun:
    step = float(row[AFTER]) if row[AFTER] else None
    variant = Variant(int(row["order"]), float(row["mesh_size"]), step, row.get(SOLVER, ""))
    spent = float(row["wall [s]"]), float(row["processor [s]"])
    if row["failed"]:
        return MeasuredRun(variant, *spent, failed=row["failed"])
    return MeasuredRun(
        variant,
        *spent,
        start=float(row["start [s]"]),
        peak_mib=float(row["memory [MiB]"]),
        cells=int(row["cells"]),
        unknowns=int(row["unknowns"]),
        counts=Counts.of(row),
        found={name: float(row[name]) for name in columns},
    )


def completed(directory: Path, compared: Collection[Variant]) -> bool:
    """Add the column that a file of an earlier version lacks; whether it was one. Not collective; raises OutputError.

    It loses the runs `compared` with others that are still to be made: times of another day would not do. Read it
    with `known_runs` before, which tells whether it is damaged.
    """
    path = directory / TABLE
    table = csv.DictReader(path.read_text(encoding="utf-8").splitlines() if path.exists() else [])
    heads = list(table.fieldnames or ())
    if AFTER not in heads or SOLVER in heads:
        return False
    old = {tuple(map(str, variant.key[:-1])) for variant in compared}
    rows = [row for row in table if (row["order"], row["mesh_size"], row[AFTER]) not in old]
    at = heads.index(AFTER) + 1
    write_text_atomically(path, csv_text([*heads[:at], SOLVER, *heads[at:]], rows))
    return True

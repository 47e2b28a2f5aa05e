"""The cases of a sweep as a table: varied keys, quantities with their error bars, cost."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import MissingError
from ..files import csv_text, part_of, replaced, require_ending
from ..parquet import pyarrow
from ..results.quantity import HIGH, at
from .store import COST, FAILED, Store

if TYPE_CHECKING:
    import pandas

LAST = ("reason", *COST, "versions", "id")


def rows(path: Path | str) -> list[dict[str, Any]]:
    """One dictionary a case, in the order in which cases came; columns as in docs/howto/sweeps.md. Not collective.

    A number that a case does not have is missing, an infinite one is infinite.

    Raises:
        OutputError: the file is not there, damaged, or not that of a sweep.
    """
    with Store(Path(path)) as store:
        keys = store.keys()
        return [_row(case, keys) for case in store.cases()]


def _row(case: Mapping[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    varied = {key: value for key in keys if (value := at(case["scene"], key)) is not None}
    texts = {
        key: value if isinstance(value, str | int | float) else json.dumps(value)
        for key, value in varied.items()
    }
    versions = " ".join(f"{name} {number}" for name, number in case["versions"].items())
    first = {name: case[name] for name in ("source", "task", "status")}
    last = {name: case[name] for name in LAST} | {"versions": versions}
    return first | texts | case["columns"] | last


def frame(path: Path | str) -> pandas.DataFrame:
    """Table of a sweep as a frame of pandas, with the columns of `rows`. Not collective.

    Raises:
        MissingError: pandas is not installed.
        OutputError: as `rows`.
    """
    try:
        import pandas
    except ImportError as error:
        raise MissingError(
            f"pandas cannot be used ({error}): pip install 'incipient[tables]'"
        ) from None
    table = rows(path)
    return pandas.DataFrame(table, columns=columns(table))


def columns(table: Sequence[Mapping[str, Any]]) -> list[str]:
    """All columns of the rows, in their order."""
    names = list(dict.fromkeys(name for row in table for name in row))
    return [name for name in names if name not in LAST] + [name for name in LAST if name in names]


def as_csv(table: Sequence[Mapping[str, Any]]) -> str:
    """Rows as the text of a CSV file; missing values are empty."""
    return csv_text(columns(table), table)


def write_parquet(source: Path, target: Path) -> None:
    """Write the table as a Parquet file; raises MissingError without pandas or pyarrow, and OutputError."""
    pyarrow("tables")
    require_ending(target, ".parquet")
    table = frame(source)
    with replaced(target, part_of(target)) as part:
        table.to_parquet(part)


def in_words(row: Mapping[str, Any]) -> str:
    """Outcome of a case in a few words, by its row."""
    if row["status"] == FAILED:
        return str(row["reason"])
    if row["task"] == "threshold":
        bar = row.get(f"shields{HIGH}")
        error = "" if bar is None else f" +- {bar - row['shields']:.1g}"
        return f"{row['mode']} at Shields number {row['shields']:.4g}{error}"
    if row["task"] == "entrainment":
        return f"probability of motion {row['probability']:.3g}, steady Shields number {row['shields']:.4g}"
    if row["task"] == "gust":
        return f"critical strength {row['strength']:.4g}"
    return _run_in_words(row)


def _run_in_words(row: Mapping[str, Any]) -> str:
    if "left_pocket" in row:
        return f"left its pocket at t = {row['left_pocket']:.4g}"
    words = "no verdict"
    if "mode" in row:
        words = f"{row['mode']}, safety factor {row['safety_factor']:.4g}"
    if "does" in row:
        words = f"{row['does']} at the end, {words}"
    if "friction" not in row:
        return words
    words = words if "mode" in row else f"C_f {row['friction']:.5g}"
    return words + (", NOT CONVERGED" if row.get("load_spread") else "")

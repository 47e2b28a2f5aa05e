"""The cases of a sweep as a table: what was varied, what came out with its error bars, what it took."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from ..errors import MissingError
from ..files import csv_text, part_of, replaced, require_ending
from ..results.quantity import HIGH
from ..tables.parquet import pyarrow
from .quantities import found as of_case
from .quantities import quantities
from .store import DAMAGED, DONE, FAILED, CaseOutcome, Store, damaged

if TYPE_CHECKING:
    import pandas


FIRST = ("source", "task", "status")
LAST = ("reason", "wall", "cpu", "peak_mib", "tries", "finished", "versions", "id")


def rows(path: Path | str, most: int | None = None) -> list[dict[str, Any]]:
    """One dictionary a case, in the order in which cases came; columns as in docs/sweeps.md. Not collective.

    A number that a case does not have is missing, an infinite one is infinite. A case that was changed after it was
    written has the status "damaged" and no numbers. With more than `LARGE` cases this is not looked at, unless no more
    than `most` of them, the first, are wanted.

    Raises:
        OutputError: the file is not there, damaged, or not that of a sweep.
    """
    with Store(Path(path)) as store:
        keys = store.keys()
        if most is None and store.is_large:
            return [_with_versions(row) for row in store.shown()]
        return [_believed(stored, keys) for stored in store.rows(most)]


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
    found = rows(path)
    return pandas.DataFrame(found, columns=columns(found))


def columns(found: Sequence[Mapping[str, Any]]) -> list[str]:
    """The columns that any of the rows has, in their order."""
    names: dict[str, None] = {}
    for row in found:
        names |= dict.fromkeys(row)
    return [name for name in names if name not in LAST] + [name for name in LAST if name in names]


def as_csv(found: Sequence[Mapping[str, Any]]) -> str:
    """Rows as the text of a CSV file; what is not known is empty."""
    return csv_text(columns(found), found)


def write_csv(path: Path, stream: TextIO) -> None:
    """Write the table of a sweep as CSV; that of a large one as it is read. Raises OutputError as `rows`."""
    with Store(path) as store:
        if store.is_large:
            names = columns([dict.fromkeys([*FIRST, *store.columns_shown(), *LAST])])
            writer = csv.DictWriter(stream, names, restval="", lineterminator="\n")
            writer.writeheader()
            writer.writerows(map(_with_versions, store.shown()))
            return
    print(as_csv(rows(path)), file=stream, end="", flush=True)


def write_parquet(source: Path, target: Path) -> None:
    """Write the table as a Parquet file; raises MissingError without pandas or pyarrow, and OutputError."""
    pyarrow("tables")
    require_ending(target, ".parquet")
    made = frame(source)
    with replaced(target, part_of(target)) as part:
        made.to_parquet(part)


def _believed(stored: Mapping[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    """The row of a case; one that cannot be read is damaged, whatever its checksum."""
    try:
        return _row(stored, keys)
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return _row(damaged(stored), keys)


def _row(stored: Mapping[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    row: dict[str, Any] = {
        "source": stored["source"],
        "task": stored["task"],
        "status": stored["status"],
    }
    if stored["status"] != DAMAGED:
        row |= of_case(stored, keys)
    row |= {
        name: stored[name] for name in ("reason", "wall", "cpu", "peak_mib", "tries", "finished")
    }
    return _with_versions({**row, "versions": stored["versions"], "id": stored["id"]})


def _with_versions(row: dict[str, Any]) -> dict[str, Any]:
    """A row with its versions as text."""
    versions = json.loads(row["versions"] or "{}")
    row["versions"] = " ".join(f"{name} {number}" for name, number in versions.items())
    return row


def in_words(row: Mapping[str, Any]) -> str:
    """Outcome of a case in a few words, by its row."""
    if row["status"] in (FAILED, DAMAGED):
        return str(row["reason"])
    if row["task"] == "threshold":
        bar = row.get(f"shields{HIGH}")
        error = "" if bar is None else f" +- {bar - row['shields']:.1g}"
        return f"{row['mode']} at Shields number {row['shields']:.4g}{error}{_of_walls(row)}"
    if row["task"] == "entrainment":
        words = f"probability of motion {row['probability']:.3g}, steady Shields number {row['shields']:.4g}"
        return words + _of_walls(row)
    if row["task"] == "gust":
        return f"critical strength {row['strength']:.4g}"
    words = (
        f"{row['mode']}, safety factor {row['safety_factor']:.4g}"
        if "mode" in row
        else "no verdict"
    )
    if "left_pocket" in row:
        return f"left its pocket at t = {row['left_pocket']:.4g}"
    if "does" in row:
        words = f"{row['does']} at the end, {words}"
    if "friction" not in row:
        return words
    words = words if "mode" in row else f"C_f {row['friction']:.5g}"
    if row.get("load_spread"):
        words += ", NOT CONVERGED"
    return words + _of_walls(row)


def _of_walls(row: Mapping[str, Any]) -> str:
    """That walls were not as the model asks; nothing where they were, or it is not known."""
    applicable = row.get("applicable")
    return "" if applicable is None or applicable else ", walls NOT as the model asks"


def described(task: str, outcome: CaseOutcome) -> str:
    """Outcome of a case that has just been computed, in a few words."""
    row: dict[str, Any] = {"task": task, "status": FAILED, "reason": outcome.reason}
    if outcome.result is not None:
        row |= {"status": DONE, **quantities(task, outcome.result)}
    return in_words(row)

"""The cases of a sweep as a table: varied keys, quantities with their error bars, cost."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from math import degrees, dist
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scipy.spatial.transform import Rotation

from ..errors import MissingError
from ..files import csv_text, part_of, replaced, require_ending
from ..installed import pyarrow
from ..results.quantity import AXES, HIGH, at
from .store import COST, FAILED, Store

if TYPE_CHECKING:
    import pandas

# Move of the grain's surface over its size: in one pocket neither gravity nor flow moves a settled grain.
ELSEWHERE = 0.01
LAST = ("reason", *COST, "versions", "id")


def rows(path: Path | str) -> list[dict[str, Any]]:
    """One dictionary for each case, in order; columns as in docs/howto/sweeps.md.

    A number that a case does not have is missing, an infinite one is infinite.

    Raises:
        OutputError: the file is missing, damaged, or not that of a sweep.
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


def rests_elsewhere(path: Path | str) -> list[str]:
    """Name neighbouring cases, along each varied number, in which the grain rests on other points of the bed.

    Raises as `rows`.
    """
    with Store(Path(path)) as store:
        keys = store.keys()
    return pockets(rows(path), keys)


def pockets(table: Sequence[Mapping[str, Any]], keys: Sequence[str]) -> list[str]:
    """The lines of `rests_elsewhere` from the rows of a sweep over `keys`; those of [body] move the grain anyway."""
    kept = [row for row in table if "grain_size" in row]
    return [line for key in keys if not key.startswith("body.") for line in _moves(kept, key, keys)]


def _moves(table: Iterable[Mapping[str, Any]], key: str, keys: Sequence[str]) -> Iterator[str]:
    along = defaultdict[tuple[Any, ...], list[Mapping[str, Any]]](list)
    for row in table:
        if isinstance(row.get(key), int | float):
            along[tuple(row.get(other) for other in keys if other != key)].append(row)
    for cases in along.values():
        for one, other in pairwise(sorted(cases, key=itemgetter(key))):
            centre, angle = _apart(one, other)
            if centre + 0.5 * angle > ELSEWHERE:
                yield (
                    f"{key} = {one[key]:g} and {other[key]:g}: the grain rests on other points of the bed "
                    f"({centre:.2g} of its size apart, {degrees(angle):.2g} degrees turned); "
                    'body.settle = "level" keeps one pocket'
                )


def _apart(one: Mapping[str, Any], other: Mapping[str, Any]) -> tuple[float, float]:
    centres, turns = (
        [[row.get(f"{name}_{axis}", 0.0) for axis in AXES] for row in (one, other)]
        for name in ("centre", "rotation")
    )
    turned = Rotation.from_rotvec(turns[1]) * Rotation.from_rotvec(turns[0]).inv()
    in_plane = abs(one.get("rotation", 0.0) - other.get("rotation", 0.0))
    return dist(*centres) / one["grain_size"], in_plane + float(turned.magnitude())


def frame(path: Path | str) -> pandas.DataFrame:
    """The `rows` as a data frame of pandas. Raises MissingError without pandas, and as `rows`."""
    try:
        import pandas
    except ImportError as error:
        raise MissingError(
            f"pandas cannot be used ({error}): pip install 'incipient[tables]'"
        ) from None
    table = rows(path)
    return pandas.DataFrame(table, columns=columns(table))


def columns(table: Sequence[Mapping[str, Any]]) -> list[str]:
    """All columns of the rows, in order."""
    names = list(dict.fromkeys(name for row in table for name in row))
    return [name for name in names if name not in LAST] + [name for name in LAST if name in names]


def as_csv(table: Sequence[Mapping[str, Any]]) -> str:
    """Rows as CSV text; missing values are empty."""
    return csv_text(columns(table), table)


def write_parquet(source: Path, target: Path) -> None:
    """Write the table as a Parquet file. Raises MissingError without pandas or pyarrow, and OutputError."""
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

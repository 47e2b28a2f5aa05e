"""The cases of a sweep as a table: varied keys, quantities with their error bars, cost."""

from __future__ import annotations

import json
import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, pairwise
from math import degrees, dist
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from scipy.spatial.transform import Rotation

from ..arrays import known_percentiles, number, percentile
from ..errors import SceneError
from ..input_files import read_table
from ..installed import optional
from ..results.quantity import AXES, HIGH, at
from .store import COST, FAILED, Store

if TYPE_CHECKING:
    import pandas

LAST = ("reason", *COST, "versions", "id")
# Outcomes in words, by task.
SENTENCES = {
    "threshold": "{mode} at Shields number {shields:.4g}",
    "gust": "critical strength {strength:.4g}",
    "entrainment": "probability of motion {probability:.3g}, steady Shields number {shields:.4g}",
}
SHARES = (16, 50, 84)  # percentiles of a class
HEADS = (
    *("size_low", "size_high", "size_median", "grains", "without_threshold"),
    *(f"shields_{share}" for share in SHARES),
)
SIZES = ("diameter", "body.diameter")  # columns that are looked for where none is named


def rows(path: Path | str) -> list[dict[str, Any]]:
    """One dictionary for each case, in order; columns as in docs/howto/sweeps.md.

    A number that a case does not have is missing, an infinite one is infinite.

    Raises:
        SceneError: the file is missing, or not that of a sweep.
        OutputError: it is damaged.
    """
    with Store(Path(path)) as store:
        keys = store.keys()
        return [_row(case, keys) for case in store.cases()]


def _row(case: Mapping[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    # Of a file the complete scene has the content, and the setting the name.
    settings = dict(setting.split("=", 1) for setting in json.loads(case["settings"]))
    values = {key: at(case["scene"], key) for key in keys}
    values = {key: settings.get(key) if value is None else value for key, value in values.items()}
    texts = {
        key: value if isinstance(value, str | int | float) else json.dumps(value)
        for key, value in values.items()
        if value is not None
    }
    versions = " ".join(f"{name} {number}" for name, number in case["versions"].items())
    first = {name: case[name] for name in ("source", "task", "status")}
    last = {name: case[name] for name in LAST} | {"versions": versions}
    return first | texts | case["columns"] | last


def pockets(table: Sequence[Mapping[str, Any]], keys: Sequence[str]) -> list[str]:
    """Name once neighbouring cases, along each varied number, in which the grain rests on other points of the bed.

    table: rows of a sweep over `keys`, of which those of [body] move the grain anyway
    """
    kept = [row for row in table if "grain_size" in row]
    lines = (_moves(kept, key, keys) for key in keys if not key.startswith("body."))
    return list(dict.fromkeys(chain.from_iterable(lines)))  # the flow does not move a grain at rest


def _moves(table: Iterable[Mapping[str, Any]], key: str, keys: Sequence[str]) -> Iterator[str]:
    along = defaultdict[tuple[Any, ...], list[Mapping[str, Any]]](list)
    for row in table:
        if isinstance(row.get(key), int | float):
            scene = row.get("source"), *(row.get(other) for other in keys if other != key)
            along[scene].append(row)
    for cases in along.values():
        for first, second in pairwise(sorted(cases, key=itemgetter(key))):
            centre, angle = _apart(first, second)
            # The grain's surface moves by more than 1% of its size: in one pocket neither gravity nor flow does that.
            if centre + 0.5 * angle > 0.01:
                yield (
                    f"{key} = {first[key]:g} and {second[key]:g}: the grain rests on other points of the bed "
                    f"({centre:.2g} of its size apart, {degrees(angle):.2g} degrees turned); "
                    'body.settle = "level" keeps one pocket'
                )


def _apart(first: Mapping[str, Any], second: Mapping[str, Any]) -> tuple[float, float]:
    centres, turns = (
        [[row.get(f"{name}_{axis}", 0.0) for axis in AXES] for row in (first, second)]
        for name in ("centre", "rotation")
    )
    turned = Rotation.from_rotvec(turns[1]) * Rotation.from_rotvec(turns[0]).inv()
    in_plane = abs(first.get("rotation", 0.0) - second.get("rotation", 0.0))
    return dist(*centres) / first["grain_size"], in_plane + float(turned.magnitude())


def frame(path: Path | str) -> pandas.DataFrame:
    """The `rows` as a data frame of pandas. Raises MissingError without pandas, and as `rows`."""
    library = optional("pandas", "tables")
    table = rows(path)
    return cast("pandas.DataFrame", library.DataFrame(table, columns=columns(table)))


def columns(table: Sequence[Mapping[str, Any]]) -> list[str]:
    """All columns of the rows, in order."""
    names = list(dict.fromkeys(name for row in table for name in row))
    return [name for name in names if name not in LAST] + [name for name in LAST if name in names]


def in_words(row: Mapping[str, Any]) -> str:
    """Outcome of a case in a few words, by its row."""
    if row["status"] == FAILED:
        return str(row["reason"])
    if row["task"] in SENTENCES:
        error = row.get(f"shields{HIGH}", math.nan) - row.get("shields", math.nan)
        words = SENTENCES[row["task"]].format_map(row)
        return words if not math.isfinite(error) else f"{words} +- {error:.1g}"
    if "left_pocket" in row:
        return f"left its pocket at t = {row['left_pocket']:.4g}"
    words = f"C_f {row['friction']:.5g}" if "friction" in row else "no verdict"
    if "mode" in row:
        words = f"{row['mode']}, safety factor {row['safety_factor']:.4g}"
    if "would_move" in row and not row["moves"]:
        words = f"{words}, would have moved at t = {row['would_move']:.4g}"
    if "does" in row:
        words = f"{row['does']} at the end, {words}"
    return words + (", NOT CONVERGED" if row.get("load_spread") else "")


def size_classes(
    path: Path, bounds: Sequence[float], size: str | None = None
) -> list[dict[str, float]]:
    """Rows of classes [low, high) of sizes: numbers of grains and of those without a threshold, and percentiles.

    Percentiles of the critical Shields number count grains that no flow moves as infinite.

    Args:
        path: file of a sweep of thresholds, or a CSV with a column `shields`, such as grains.csv of a survey.
        bounds: n + 1 sizes, ascending, in the unit of the column.
        size: the column of sizes; default: diameter, or body.diameter.

    Raises:
        SceneError: bounds do not increase, a column is missing, or no grain is in a class.
        OutputError: the file of the sweep cannot be read.
    """
    if len(bounds) < 2 or not all(low < high for low, high in pairwise(bounds)):
        numbers = ", ".join(f"{bound:g}" for bound in bounds)
        raise SceneError(
            f"--size-classes: {numbers} do not increase; give two bounds or more, as in 1,2,4"
        )
    if path.suffix == ".csv":
        names, cells = read_table(path, "give grains.csv of a survey")
        listed: list[dict[str, Any]] = [dict(zip(names, row, strict=True)) for row in cells]
    else:
        listed = [row for row in rows(path) if row["status"] == "done"]
    named = next(
        (name for name in ([size] if size else SIZES) if any(name in row for row in listed)),
        None,
    )
    if named is None or not any("shields" in row for row in listed):
        lacks = "shields" if named is not None else size or " or ".join(SIZES)
        raise SceneError(
            f"{path}: has no column {lacks}; give a table of thresholds, and --size COLUMN"
        )
    # A grain that carries others has none, and is not free to move.
    grains = [(_number(row.get(named)), _number(row.get("shields"))) for row in listed]
    table = np.array([grain for grain in grains if not any(map(math.isnan, grain))]).reshape(-1, 2)
    classes = [_class(table, low, high) for low, high in pairwise(bounds)]
    if not any(row["grains"] for row in classes):
        raise SceneError(
            f"--size-classes: {path} has no threshold of a {named} from {bounds[0]:g} to {bounds[-1]:g}; "
            "give others, or compute thresholds"
        )
    return classes


def _class(table: Any, low: float, high: float) -> dict[str, float]:
    inside = table[(table[:, 0] >= low) & (table[:, 0] < high)]
    row = {"size_low": low, "size_high": high, "grains": len(inside)}
    row["without_threshold"] = int(np.isinf(inside[:, 1]).sum())
    if len(inside):
        row["size_median"] = float(np.median(inside[:, 0]))
        for share in known_percentiles(SHARES, len(inside)):
            row[f"shields_{share}"] = float(percentile(inside[:, 1], share))
    return row


def _number(value: Any) -> float:
    try:
        return number(value)
    except ValueError:
        return math.nan

"""Critical Shields numbers by size class, for programs of bed evolution, from a sweep or a table of grains."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import known_percentiles, number, percentile
from ..errors import SceneError
from ..input_files import read_table
from .table import rows

SHARES = (16, 50, 84)  # percentiles of a class
HEADS = (
    *("size_low", "size_high", "size_median", "grains", "without_threshold"),
    *(f"shields_{share}" for share in SHARES),
)
SIZES = ("diameter", "body.diameter")  # columns that are looked for where none is named


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
        listed = ", ".join(f"{bound:g}" for bound in bounds)
        raise SceneError(
            f"--size-classes: {listed} do not increase; give two bounds or more, as in 1,2,4"
        )
    table_rows = (
        _of_csv(path)
        if path.suffix == ".csv"
        else [row for row in rows(path) if row["status"] == "done"]
    )
    named = next(
        (name for name in ([size] if size else SIZES) if any(name in row for row in table_rows)),
        None,
    )
    if named is None or not any("shields" in row for row in table_rows):
        lacks = "shields" if named is not None else size or " or ".join(SIZES)
        raise SceneError(
            f"{path}: has no column {lacks}; give a table of thresholds, and --size COLUMN"
        )
    # A grain that carries others has none, and is not free to move.
    grains = [(_number(row.get(named)), _number(row.get("shields"))) for row in table_rows]
    table = np.array([grain for grain in grains if not any(map(math.isnan, grain))]).reshape(-1, 2)
    classes = [_class(table, low, high) for low, high in pairwise(bounds)]
    if not any(row["grains"] for row in classes):
        where = f"{named} from {bounds[0]:g} to {bounds[-1]:g}"
        raise SceneError(
            f"--size-classes: {path} has no threshold of a {where}; give others, or compute thresholds"
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


def _of_csv(path: Path) -> list[dict[str, Any]]:
    names, table = read_table(path, "give grains.csv of a survey")
    return [dict(zip(names, row, strict=True)) for row in table]


def _number(value: Any) -> float:
    try:
        return number(value)
    except ValueError:
        return math.nan

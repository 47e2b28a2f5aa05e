"""Tables of numbers: CSV files with a row of names, and Parquet files."""

from __future__ import annotations

import csv
from array import array
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..arrays import Floats, number, spatial
from ..errors import SceneError, shortened
from ..input_files import LARGEST_TABLE, reading, require_different
from ..installed import optional
from ..scene.messages import counted

NAME = "name"  # the only column of text
KINDS = (
    "give the name of a CSV file of numbers with a row of names, or of a Parquet file of numbers"
)


@dataclass(frozen=True, eq=False)
class Table:
    """The rows of a file.

    columns: numbers (n,) by name, NaN in empty cells; labels: (n,) cells of the column `name`, if any; faults: reasons
    for unreadable rows, by index
    """

    columns: dict[str, Floats]
    labels: list[str]
    faults: dict[int, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), ()))


def read_table(path: Path) -> Table:
    """Rows of a CSV file, or of a Parquet file (.parquet).

    Raises SceneError for an unreadable file, a repeated column, or a Parquet column not of numbers, and MissingError
    for a Parquet file without pyarrow.
    """
    return _parquet(path) if path.suffix == ".parquet" else _csv(path)


def _csv(path: Path) -> Table:
    flat, labels, faults = array("d"), list[str](), dict[int, str]()
    with (
        reading(path, KINDS, LARGEST_TABLE),
        path.open(encoding="utf-8-sig", errors="replace") as file,
    ):
        lines = filter(str.strip, file)
        # Each line by itself: a quote that nobody closes ends with it.
        names = [name.strip() for name in next(csv.reader([next(lines, "")]), [])]
        require_different(path, names)
        if len(names) == 1 and any(separator in names[0] for separator in ";\t"):
            raise SceneError(
                f'{path}: has one column, "{shortened(names[0], 30)}"; separate columns by commas'
            )
        label = names.index(NAME) if NAME in names else len(names)
        for place, line in enumerate(lines):
            cells = list[str]()
            try:
                cells = next(csv.reader([line]), [])
                flat.extend(_numbers(names, cells))
            except csv.Error as error:
                faults[place] = f"is not a line of CSV ({error}); shorten or correct it"
            except ValueError as error:
                faults[place] = str(error)
            if place in faults:
                flat.extend([np.nan] * len(names))
            if label < len(names):
                labels.append(cells[label] if label < len(cells) else "")
    table = np.array(flat).reshape(-1, len(names) or 1)
    columns = dict(zip(names, table.T, strict=False))
    columns.pop(NAME, None)
    return Table(columns, labels, faults)


def _numbers(names: Sequence[str], row: Sequence[str]) -> list[float]:
    if len(row) != len(names):
        raise ValueError(
            f"has {counted(len(row), 'cell')} for {len(names)} columns; give one for each"
        )
    numbers = []
    for name, cell in zip(names, row, strict=True):
        try:
            numbers.append(np.nan if name == NAME else number(cell))
        except ValueError:
            raise ValueError(f'{name} is "{shortened(cell, 30)}"; give a number') from None
    return numbers


def _parquet(path: Path) -> Table:
    arrow = optional("pyarrow.parquet", "parquet")
    kinds = arrow.types
    of_numbers = (kinds.is_integer, kinds.is_floating, kinds.is_decimal, kinds.is_null)
    columns, labels = dict[str, Floats](), list[str]()
    with reading(path, KINDS):
        file = arrow.parquet.ParquetFile(path).read()
        require_different(path, file.column_names)
        for name, column in zip(file.column_names, file.columns, strict=True):
            if name == NAME:
                cells = column.cast(arrow.string()).cast(arrow.binary()).to_pylist()
                labels = [(cell or b"").decode("utf-8", "replace") for cell in cells]
                continue
            # Times and truth values are not converted: their units are not known here.
            if not any(known(column.type) for known in of_numbers):
                raise SceneError(
                    f"{path}: column {shortened(name)} is of type {shortened(column.type)}; "
                    "save it as floating-point numbers"
                )
            columns[name] = np.asarray(column.cast(arrow.float64(), safe=False).to_numpy())
    return Table(columns, labels)


def names_of(quantity: str, gdim: int) -> list[str]:
    """Columns of a vector; in 2-D torque and inertia have one."""
    if gdim == 2 and quantity in ("couple", "inertia"):
        return [quantity]
    return [f"{quantity}_{axis}" for axis in "xyz"[:gdim]]


def vectors(columns: Mapping[str, Floats], quantity: str, gdim: int) -> Floats:
    """Vectors (n, 3) from their columns."""
    table = np.stack([columns[name] for name in names_of(quantity, gdim)], axis=1)
    return spatial(table) if table.shape[1] > 1 else np.pad(table, ((0, 0), (2, 0)))


def require_columns(
    kind: str, names: Collection[str], needed: Sequence[str], optional: Sequence[str], remedy: str
) -> None:
    """Raise SceneError for a table with missing or unknown columns."""
    for name in needed:
        if name not in names:
            raise SceneError(f"{kind}: there is no column {name}; {remedy.format(name=name)}")
    known = dict.fromkeys([*needed, *optional])
    unknown = next((name for name in names if name not in known), None)
    if unknown is not None:
        raise SceneError(
            f"{kind}: column {shortened(unknown)} is not known; known are {', '.join(known)}"
        )

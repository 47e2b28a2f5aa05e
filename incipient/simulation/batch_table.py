"""Tables of cases to be judged, one a row: CSV with a row of names, or Parquet, and what a row says.

Columns, in space with `_z` and a couple of three components: force_x, force_y, couple, weight_x, weight_y, centre_x,
centre_y, friction, contact_1_x, contact_1_y, normal_1_x, normal_1_y and so on for further contacts, empty where a row
has fewer; if wanted about_x, about_y (what the couple is about), mass and inertia (in space inertia_x, inertia_y,
inertia_z, and inertia_xy, inertia_xz, inertia_yz where the axes are not principal ones), and name.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Floats, decimal, number
from ..contact.batch import CHUNK, Cases
from ..errors import SceneError, shortened
from ..input_files import reading
from ..parquet import file_of_numbers
from .judge_case import ROUNDING

CONTACT = re.compile(r"(contact|normal)_([1-9][0-9]{0,2})_([xyz])")
LONGEST_CELL = 10_000  # letters
KINDS = "give the name of a CSV or Parquet file"
BOM = b"\xef\xbb\xbf"
Row = list[Any] | str  # its cells, text of CSV, values of Parquet; or why it cannot be read


@dataclass(frozen=True)
class Columns:
    """The columns of a table, and values that --set gives to all rows.

    Raises SceneError if some are missing, not known or there twice.
    """

    names: tuple[str, ...]
    constant: Mapping[str, float]

    def __post_init__(self) -> None:
        names = [*self.names, *self.constant]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise SceneError(
                f"batch: there are two columns {shortened(twice)}; leave one of them out"
            )
        for name in self.needed:
            if name not in names:
                raise SceneError(
                    f"batch: there is no column {name}; give it, or --set {name}=VALUE for all rows"
                )
        known = {*self.needed, *self._optional}
        unknown = next((name for name in names if name not in known), None)
        if unknown is not None:
            why = f"column {shortened(unknown)} is not known"
            raise SceneError(
                f"batch: {why}; known are {', '.join([*self.needed, *self._optional[:6]])}, ..."
            )

    @property
    def axes(self) -> str:
        """The letters of the directions."""
        return "xyz" if {"force_z", "contact_1_z"} & {*self.names, *self.constant} else "xy"

    @property
    def contacts(self) -> int:
        """The most contacts that a row can have."""
        found = (CONTACT.fullmatch(name) for name in (*self.names, *self.constant))
        return max((int(one[2]) for one in found if one), default=1)

    def vector(self, name: str) -> list[str]:
        """The columns of a vector."""
        return [f"{name}_{axis}" for axis in self.axes]

    @property
    def couple(self) -> list[str]:
        """The columns of the couple."""
        return ["couple"] if self.axes == "xy" else self.vector("couple")

    @property
    def inertia(self) -> list[str]:
        """The columns of the inertia that are needed where the mass is there."""
        return ["inertia"] if self.axes == "xy" else self.vector("inertia")

    @property
    def numbers(self) -> list[str]:
        """Columns that no row may leave empty."""
        load = [one for name in ("force", "weight", "centre") for one in self.vector(name)]
        return [*load, *self.couple, "friction"]

    @property
    def needed(self) -> list[str]:
        """Columns that have to be there."""
        contacts = [
            f"{kind}_{number + 1}"
            for number in range(self.contacts)
            for kind in ("contact", "normal")
        ]
        moving = ["mass", *self.inertia] if "mass" in (*self.names, *self.constant) else []
        return [*self.numbers, *(one for name in contacts for one in self.vector(name)), *moving]

    @property
    def _optional(self) -> list[str]:
        products = [] if self.axes == "xy" else ["inertia_xy", "inertia_xz", "inertia_yz"]
        return ["name", *self.vector("about"), "mass", *self.inertia, *products]

    def cases(self, rows: Sequence[Row]) -> tuple[Cases, list[str], dict[int, str]]:
        """The cases of some rows, their names, and what is wrong with some of the rows, by their places."""
        table, problems = self._table(rows)
        value = dict(zip(self.names, table.T, strict=True))
        value |= {name: np.full(len(rows), number) for name, number in self.constant.items()}
        for name in self.numbers:
            for place in np.flatnonzero(~np.isfinite(value[name])).tolist():
                problems.setdefault(place, f"{name} is empty or not finite; give a number")

        def vector(name: str) -> Floats:
            return _spatial([value[column] for column in self.vector(name)])

        points, normals = (
            np.stack([vector(f"{kind}_{number + 1}") for number in range(self.contacts)], axis=1)
            for kind in ("contact", "normal")
        )
        lengths = np.linalg.norm(normals, axis=2, keepdims=True)
        normals = np.where(np.abs(lengths - 1.0) <= ROUNDING, normals / lengths, normals)
        force, centre = vector("force"), vector("centre")
        couple = np.zeros((len(rows), 3))
        couple[:, 3 - len(self.couple) :] = np.stack([value[name] for name in self.couple], axis=1)
        if "about_x" in value:  # tau_c = tau_a + (a - c) ^ F
            couple += np.cross(vector("about") - centre, force)
        weight, mass = vector("weight"), value.get("mass", np.full(len(rows), np.nan))
        given = (
            points,
            normals,
            force,
            couple,
            weight,
            centre,
            value["friction"],
            mass,
            self._inertia(value),
        )
        return Cases(*given), self._row_names(rows, problems), problems

    def _row_names(self, rows: Sequence[Row], problems: dict[int, str]) -> list[str]:
        """The names of rows, empty where there is none; a row whose name is too long fails."""
        if "name" not in self.names:
            return []
        place = self.names.index("name")
        names = ["" if isinstance(row, str) else str((row[place:] or [""])[0]) for row in rows]
        for row, name in enumerate(names):
            if len(name) > LONGEST_CELL:
                problems.setdefault(row, f"name has {len(name)} letters; shorten it")
        return [name[:LONGEST_CELL] for name in names]

    def _table(self, rows: Sequence[Row]) -> tuple[Floats, dict[int, str]]:
        """The numbers (n, columns), NaN where a cell is empty or none, and what is wrong with some rows."""
        table, problems = np.full((len(rows), len(self.names)), np.nan), dict[int, str]()
        text = self.names.index("name") if "name" in self.names else None
        for place, row in enumerate(rows):
            if isinstance(row, str):
                problems[place] = row
                continue
            if len(row) != len(self.names):
                problems[place] = (
                    f"has {len(row)} cells for {len(self.names)} columns; give one for each"
                )
                continue
            if text is not None:
                row = [*row[:text], "", *row[text + 1 :]]
            letters = "".join(cell for cell in row if isinstance(cell, str))
            try:
                if "_" in letters or not letters.isascii():  # which Python's float may take
                    raise ValueError
                table[place] = [np.nan if cell == "" else float(cell) for cell in row]
            except (TypeError, ValueError, OverflowError):
                name, cell = next(
                    cell for cell in zip(self.names, row, strict=True) if not _is_number(cell[1])
                )
                problems[place] = f'{name} is "{shortened(cell, 30)}"; give a number'
        return table, problems

    def _inertia(self, value: Mapping[str, Floats]) -> Floats:
        count = len(value["friction"])
        table = np.full((count, 3, 3), np.nan)
        if "mass" not in value:
            return table
        known = ~np.isnan(np.stack([value[name] for name in ("mass", *self.inertia)])).all(axis=0)
        table[known] = 0.0
        for axis in range(3):
            table[known, axis, axis] = value[self.inertia[axis % len(self.inertia)]][known]
        for one, other in ((0, 1), (0, 2), (1, 2)):
            name = f"inertia_{'xyz'[one]}{'xyz'[other]}"
            if name in value:
                product = np.nan_to_num(value[name][known], nan=0.0)
                table[known, one, other] = table[known, other, one] = product
        return table


def _is_number(cell: Any) -> bool:
    try:
        number(cell)
    except (ValueError, OverflowError):
        return False
    return True


def _spatial(components: list[Floats]) -> Floats:
    """Vectors (n, 3) of their components; the third of the plane is zero, but NaN where nothing is there."""
    if len(components) == 2:
        none = np.isnan(components[0]) & np.isnan(components[1])
        components = [*components, np.where(none, np.nan, 0.0)]
    return np.stack(components, axis=1)


@dataclass(frozen=True)
class Table:
    """A file of cases, of which the rows are read a chunk of `size` at a time, by any process.

    starts: places of the chunks in a CSV file
    """

    path: Path
    columns: Columns
    rows: int
    size: int
    starts: tuple[int, ...]

    def __len__(self) -> int:
        return -(-self.rows // self.size)

    def chunk(self, number: int) -> list[Row]:
        """The rows of a chunk; raises SceneError where the file cannot be read any more."""
        if self.path.suffix == ".parquet":
            rows = _parquet_rows(self.path, number * self.size, (number + 1) * self.size)
        else:
            with reading(self.path, KINDS), self.path.open("rb") as stream:
                stream.seek(self.starts[number])
                rows = [_cells(line) for line in islice(filter(bytes.strip, stream), self.size)]
        if len(rows) != self.rows_of(number):
            why = f"has {len(rows)} rows in chunk {number + 1} instead of {self.rows_of(number)}"
            raise SceneError(f"{self.path}: {why}; it was changed meanwhile, call again")
        return rows

    def rows_of(self, number: int) -> int:
        """How many rows a chunk has."""
        return min(self.size, self.rows - number * self.size)


def open_table(path: Path, settings: Sequence[str]) -> Table:
    """A table of cases.

    Args:
        settings: such as "friction=0.5": values of columns, for all rows.

    Raises:
        SceneError: it cannot be read, has wrong columns, or a setting is no number.
        MissingError: it is a Parquet file, and pyarrow is not installed.
    """
    constant = dict(_setting(one) for one in settings)
    if path.suffix == ".parquet":
        file = file_of_numbers(path, ("name",))
        columns = Columns(tuple(file.schema_arrow.names), constant)
        return Table(path, columns, file.metadata.num_rows, CHUNK, ())
    starts, place, rows = list[int](), 0, 0
    names: tuple[str, ...] | None = None
    with reading(path, KINDS), path.open("rb") as stream:
        for line in stream:
            if not line.strip():
                pass
            elif names is None:
                cells = _cells(line.removeprefix(BOM))
                if isinstance(cells, str):
                    raise SceneError(f"{path}: the row of names {cells}")
                names = tuple(name.strip() for name in cells)
            else:
                if rows % CHUNK == 0:
                    starts.append(place)
                rows += 1
            place += len(line)
    return Table(path, Columns(names or (), constant), rows, CHUNK, tuple(starts))


def _setting(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    with suppress(ValueError):
        if np.isfinite(found := decimal(value.strip())):
            return name.strip(), found
    why = "is no finite number"
    raise SceneError(f"--set {shortened(text)}: {why}; with --batch give COLUMN=NUMBER")


def _cells(line: bytes) -> Row:
    """The cells of a line, or why it has none."""
    text = line.decode("utf-8", errors="replace")
    try:
        return next(csv.reader([text]), [])
    except csv.Error as error:
        return f"is no line of CSV ({error}); shorten or correct it"


def _parquet_rows(path: Path, start: int, end: int) -> list[Row]:
    """Rows from `start` up to `end`, with "" where nothing is; those of a damaged group are its reason."""
    file, first = file_of_numbers(path, ("name",)), 0
    found: list[Row] = []
    for group in range(file.num_row_groups):
        count = file.metadata.row_group(group).num_rows
        low, high = max(start - first, 0), min(end - first, count)
        first += count
        if low < high:
            try:
                found += _group_rows(path, group)[low:high]
            except SceneError as error:
                found += [str(error)] * (high - low)
    return found


@lru_cache(maxsize=1)
def _group_rows(path: Path, group: int) -> list[Row]:
    """The rows of a group, which are kept for the next chunk."""
    with reading(path, "write it anew", name=f"group {group + 1} of rows"):
        table = file_of_numbers(path, ("name",)).read_row_group(group)
        columns = [
            map(_text, column)
            if name == "name"
            else ["" if value is None else value for value in column.to_pylist()]
            for name, column in zip(table.column_names, table.columns, strict=True)
        ]
        return list(map(list, zip(*columns, strict=True)))


def _text(scalar: Any) -> str:
    """A name, with a mark for each byte that is no UTF-8."""
    try:
        return str(scalar.as_py() or "")
    except UnicodeDecodeError:
        return bytes(scalar.as_buffer()).decode("utf-8", errors="replace")

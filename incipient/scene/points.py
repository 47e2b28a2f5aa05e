"""Files that a scene names instead of what stands in them, points x, y above all."""

import csv
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError, ValidationInfo

from ..arrays import Point, decimal
from ..errors import SceneError
from ..input_files import read_text
from .messages import Problem, counted, refusal, split

MOST_POINTS = 100_000


def read_points(path: Path, fewest: int, section: str) -> list[Point]:
    """Rows x, y of a CSV file; a heading, empty lines and lines beginning with # are passed over.

    Raises ValidationError about the key `file` of a section where there are not `fewest` to MOST_POINTS points.
    """
    rows = read_numbers(path, 2, MOST_POINTS, section, "x, y", fewest)
    return [(x, y) for x, y in rows]


def read_numbers(
    path: Path, columns: int, most: int, section: str, names: str, fewest: int = 1
) -> list[tuple[float, ...]]:
    """Rows of numbers of a CSV file, so many columns each; headings and comments are passed over as by `read_points`.

    Raises ValidationError about the key `file` of a section where there are not `fewest` to `most` rows.
    """
    try:
        text = read_text(path, f"give the name of a CSV file of {names}", str(path))
    except SceneError as error:
        raise about_file(section, *split(str(error))) from None
    try:
        rows = list(enumerate(csv.reader(text.splitlines()), 1))
    except csv.Error as error:
        raise about_file(
            section, f"{path} is no table ({error})", f"write the numbers {names} a line"
        ) from None
    rows = [(k, row) for k, row in rows if row and not row[0].lstrip().startswith("#")]
    if rows and all(map(_is_name, rows[0][1])):
        rows = rows[1:]
    if not fewest <= len(rows) <= most:
        number = {1: "one", 2: "two", 3: "three"}.get(fewest, str(fewest))
        raise about_file(
            section,
            f"{path} has {counted(len(rows), 'point')}",
            f"give {number} or more points, {most} at most",
        )
    return [_numbers(section, f"{path} line {number}", row, columns, names) for number, row in rows]


def file_key(kinds: str, instead: str, example: str) -> Any:
    """The key `file` of a section: the kinds of files, and the keys that the resolved scene has instead."""
    text = f"{kinds} relative to the scene; the resolved scene has {instead} instead"
    return Field(None, description=text, examples=[example])


def with_file_read(
    section: str,
    key: str,
    data: Any,
    info: ValidationInfo,
    read: Callable[[Path], dict[str, Any]],
    remedy: str = "give one of them",
) -> Any:
    """What is given for a section, its file replaced by what `read` finds there; no longer of where it was read.

    Raises ValidationError if both the file and the key that it stands for are given, or neither.
    """
    if not isinstance(data, dict):
        return data
    given, from_file = (
        key in data,
        data.get("file") is not None,
    )  # a scene that was dumped names no file
    if given == from_file:
        which = f"both file and {key} are" if given else f"neither file nor {key} is"
        raise about_file(section, f"{which} given", remedy)
    if not isinstance(data.get("file"), str):
        return data
    path = Path((info.context or {}).get("directory", "."), data["file"])
    return {**{name: value for name, value in data.items() if name != "file"}, **read(path)}


def about_file(section: str, why: str, remedy: str) -> ValidationError:
    """The error about the key `file` of a section."""
    return refusal(section, [Problem(("file",), why, remedy)])


def _numbers(
    section: str, place: str, row: Sequence[str], columns: int, names: str
) -> tuple[float, ...]:
    if len(row) != columns or not all(_is_number(cell) for cell in row):
        number = {2: "two", 3: "three", 4: "four"}.get(columns, str(columns))
        remedy = f"write {number} finite numbers {names} a line"
        raise about_file(section, f'{place} is "{",".join(row)[:40]}"', remedy)
    return tuple(float(cell) for cell in row)


def _is_name(cell: str) -> bool:
    """Whether a cell names a column; "nan", "0;1" and digits of another script are broken numbers."""
    first = cell.strip()[:1]
    try:
        float(cell)
    except ValueError:
        return bool(first) and not first.isnumeric() and first not in "+-."
    return False


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(decimal(cell))
    except ValueError:
        return False

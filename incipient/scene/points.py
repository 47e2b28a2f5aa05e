"""Files of points and other data that a scene names."""

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

from pydantic import Field, ValidationError, ValidationInfo, model_validator

from ..arrays import Point, decimal
from ..errors import SceneError
from ..input_files import read_text
from .messages import Problem, counted, refusal, split
from .section import Section

MOST_POINTS = 100_000


def read_points(path: Path, fewest: int, section: str) -> list[Point]:
    """Rows x, y of a CSV file; a header, empty lines and lines beginning with # are skipped.

    Raises ValidationError on the key `file` of a section unless there are `fewest` to MOST_POINTS points.
    """
    rows = read_numbers(path, 2, MOST_POINTS, section, "x, y", fewest)
    return [(x, y) for x, y in rows]


def read_numbers(
    path: Path, columns: int, most: int, section: str, names: str, fewest: int = 1
) -> list[tuple[float, ...]]:
    """Rows of numbers of a CSV file; as `read_points`, with `fewest` to `most` rows."""
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
    """The key `file` of a section, with the keys that replace it in the complete scene."""
    text = f"{kinds} relative to the scene; the resolved scene has {instead} instead"
    return Field(None, description=text, examples=[example])


class FromFile(Section):
    """A section that may name a file; the complete scene has the file's content instead.

    Attributes:
        in_file: the key whose value the file has.
        instead: the remedy if both are given, or neither.
    """

    in_file: ClassVar[str] = "points"
    instead: ClassVar[str] = "give one of them"

    @classmethod
    def is_needed(cls, data: dict[str, Any]) -> bool:
        return True

    @classmethod
    def read(cls, path: Path, data: dict[str, Any]) -> dict[str, Any]:
        """Keys and values read from a file; `data`: the other keys. Raises ValidationError."""
        raise NotImplementedError

    @model_validator(mode="before")
    @classmethod
    def _with_file_read(cls, data: Any, info: ValidationInfo) -> Any:
        if not isinstance(data, dict):
            return data
        # A scene that was dumped names no file.
        in_scene, from_file = cls.in_file in data, data.get("file") is not None
        if (in_scene and from_file) or (cls.is_needed(data) and not (in_scene or from_file)):
            which = (
                f"both file and {cls.in_file} are"
                if in_scene
                else f"neither file nor {cls.in_file} is"
            )
            raise about_file(cls.__name__, f"{which} given", cls.instead)
        if not isinstance(data.get("file"), str):
            return data
        path = Path((info.context or {}).get("directory", "."), data["file"])
        return {key: value for key, value in data.items() if key != "file"} | cls.read(path, data)


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
    """Whether a cell names a column; "nan", "0;1" and digits of another script are invalid numbers."""
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

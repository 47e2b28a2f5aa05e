"""Files of points and other data that a scene names."""

import math
from pathlib import Path
from typing import Any, ClassVar

from pydantic import Field, ValidationInfo, model_validator

from ..arrays import decimal
from ..errors import SceneError
from ..input_files import read_text
from .messages import Refused, counted, problem, split
from .section import Rule, Section

MOST_POINTS = 100_000
_NUMBERS = {1: "one", 2: "two", 3: "three", 4: "four"}


def read_numbers(
    path: Path, names: str, fewest: int = 1, most: int = MOST_POINTS
) -> list[tuple[float, ...]]:
    """Rows of numbers of a CSV file with columns such as "x, y".

    A header, empty lines and lines beginning with # are skipped. Raises SceneError unless there are `fewest` to `most`
    rows of finite numbers.
    """
    text = read_text(path, f"give the name of a CSV file of {names}", str(path))
    lines = [
        (number, [cell.strip(' "') for cell in line.split(",")])
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if lines and all(map(_is_name, lines[0][1])):
        lines = lines[1:]
    if not fewest <= len(lines) <= most:
        remedy = f"give {_NUMBERS.get(fewest, fewest)} or more points, {most} at most"
        raise SceneError(f"{path} has {counted(len(lines), 'point')}; {remedy}")
    columns = names.count(",") + 1
    for line, row in lines:
        if len(row) != columns or not all(map(_is_number, row)):
            remedy = f"write {_NUMBERS[columns]} finite numbers {names} a line"
            raise SceneError(f'{path} line {line} is "{",".join(row)[:40]}"; {remedy}')
    return [tuple(map(float, row)) for _, row in lines]


def file_key(kinds: str, instead: str, example: str) -> Any:
    """The key `file` of a section, with the keys that replace it in the complete scene."""
    text = f"{kinds} relative to the scene; the resolved scene has {instead} instead"
    return Field(None, description=text, examples=[example])


class FromFile(Section):
    """A section that may name a file; the complete scene has the file's content instead.

    Attributes:
        in_file: the key whose value the file has.
        may_be_absent: whether neither may be given.
        instead: the remedy if both are given, or neither.
        columns, fewest: of a CSV file; otherwise override `read`.
    """

    rules: ClassVar[tuple[Rule, ...]] = (
        Rule("file", lambda s: not s.may_be_absent and s.in_file not in s.model_fields_set,
             "neither file nor {s.in_file} is given", "{s.instead}"),
    )  # fmt: skip

    in_file: ClassVar[str] = "points"
    may_be_absent: ClassVar[bool] = False
    instead: ClassVar[str] = "give one of them"
    columns: ClassVar[str] = "x, y"
    fewest: ClassVar[int] = 2

    @classmethod
    def read(cls, path: Path, data: dict[str, Any]) -> dict[str, Any]:
        """Keys and values read from a file; `data`: the other keys. Raises SceneError."""
        return {cls.in_file: read_numbers(path, cls.columns, cls.fewest)}

    @model_validator(mode="before")
    @classmethod
    def _with_file_read(cls, data: Any, info: ValidationInfo) -> Any:
        if not isinstance(data, dict):
            return data
        # A scene that was dumped names no file.
        if cls.in_file in data and data.get("file") is not None:
            why = f"both file and {cls.in_file} are given"
            raise Refused(problem("file", why, cls.instead))
        if not isinstance(data.get("file"), str):
            return data
        others = {key: value for key, value in data.items() if key != "file"}
        path = Path((info.context or {}).get("directory", "."), data["file"])
        try:
            return others | cls.read(path, others)
        except SceneError as error:
            raise Refused(problem("file", *split(str(error)))) from None


def _is_name(cell: str) -> bool:
    """Whether a cell names a column; "0;1" and digits of another script are invalid numbers, as "nan" is."""
    first = cell.strip()[:1]
    is_text = bool(first) and not first.isnumeric() and first not in "+-."
    return is_text and cell.strip().lower() not in ("nan", "inf", "infinity")


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(decimal(cell))
    except ValueError:
        return False

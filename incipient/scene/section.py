"""The base of all sections of a scene: immutable, strict, with one-line errors; and of those that name a file."""

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from ..arrays import LARGEST, SMALLEST, decimal
from ..errors import CONTROL, SceneError
from ..input_files import read_text
from .expression import Expression
from .messages import (
    Problem,
    Refused,
    counted,
    one_line,
    problem,
    problems_of,
    refused,
    split,
    variants,
)


def key(description: str, default: Any = ..., **more: Any) -> Any:
    """A key of a section; the description includes the unit, a key without a default is required."""
    return Field(default, description=description, **more)


def _not_tiny(value: float) -> float:
    if value < SMALLEST:
        raise refused(
            f"is {value:g}", f"give a number of at least {SMALLEST:g}, or choose other units"
        )
    return value


def formula(variables: str) -> AfterValidator:
    """Validator of a formula in these variables."""

    def in_variables(text: str) -> str:
        try:
            unknown = Expression(text).variables - set(variables)
        except SceneError as error:
            raise refused(*split(str(error))) from None
        if unknown:
            raise refused(f'"{text}" depends on {min(unknown)}', f"use {', '.join(variables)} only")
        return text

    return AfterValidator(in_variables)


def _without_control_characters(text: str) -> str:
    if CONTROL.search(text):
        raise refused("has control characters, which terminals execute", "remove them")
    return text


Title = Annotated[str, AfterValidator(_without_control_characters)]
Positive = Annotated[float, Field(gt=0), AfterValidator(_not_tiny)]
NotNegative = Annotated[float, Field(ge=0)]
Choice = bool | Literal["auto"]
Pair = Annotated[tuple[float, float], Field(strict=False)]
PositivePair = Annotated[tuple[Positive, Positive], Field(strict=False)]
Triple = Annotated[tuple[float, float, float], Field(strict=False)]
PositiveTriple = Annotated[tuple[Positive, Positive, Positive], Field(strict=False)]
Pairs = Annotated[tuple[Pair, ...], Field(strict=False)]
_UNIT = re.compile(r"\[([^\[\]]+)\]")  # of keys, as their descriptions have them


@dataclass(frozen=True)
class Rule:
    """A rule of a section or scene `s`: key, condition that breaks it, reason and remedy.

    The condition returns whether the rule is broken, the value that breaks it, or a list of such values; texts may
    contain `{s...}`, an attribute of `s`, and `{v}`, that value. A SceneError of the condition breaks the rule as well:
    reason and remedy are its own.
    """

    key: str
    broken: Callable[[Any], Any]
    why: str = ""
    remedy: str = ""
    given: Callable[[Any], Any] | None = None  # the property of scenes that have the rule

    def problems(self, s: Any) -> list[Problem]:
        """A problem for each value that breaks the rule."""
        try:
            values = (self.given is None or self.given(s)) and self.broken(s)
        except SceneError as error:
            return [problem(self.key.format(s=s), *split(str(error)))]
        if not values:
            return []
        values = values if isinstance(values, list) else [values]
        texts = (self.key, self.why, self.remedy)
        return [problem(*(text.format(s=s, v=value) for text in texts)) for value in values]


def first_broken(rules: Iterable[Rule], s: Any) -> list[Problem]:
    """Problems of the first broken rule."""
    return next((problems for rule in rules if (problems := rule.problems(s))), [])


def when(condition: Callable[[Any], Any], *rules: Rule) -> tuple[Rule, ...]:
    """Rules of sections or scenes with this property."""
    return tuple(replace(rule, given=condition) for rule in rules)


class Section(BaseModel):
    """A part of a scene: immutable, with known keys and finite numbers only.

    Raises SceneError: names the key, the reason and the remedy.

    Attributes:
        rules: of the section's keys, before those of its bases; the first broken one is reported.
    """

    rules: ClassVar[tuple[Rule, ...]] = ()

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False, defer_build=True
    )

    def __init__(self, /, **data: Any) -> None:
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise SceneError(
                one_line(type(self).__name__, problems_of(error, type(self)))
            ) from None

    # Without this mark pydantic builds nested sections through __init__ and loses the path to a wrong key.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @field_validator("*")
    @classmethod
    def _is_not_huge(cls, value: Any) -> Any:
        if (largest := _largest(value)) > LARGEST:
            remedy = f"give numbers of at most {LARGEST:g} in size, or choose other units"
            raise refused(
                f"holds {largest:g}" if isinstance(value, tuple) else f"is {value:g}", remedy
            )
        return value

    @model_validator(mode="after")
    def _obeys_its_rules(self) -> Self:
        rules = (rule for kind in type(self).__mro__ for rule in vars(kind).get("rules", ()))
        if problems := first_broken(rules, self):
            raise Refused(*problems)
        return self

    def changed(self, key: str) -> bool:
        return bool(getattr(self, key) != type(self).model_fields[key].default)


def _largest(value: Any) -> float:
    if isinstance(value, float):
        return abs(value)
    return max(map(_largest, value), default=0.0) if isinstance(value, tuple) else 0.0


def is_number(value: Any) -> bool:
    """Whether a value is a number, not a boolean."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def rises(rows: Sequence[Sequence[float]]) -> bool:
    """Whether the first numbers of rows ascend."""
    return all(later[0] > earlier[0] for earlier, later in pairwise(rows))


def unit_of(model: type[BaseModel], key: str) -> str:
    """Unit of a key such as ``body.density``, "-" for a pure number, "" without one."""
    models: tuple[type[BaseModel], ...] = (model,)
    for part in key.split("."):
        fields = [model.model_fields[part] for model in models if part in model.model_fields]
        models = tuple(inner for field in fields for inner in variants(field.annotation))
    units = (unit[1] for field in fields if (unit := _UNIT.search(field.description or "")))
    return next(units, "")


# -- files of points and other data --------------------------------------------------------------


MOST_POINTS = 100_000
_NUMBERS = {1: "one", 2: "two", 3: "three", 4: "four"}


def read_numbers(path: Path, names: str, fewest: int = 1) -> list[tuple[float, ...]]:
    """Rows of numbers of a CSV file with columns such as "x, y".

    A header, empty lines and lines beginning with # are skipped. Raises SceneError unless there are at least
    `fewest` rows, and not too many, of finite numbers.
    """
    text = read_text(path, f"give the name of a CSV file of {names}", str(path))
    lines = [
        (number, [cell.strip(' "\t') for cell in line.split(",")])
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if lines and all(map(_is_name, lines[0][1])):
        lines = lines[1:]
    if not fewest <= len(lines) <= MOST_POINTS:
        raise SceneError(
            f"{path} has {counted(len(lines), 'point')}; "
            f"give {_NUMBERS.get(fewest, fewest)} or more points, {MOST_POINTS} at most"
        )
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

    if TYPE_CHECKING:
        file: str | None
    in_file: ClassVar[str] = "points"
    may_be_absent: ClassVar[bool] = False
    instead: ClassVar[str] = "give one of them"
    columns: ClassVar[str] = "x, y"
    fewest: ClassVar[int] = 2

    def read(self, path: Path) -> dict[str, Any]:
        """Keys and values read from a file. Raises SceneError."""
        return {self.in_file: read_numbers(path, self.columns, self.fewest)}

    @model_validator(mode="after")
    def _obeys_its_rules(self) -> Self:
        # A file is read after the other keys, and rules are for both.
        return self if self.file is not None else super()._obeys_its_rules()  # type: ignore[operator]

    @model_validator(mode="wrap")
    @classmethod
    def _with_file_read(
        cls, data: Any, validated: ModelWrapValidatorHandler[Any], info: ValidationInfo
    ) -> Any:
        section = validated(data)
        if section.file is None:
            return section
        if cls.in_file in section.model_fields_set:
            raise Refused(problem("file", f"both file and {cls.in_file} are given", cls.instead))
        path = Path((info.context or {}).get("directory", "."), section.file)
        try:
            return validated({**data, "file": None, **section.read(path)})
        except SceneError as error:
            raise Refused(problem("file", *split(str(error)))) from None


def _is_name(cell: str) -> bool:
    """Whether a cell names a column; "0;1" and digits of another script are invalid numbers, as "nan" is."""
    is_text = cell[:1] not in "+-." and not cell[:1].isnumeric()
    return is_text and cell.lower() not in ("nan", "inf", "infinity")


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(decimal(cell))
    except ValueError:
        return False

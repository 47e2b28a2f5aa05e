"""The base of all sections of a scene: immutable, strict, with one-line errors."""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)

from ..arrays import LARGEST, SMALLEST
from ..errors import SceneError
from .expression import Expression
from .messages import Problem, Refused, one_line, problem, problems_of, refused, split, variants


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

    def problems(self, s: Any) -> list[Problem]:
        """A problem for each value that breaks the rule."""
        try:
            values = self.broken(s)
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

    def within(rule: Rule) -> Rule:
        return replace(rule, broken=lambda s: condition(s) and rule.broken(s))

    return tuple(map(within, rules))


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
    described = [""]
    for part in key.split("."):
        fields = [model.model_fields[part] for model in models if part in model.model_fields]
        described = [field.description or "" for field in fields]
        models = tuple(inner for field in fields for inner in variants(field.annotation))
    units = (unit[1] for text in described if (unit := _UNIT.search(text)))
    return next(units, "")

"""Messages on invalid scenes, one line each: the key, the reason, and the remedy."""

import difflib
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, LiteralString, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError

from . import retired

Key = tuple[str | int, ...]

# Names of the errors that validators raise, within one section or between several.
WITHIN: LiteralString = "contradiction"
BETWEEN: LiteralString = "contradiction_between_sections"

MOST_SHOWN = 4  # problems besides the first

# By pydantic's type of error, with its context.
_REMEDIES = {
    "float_type": "give a number",
    "finite_number": "give a finite number",
    "int_type": "give a whole number",
    "int_from_float": "give a whole number",
    "bool_type": "give true or false",
    "string_type": 'give text in "quotes"',
    "tuple_type": "give a list in [brackets]",
    "greater_than": "give a number greater than {gt:g}",
    "greater_than_equal": "give a number of at least {ge:g}",
    "less_than": "give a number less than {lt:g}",
    "less_than_equal": "give a number of at most {le:g}",
    **dict.fromkeys(
        ("model_type", "model_attributes_type", "dict_type"), "write a section [{key}]"
    ),
}
_NAME = re.compile("'([^']*)'")


@dataclass(frozen=True)
class Problem:
    """An invalid key, the reason, and the remedy."""

    key: Key
    why: str
    remedy: str
    between: bool = False  # whether other sections are involved

    def __str__(self) -> str:
        path = key_text(self.key)
        return f"{path}: {self.why}; {self.remedy}" if path else f"{self.why}; {self.remedy}"


def problem(key: str, why: str, remedy: str) -> Problem:
    """The problem at a key such as ``flow.kind``."""
    return Problem(tuple(key.split(".")), why, remedy)


def key_text(key: Key) -> str:
    """A key as users write it, such as ``body.centre[1]``, shortened if long."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in key).lstrip(".")
    return text if len(text) <= 80 else f"{text[:77]}..."


def one_line(source: str, problems: Sequence[Problem]) -> str:
    """The first problem with its source, and the next ones in parentheses."""
    more = " | ".join(map(str, problems[1 : MOST_SHOWN + 1]))
    suffix = f" (and {counted(len(problems) - 1, 'more error')}: {more})" if more else ""
    return " ".join(f"{source}: {problems[0]}{suffix}".split())


def counted(number: int, thing: str) -> str:
    """``1 item``, ``2 items``."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def either(names: Sequence[str]) -> str:
    """``"a", "b" or "c"``."""
    quoted = [f'"{name}"' for name in names]
    return " or ".join([*([", ".join(quoted[:-1])] if quoted[1:] else []), quoted[-1]])


def refusal(title: str, problems: Sequence[Problem], between: bool = False) -> ValidationError:
    """Problems within a section, or `between` sections, as the exception of a pydantic validator."""
    kind = BETWEEN if between else WITHIN
    return ValidationError.from_exception_data(
        title,
        [
            InitErrorDetails(
                type=PydanticCustomError(
                    kind, "{why}; {remedy}", {"why": p.why, "remedy": p.remedy}
                ),
                loc=p.key,
                input=None,
            )
            for p in problems
        ],
    )


def split(message: str) -> tuple[str, str]:
    """Reason and remedy of a one-line error message."""
    why, _, remedy = message.partition("; ")
    return why, remedy or "see the guide"


def variants(annotation: Any) -> tuple[type[BaseModel], ...]:
    """Sections that are possible for a field with this annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return (annotation,)
    return tuple(model for part in get_args(annotation) for model in variants(part))


def discriminator(section: type[BaseModel]) -> str | None:
    """The key, ``kind`` or ``shape``, that distinguishes a section from its alternatives."""
    return next((name for name in ("kind", "shape") if _single_choice(section, name)), None)


def tag(section: type[BaseModel]) -> str | None:
    """Value of the `discriminator`, such as ``"lid"``."""
    name = discriminator(section)
    return _single_choice(section, name) if name else None


def problems_of(
    error: ValidationError, root: type[BaseModel], gdim: int | None = None
) -> list[Problem]:
    """Problems in a validation error of the section `root`, unknown keys first.

    gdim: dimension of the grains and beds in remedies; None: both
    """
    details = sorted(error.errors(include_url=False), key=lambda e: e["type"] != "extra_forbidden")
    places = [_place(root, e["loc"]) for e in details]
    problems: list[Problem] = []
    meant: set[Key] = set()
    for detail, (key, section) in zip(details, places, strict=True):
        if detail["type"] == "extra_forbidden" and section is not None:
            close = _closest(str(key[-1]), list(section.model_fields))
            meant.add((*key[:-1], close or ""))
            problems.append(_unknown_key(key, section, close))
        elif not (key in meant or _repeats(detail, details)):
            problems.append(_problem(detail, key, section, gdim))
    return problems


def _repeats(detail: ErrorDetails, details: Sequence[ErrorDetails]) -> bool:
    loc = detail["loc"]
    return detail["type"] == "too_short" and any(
        e["loc"][: len(loc)] == loc != e["loc"] for e in details
    )


def _place(root: type[BaseModel], loc: Key) -> tuple[Key, type[BaseModel] | None]:
    key: list[str | int] = []
    section: type[BaseModel] | None = root
    inside: tuple[type[BaseModel], ...] = (root,)
    for part in loc:
        chosen = [m for m in inside if len(inside) > 1 and tag(m) == part]
        if chosen:
            inside = (chosen[0],)
            continue
        key.append(part)
        section = inside[0] if len(inside) == 1 else None
        field = section.model_fields.get(str(part)) if section else None
        inside = variants(field.annotation) if field else ()
    return tuple(key), section


def _dotted(key: Key) -> str:
    return ".".join(part for part in key if isinstance(part, str))


def _retired_value(detail: ErrorDetails, key: Key) -> Problem | None:
    context = detail.get("ctx", {})
    if detail["type"] == "union_tag_invalid":
        key, value = (*key, context["discriminator"].strip("'")), str(context["tag"])
    else:
        value = str(detail["input"])
    remedy = retired.VALUES.get((_dotted(key), value))
    return Problem(key, f"{shown(value)} is retired", remedy) if remedy else None


def _problem(
    detail: ErrorDetails, key: Key, section: type[BaseModel] | None, gdim: int | None
) -> Problem:
    if (retirement := _retired_value(detail, key)) is not None:
        return retirement
    kind, context = detail["type"], detail.get("ctx", {})
    value = shown(detail["input"])
    if kind in (WITHIN, BETWEEN):
        return Problem(key, context["why"], context["remedy"], between=kind == BETWEEN)
    if kind in ("missing", "too_short", "too_long"):
        return _wrong_number(detail, key, section)
    if kind == "literal_error":
        return Problem(
            key, f"{value} is not known", f"use {either(_NAME.findall(context['expected']))}"
        )
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        return _wrong_alternative(detail, key, section, gdim)
    if kind in _REMEDIES:
        return Problem(
            key, f"is {value}", _REMEDIES[kind].format(**{**context, "key": key_text(key)})
        )
    return Problem(key, f"is {value}", detail["msg"][:1].lower() + detail["msg"][1:])


def _unknown_key(key: Key, section: type[BaseModel], close: str | None) -> Problem:
    if remedy := retired.KEYS.get(_dotted(key)):
        return Problem(key, "is retired", remedy)
    why = f'unknown key for "{tag(section)}"' if tag(section) else "unknown key"
    return Problem(
        key,
        why,
        f'did you mean "{close}"?' if close else f"known are {', '.join(section.model_fields)}",
    )


def _wrong_number(detail: ErrorDetails, key: Key, section: type[BaseModel] | None) -> Problem:
    if detail["type"] == "missing" and isinstance(key[-1], str):
        field = section.model_fields.get(key[-1]) if section else None
        words = f": {field.description}" if field else ""
        return Problem(key, "is missing", f"add {_what_to_add(key[-1], field)}{words}")
    if detail["type"] == "too_short":
        context = detail["ctx"]
        return Problem(
            key,
            f"has {counted(context['actual_length'], 'item')}",
            f"give {context['min_length']} or more",
        )
    if detail["type"] == "too_long" and (most := detail["ctx"]["max_length"]) > 3:
        return Problem(key, f"has {counted(len(detail['input']), 'item')}", f"give {most} at most")
    whole = key[:-1] if isinstance(key[-1], int) and detail["type"] == "missing" else key
    return Problem(whole, f"has {counted(len(detail['input']), 'item')}", "give two, as in [x, y]")


def _what_to_add(name: str, field: FieldInfo | None) -> str:
    if field is not None and variants(field.annotation):
        return f"a section [{name}]"
    choices = (
        [value for value in get_args(field.annotation) if isinstance(value, str)] if field else []
    )
    return f"it, {either(choices)}" if choices else "it"


def _wrong_alternative(
    detail: ErrorDetails, key: Key, section: type[BaseModel] | None, gdim: int | None
) -> Problem:
    context = detail["ctx"]
    name = context["discriminator"].strip("'")
    field = section.model_fields[str(key[-1])] if section else None
    models = variants(field.annotation) if field else ()
    tags = [str(tag(model)) for model in models]
    fitting = [
        str(tag(model))
        for model in models
        if gdim is None or gdim in getattr(model, "gdims", (gdim,))
    ]
    choices = f"use {either(fitting)}"
    if detail["type"] == "union_tag_not_found":
        return Problem((*key, name), "is missing", choices)
    close = _closest(str(context["tag"]), tags)
    remedy = f'did you mean "{close}"?' if close else choices
    return Problem((*key, name), f"{shown(str(context['tag']))} is not known", remedy)


def _closest(word: str, known: list[str]) -> str | None:
    return next(iter(difflib.get_close_matches(word, known, 1)), None)


def _single_choice(section: type[BaseModel], name: str) -> str | None:
    field = section.model_fields.get(name)
    choices = get_args(field.annotation) if field else ()
    return str(choices[0]) if len(choices) == 1 else None


def shown(value: Any) -> str:
    """Short form of a value as in TOML."""
    match value:
        case bool() | str():
            text = json.dumps(value, ensure_ascii=False)
        case dict():
            text = "a section"
        case list() | tuple():
            text = f"a list of {len(value)}"
        case BaseModel():
            text = f"a {type(value).__name__}"
        case _:
            text = str(value)
    return text if len(text) <= 40 else f"{text[:37]}..."

"""Messages on invalid scenes, one line each: the key, the reason, and the remedy."""

import difflib
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from ..errors import shortened

Key = tuple[str | int, ...]

# Reason and remedy by pydantic's type of error, with its context and the words of `_problem`.
_WORDS = {
    "missing": ("is missing", "add {what}"),
    "too_short": ("has {items}", "give {min_length} or more"),
    "too_long": ("has {items}", "give {max_length} at most"),
    "literal_error": ("{value} is not known", "use {choices}"),
    "union_tag_not_found": ("is missing", "use {kinds}"),
    "union_tag_invalid": ("{value} is not known", "{nearest}"),
    "float_type": ("is {value}", "give a number"),
    "finite_number": ("is {value}", "give a finite number"),
    "int_type": ("is {value}", "give a whole number"),
    "int_from_float": ("is {value}", "give a whole number"),
    "bool_type": ("is {value}", "give true or false"),
    "string_type": ("is {value}", 'give text in "quotes"'),
    "tuple_type": ("is {value}", "give a list in [brackets]"),
    "greater_than": ("is {value}", "give a number greater than {gt:g}"),
    "greater_than_equal": ("is {value}", "give a number of at least {ge:g}"),
    "less_than": ("is {value}", "give a number less than {lt:g}"),
    "less_than_equal": ("is {value}", "give a number of at most {le:g}"),
    **dict.fromkeys(
        ("model_type", "model_attributes_type", "dict_type"),
        ("is {value}", "write a section [{key}]"),
    ),
}

# Retired keys, dotted -> remedy; indices of lists are left out of the key.
RETIRED: dict[str, str] = {
    "effects.free_body": 'leave it out, and set body.motion = "free" or "fixed"',
    "effects.free_surface": 'leave it out, and set domain.top = "free-surface" or "slip"',
    "effects.moving_mesh": "leave it out: the mesh moves with the grain and the free surface",
    "effects.third_dimension": "leave it out: domain.width makes a scene three-dimensional",
    "numerics.coupling": "leave it out: grain and fluid are coupled with the grain's added mass",
    "numerics.form": "leave it out: the convective term is the paper's",
    "surface.ends": "leave it out: the fluid slides along both ends of a box",
    "surface.inflow": "use surface.wave, or a flow.kind whose velocity is steady",
    "surface.pressure": "leave it out: the pressure above the surface is the same everywhere",
    "surface.seepage": "leave it out: nothing crosses the bed",
    "surface.tension": "leave it out: the surface is that of water deeper than some millimetres",
    "surface.wave.zone": "make the domain longer ahead of the grain, so that reflected waves come late",
    "bed.leading_edge": "leave it out: plates in a turbulent flow are no longer simulated",
    "bed.diameters": 'give sizes and spread, or kind = "spheres" with a file of the spheres',
    "turbulence.first_cell": "use numerics.mesh_size, which scales all cells",
}

# Retired values: (dotted key, value) -> remedy.
RETIRED_VALUES: dict[tuple[str, str], str] = {
    ("body.on_contact", "repel"): 'use "touch": the grain then rolls, slides or rests on the bed',
    ("numerics.accuracy_of", "couple"): 'use "torque"',
    ("gusts.microscale", "model"): "give a number: sqrt(20 nu k/epsilon) over the mean velocity",
    ("gusts.integral_time", "model"): "give a number: 0.43 k^1.5/epsilon over the mean velocity",
}


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
    """The problem at a key such as ``flow.kind`` or ``surface.stations[0]``; names may be numbers."""
    path, index = re.split(r"(?:\[([0-9]+)\])?\Z", key)[:2]
    return Problem((*path.split("."), *([] if index is None else [int(index)])), why, remedy)


def key_text(key: Key) -> str:
    """A key as users write it, such as ``body.centre[1]``, shortened if long."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in key).lstrip(".")
    return text if len(text) <= 80 else f"{text[:77]}..."


def one_line(source: str, problems: Sequence[Problem]) -> str:
    """The first problem with its source, and the next four in parentheses."""
    more = " | ".join(map(str, problems[1:5]))
    suffix = f" (and {counted(len(problems) - 1, 'more error')}: {more})" if more else ""
    return " ".join(f"{source}: {problems[0]}{suffix}".split())


def counted(number: int, thing: str) -> str:
    """``1 item``, ``2 items``."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def either(names: Sequence[str]) -> str:
    """``"a", "b" or "c"``."""
    quoted = [f'"{name}"' for name in names]
    return " or ".join(filter(None, (", ".join(quoted[:-1]), *quoted[-1:])))


class Refused(ValueError):
    """The refusal of a validator of pydantic's: problems whose keys are counted from its section or key."""

    def __init__(self, *problems: Problem) -> None:
        super().__init__(*map(str, problems))
        self.problems = problems


def refused(why: str, remedy: str) -> Refused:
    """The refusal of the validator of a single key."""
    return Refused(Problem((), why, remedy))


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
    fields = section.model_fields
    only = (
        n for n in ("kind", "shape") if n in fields and len(get_args(fields[n].annotation)) == 1
    )
    return next(only, None)


def tag(section: type[BaseModel]) -> str | None:
    """Value of the `discriminator`, such as ``"lid"``."""
    name = discriminator(section)
    return None if name is None else str(get_args(section.model_fields[name].annotation)[0])


def problems_of(
    error: ValidationError, root: type[BaseModel], gdim: int | None = None
) -> list[Problem]:
    """Problems in a validation error of the section `root`, one a key, unknown keys first.

    gdim: dimension of the grains and beds in remedies; None: both
    """
    details = sorted(error.errors(include_url=False), key=lambda e: e["type"] != "extra_forbidden")
    problems: dict[Key, Problem] = {}
    for detail in details:
        key, section = _place(root, detail["loc"])
        refusal = detail.get("ctx", {}).get("error")
        if isinstance(refusal, Refused):
            for part in refusal.problems:
                whole = replace(part, key=key + part.key, between=not key)
                problems.setdefault(whole.key, whole)
            continue
        problem, earlier = _problem(detail, key, section, gdim), problems.get(key)
        if earlier:  # alternatives for the same value
            more = problem.remedy.removeprefix("give ")
            more = "" if more in earlier.remedy else f" or {more}"
            problem = replace(earlier, remedy=earlier.remedy + more)
        if detail["type"] != "too_short" or not any(k[: len(key)] == key for k in problems):
            problems[key] = problem
    return [*problems.values()]


def _place(root: type[BaseModel], loc: Key) -> tuple[Key, type[BaseModel] | None]:
    """The key without the tags of alternatives, and the section that has it."""
    key: Key = ()
    section: type[BaseModel] | None = root
    inside: tuple[type[BaseModel], ...] = (root,)
    names = 0  # of sections in a table of sections, which the key still has to give
    for part in loc:
        if chosen := tuple(m for m in inside if len(inside) > 1 and tag(m) == part):
            inside = chosen
        elif names:
            key, names = (*key, part), names - 1
        elif inside or isinstance(part, int):
            key = (*key, part)
            section = inside[0] if len(inside) == 1 else None
            field = section.model_fields.get(str(part)) if section else None
            inside = variants(field.annotation) if field else ()
            names = str(field.annotation).count("dict[") if field else 0
    return key, section


def _dotted(key: Key) -> str:
    return ".".join(part for part in key if isinstance(part, str))


def _unknown_key(key: Key, section: type[BaseModel]) -> Problem:
    if remedy := RETIRED.get(_dotted(key)):
        return Problem(key, "is retired", remedy)
    close = _closest(str(key[-1]), [*section.model_fields])
    why = f'unknown key for "{tag(section)}"' if tag(section) else "unknown key"
    known = f"known are {', '.join(section.model_fields)}"
    return Problem(key, why, f'did you mean "{close}"?' if close else known)


def _problem(
    detail: ErrorDetails, key: Key, section: type[BaseModel] | None, gdim: int | None
) -> Problem:
    if detail["type"] == "extra_forbidden" and section is not None:
        return _unknown_key(key, section)
    kind, value, context = detail["type"], detail["input"], detail.get("ctx", {})
    name = str(key[-1]) if key else ""
    field = section.model_fields.get(name) if section else None
    models = variants(field.annotation) if field else ()
    fitting = [m for m in models if gdim is None or getattr(m, "gdim", None) in (None, gdim)]
    if kind.startswith("union_tag"):
        key, value = (*key, context["discriminator"].strip("'")), context.get("tag")
    if remedy := RETIRED_VALUES.get((_dotted(key), str(value))):
        return Problem(key, f"{shown(value)} is retired", remedy)
    kinds = either([str(tag(m)) for m in fitting])
    close = _closest(str(value), [str(tag(m)) for m in models])
    items = len(value) if isinstance(value, list | tuple) else 0
    words = {
        "key": key_text(key),
        "value": shown(value),
        "what": _what_to_add(name, field),
        "items": counted(context.get("actual_length", items), "item"),
        "choices": str(context.get("expected")).replace("'", '"').lower(),
        "kinds": kinds,
        "nearest": f'did you mean "{close}"?' if close else f"use {kinds}",
        "msg": detail["msg"][:1].lower() + detail["msg"][1:],
        **context,
    }
    why, remedy = _WORDS.get(kind, ("is {value}", "{msg}"))
    return Problem(key, why.format(**words), remedy.format(**words))


def _what_to_add(name: str, field: FieldInfo | None) -> str:
    if field is None:
        return "it"
    choices = [value for value in get_args(field.annotation) if isinstance(value, str)]
    what = f"a section [{name}]" if variants(field.annotation) else "it"
    return f"{what}{f', {either(choices)}' if choices else ''}: {field.description}"


def _closest(word: str, known: list[str]) -> str | None:
    return next(iter(difflib.get_close_matches(word, known, 1)), None)


def shown(value: Any) -> str:
    """Short form of a value as in TOML."""
    if isinstance(value, bool | str):
        value = json.dumps(value, ensure_ascii=False)
    elif isinstance(value, list | tuple):
        value = f"a list of {len(value)}"
    elif isinstance(value, dict | BaseModel):
        value = "a section" if isinstance(value, dict) else f"a {type(value).__name__}"
    return shortened(value, 40)

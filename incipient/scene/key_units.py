"""The units of keys, as their descriptions have them."""

import re
from collections.abc import Iterator
from typing import Any, get_args

from pydantic import BaseModel

_UNIT = re.compile(r"\[([^\[\]]+)\]")


def unit_of(model: type[BaseModel], key: str) -> str:
    """The unit of a key such as ``body.density`` of a scene, "-" for a pure number; empty where there is none."""
    models, described = [model], [""]
    for part in key.split("."):
        fields = [one.model_fields[part] for one in models if part in one.model_fields]
        described = [field.description or "" for field in fields]
        models = [inner for field in fields for inner in _models(field.annotation)]
    found = (unit[1] for text in described if (unit := _UNIT.search(text)))
    return next(found, "")


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """The models that an annotation allows."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _models(part)

"""Varied keys and cases of a sweep: checked scenes, each with an identity that depends on its content alone."""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import starmap
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import SceneError, refuse_broken
from ..files import plain
from ..input_files import read_table, read_text
from ..scene import Scene
from ..scene.file import dumps, parse

# The overrides of one case, as of `--set`.
Settings = tuple[str, ...]
# Varied keys of scenes and their values, as text for `--set`.
Axes = dict[str, tuple[str, ...]]

_RANGE = re.compile(r"(log|lin):.*")
_MOST = 100_000  # cases
_REMEDY = "write KEY=1,2,5 or KEY=log:FIRST:LAST:NUMBER or KEY=lin:FIRST:LAST:NUMBER"


def axes_of(over: Mapping[str, Any] | Iterable[str]) -> Axes:
    """Varied keys from texts such as ``fluid.reynolds=log:0.1:200:17``, or from values by key.

    Values are text as after the sign of equality, a list, or one value; sections may be nested. Raises SceneError.
    """
    texts = starmap(_listed, leaves(over)) if isinstance(over, Mapping) else map(_parsed, over)
    axes: Axes = {}
    for key, values in texts:
        if key in axes:
            raise SceneError(f"--over {key}: is given twice; put all its values into one list")
        axes[key] = values
    return axes


def _listed(key: str, values: Any) -> tuple[str, tuple[str, ...]]:
    if isinstance(values, str):
        return _parsed(f"{key}={values}")
    listed = plain(list(values) if isinstance(values, set) else values)
    listed = listed if isinstance(listed, list) else [listed]
    if not listed:
        raise SceneError(f"over {key}: has no values; give a list, or text as in log:0.1:200:17")
    return key, tuple(value if isinstance(value, str) else json.dumps(value) for value in listed)


def _parsed(text: str) -> tuple[str, tuple[str, ...]]:
    key, equals, values = (part.strip() for part in text.partition("="))
    if not (equals and values and re.fullmatch(r"\w+(\.\w+)+|title", key)):
        raise SceneError(f"--over {text}: is not a key with values; {_REMEDY}")
    listed = [
        value
        for part in _split(values)
        for value in (_range(part.split(":"), text) if _RANGE.fullmatch(part) else [part])
    ]
    if not all(listed):
        raise SceneError(f"--over {text}: has an empty value; {_REMEDY}")
    return key, tuple(listed)


def _range(parts: Sequence[str], option: str) -> list[str]:
    try:
        kind, first, last, number = parts
        ends, count = (float(first), float(last)), int(number)
    except ValueError:
        raise SceneError(f"--over {option}: is not a range of numbers; {_REMEDY}") from None
    refuse_broken(
        (
            not np.isfinite(ends).all(),
            f"--over {option}: {first} to {last} are not finite numbers; give finite ones",
        ),
        (
            not 1 <= count <= _MOST,
            f"--over {option}: gives {number} values; give a number from 1 to {_MOST}",
        ),
        (
            kind == "log" and min(ends) <= 0.0,
            f"--over {option}: a logarithmic range needs ends above zero; use lin",
        ),
    )
    between = np.geomspace(*ends, count) if kind == "log" else np.linspace(*ends, count)
    return [to_digits(value) for value in between]


def to_digits(value: float) -> str:
    """A number as text, equal on all machines."""
    return f"{value:.12g}"


def _split(text: str) -> list[str]:
    parts, depth, quoted = [""], 0, False
    for sign in text:
        quoted ^= sign == '"'
        depth += 0 if quoted else (sign == "[") - (sign == "]")
        if sign == "," and not depth and not quoted:
            parts.append("")
        else:
            parts[-1] += sign
    return [part.strip() for part in parts]


def table_of_cases(path: Path) -> list[Settings]:
    """Cases of a CSV file, a row each, with keys in the header; empty cells change nothing. Raises SceneError."""
    heads, rows = read_table(path, "give a CSV file of cases")
    if not rows:
        raise SceneError(
            f"{path}: has no cases; write keys in the first row and a case in each one after it"
        )
    return [
        tuple(
            f"{key}={value.strip()}" for key, value in zip(heads, row, strict=True) if value.strip()
        )
        for row in rows
    ]


def combined(axes: Axes, together: bool, table: Iterable[Settings] = ()) -> list[Settings]:
    """Overrides of all cases: every combination of axes and rows; `together`: axes vary side by side.

    Raises SceneError if axes that vary together differ in length, a key comes twice, or there are too many cases.
    """
    columns = [[f"{key}={value}" for value in values] for key, values in axes.items()]
    lengths = ", ".join(f"{key} {len(values)}" for key, values in axes.items())
    number = math.prod(map(len, columns[:1] if together else columns))
    refuse_broken(
        (
            together and len(set(map(len, columns))) > 1,
            f"--zip: the numbers of values differ ({lengths}); give as many for each key",
        ),
        (number > _MOST, f"the sweep has {number} cases; give at most {_MOST}"),
    )
    combine = partial(zip, strict=True) if together and columns else itertools.product
    varied, listed = list(combine(*columns)), list(table) or [()]
    in_table = {setting.split("=")[0].strip() for row in listed for setting in row}
    if both := next((key for key in axes if key in in_table), None):
        raise SceneError(f"--over {both}: the table of cases has it as well; leave one of them out")
    return [(*row, *settings) for row in listed for settings in varied]


@dataclass(frozen=True)
class Source:
    """A scene or case without overrides: its name, TOML text, and the directory of its files."""

    name: str
    text: str
    base: Path = Path()

    @classmethod
    def of(cls, scene: Scene | Path | str) -> Source:
        if isinstance(scene, Scene):
            return cls(scene.title or "scene", dumps(scene))
        path = Path(scene)
        return cls(path.stem, read_text(path, "give the name of a scene file"), path.parent)


@dataclass(frozen=True)
class SweepCase:
    """One case of a sweep.

    identity: independent of the title, the files written and the order of keys
    settings: its overrides; text: the complete scene, or case to be judged, as JSON
    """

    identity: str
    task: str
    source: str
    settings: Settings
    text: str

    @property
    def name(self) -> str:
        return ", ".join(self.settings) or self.source


def resolved(
    source: Source, settings: Settings, task: str, common: Sequence[str] = ()
) -> SweepCase:
    """A source with the settings of one case; `common`: those of all cases. Raises SceneError."""
    overrides = (*common, *settings)
    if task == "judge":
        from ..judging.case import Case

        case = parse(Case, source.text, source.base, overrides, source.name)
        case.require_flow(source.name)
        content = case.model_dump(mode="json", exclude_none=True, warnings=False)
        identity = _identity(task, content)
    else:
        scene = parse(Scene, source.text, source.base, overrides, source.name)
        content, identity = tomllib.loads(dumps(scene)), identity_of(scene, task)
    return SweepCase(identity, task, source.name, settings, json.dumps(content))


def identity_of(scene: Scene, task: str) -> str:
    """The identity of a scene as a case of a sweep."""
    return _identity(task, scene.model_dump(mode="json"))


def _identity(task: str, content: Mapping[str, Any]) -> str:
    text = json.dumps([task, _input(content)], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:20]


def _input(content: Mapping[str, Any]) -> dict[str, Any]:
    """The sections of a scene or case that change its result; absent units are those of earlier files."""
    without = ("title", "source", "output", *(["units"] if content.get("units") is None else []))
    return {name: part for name, part in content.items() if name not in without}


def differing(contents: Sequence[Mapping[str, Any]]) -> list[str]:
    """Keys in which scenes or cases differ, but for tables of numbers."""
    parts = [
        {
            key: value
            for key, value in leaves(_input(content))
            if not (isinstance(value, list) and any(isinstance(item, list) for item in value))
        }
        for content in contents
    ]
    keys = dict.fromkeys(key for part in parts for key in part)
    return [key for key in keys if any(part.get(key) != parts[0].get(key) for part in parts)]


def leaves(content: Mapping[str, Any], section: str = "") -> Iterator[tuple[str, Any]]:
    """Values of nested sections by keys such as ``fluid.reynolds``."""
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from leaves(value, f"{section}{name}.")
        else:
            yield f"{section}{name}", value

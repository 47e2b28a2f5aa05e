"""What is asked of a sweep, from the command line, a section [sweep] or Python, and the cases that it means."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import SceneError
from . import axes
from .axes import Axis
from .cases import TASKS, Case, Source, keys_of, resolved

ENDING = ".sqlite"
_KEYS = ("over", "zip", "cases", "do")
_TIME = re.compile(r"(?:([\d.]+)d)?(?:([\d.]+)h)?(?:([\d.]+)m)?(?:([\d.]+)s?)?")
_UNITS = (86400.0, 3600.0, 60.0, 1.0)


@dataclass(frozen=True)
class Request:
    """Sources and how they are varied.

    over: axes; together: they go along side by side; table: a CSV file of cases; task: run, threshold or judge
    common: overrides of all cases
    """

    sources: tuple[Source, ...]
    over: tuple[Axis, ...] = ()
    together: bool = False
    table: Path | None = None
    task: str = "run"
    common: tuple[str, ...] = field(default=())

    def cases(self) -> tuple[list[Case], list[str]]:
        """The cases, each once, and the keys that they vary.

        Raises:
            SceneError: one of them contradicts itself; it says which.
        """
        listed = [] if self.table is None else axes.table_of_cases(self.table)
        settings = axes.combined(self.over, self.together, listed)
        found: dict[str, Case] = {}
        for source in self.sources:
            for number, one in enumerate(settings, 1):
                case = self._resolved(source, one, f"case {number} of {len(settings)}")
                found.setdefault(case.identity, case)
        return list(found.values()), keys_of(settings)

    def _resolved(self, source: Source, settings: axes.Settings, which: str) -> Case:
        try:
            return resolved(source, settings, self.task, self.common)
        except SceneError as error:
            raise SceneError(f"{which} ({', '.join(settings) or source.name}): {error}") from None


def requested(
    sources: Sequence[Source],
    over: Sequence[Axis] = (),
    together: bool = False,
    table: Path | None = None,
    task: str | None = None,
    common: Sequence[str] = (),
) -> Request:
    """The request; what is not said is taken from the section [sweep] of the first source, as relative to its file.

    Raises:
        SceneError: nothing is varied, or the section cannot be understood.
    """
    section = sources[0].section
    unknown = next((name for name in section if name not in _KEYS), None)
    if unknown is not None:
        raise SceneError(f"{sources[0].name}: sweep.{unknown}: unknown key; known are {', '.join(_KEYS)}")
    given = section.get("over", {})
    if not isinstance(given, Mapping):
        raise SceneError(f"{sources[0].name}: sweep.over: is not a section; write [sweep.over]")
    if not over and table is None:
        over, together = axes.of_mapping(given), together or bool(section.get("zip", False))
        table = sources[0].base / str(section["cases"]) if "cases" in section else None
    task = task or str(section.get("do", "run"))
    if task not in TASKS:
        raise SceneError(f'{sources[0].name}: sweep.do: "{task}" is not known; use {", ".join(TASKS)}')
    if not over and table is None and len(sources) == 1:
        raise SceneError(
            "nothing is varied; give --over fluid.reynolds=log:0.1:200:17, --cases FILE.csv or a section [sweep]"
        )
    return Request(tuple(sources), tuple(over), together, table, task, tuple(common))


def seconds(text: str) -> float:
    """A time such as 8h, 1h30m, 90s or 1.5d in seconds.

    Raises:
        SceneError: it is not one.
    """
    found = _TIME.fullmatch(text.strip())
    try:
        total = (
            sum(float(part) * unit for part, unit in zip(found.groups(), _UNITS, strict=True) if part)
            if found
            else 0.0
        )
    except ValueError:
        total = 0.0
    if total <= 0.0:
        raise SceneError(f"--wall {text}: is not a time; write it as 8h, 30m or 1h30m")
    return total


def usual_file(request: Request, directory: Path | str = "results") -> Path:
    """Where a sweep is kept if nothing else is said."""
    return Path(directory) / f"{request.sources[0].name}_{request.task}{ENDING}"


def of_python(scenes: Any, over: Any, **others: Any) -> Request:
    """The request of a call from Python: one or several scenes, axes as a mapping. Raises as `requested`."""
    several = scenes if isinstance(scenes, list | tuple) else [scenes]
    return requested([Source.of(one) for one in several], axes.of_mapping(over or {}), **others)

"""The cases that the command line, a section [sweep] or Python ask a sweep for."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import SceneError
from ..progress import Silent
from . import axes
from .axes import VariedKey
from .cases import TASKS, Source, SweepCase, resolved
from .refinement import MOST, QUANTITIES, USUAL, Aim, Family, SweepRefinement, direction

_KEYS = ("over", "zip", "cases", "do", "refine", "most", "quantity")
_KINDS: dict[str, tuple[tuple[type, ...], str]] = {
    "refine": ((int, float), "give a fraction of the range such as 0.01, or true"),
    "most": ((int,), "give a number of cases"),
    "quantity": ((str,), "give the name of a column"),
}
_TIME = re.compile(r"(?:([\d.]+)d)?(?:([\d.]+)h)?(?:([\d.]+)m)?(?:([\d.]+)s?)?")
_UNITS = (86400.0, 3600.0, 60.0, 1.0)


@dataclass(frozen=True)
class RefinementOptions:
    """Options of a refinement: its tolerance, True for the usual one; number of cases; a column. None: not given."""

    refine: float | bool | None = None
    most: int | None = None
    quantity: str | None = None

    def aim(self, section: Mapping[str, Any], name: str, task: str) -> Aim | None:
        """Aim of the refinement, by these options, otherwise by the section [sweep] of the scene of a name.

        Raises:
            SceneError: it cannot be understood, or there is no refinement to which it belongs.
        """
        values = {key: section.get(key) if own is None else own for key, own in vars(self).items()}
        for key, (kinds, remedy) in _KINDS.items():
            if values[key] is not None and not isinstance(values[key], kinds):
                raise SceneError(f"{name}: sweep.{key}: {values[key]!r} does not fit; {remedy}")
        if values["refine"] is None or values["refine"] is False:
            for key in ("most", "quantity"):
                if getattr(self, key) is not None:
                    remedy = "give --refine as well, or leave it out"
                    raise SceneError(f"--{key}: is for a refinement; {remedy}")
            return None
        tolerance = USUAL if values["refine"] is True else float(values["refine"])
        quantity = values["quantity"] or QUANTITIES.get(task, "safety_factor")
        return Aim(quantity, tolerance, MOST if values["most"] is None else values["most"])


@dataclass(frozen=True)
class Request:
    """Sources and how they are varied.

    over: axes; together: they vary side by side; table: a CSV file of cases; task: one of `cases.TASKS`
    common: overrides of all cases; aim: of cases in between, None: there are none
    """

    sources: tuple[Source, ...]
    over: tuple[VariedKey, ...] = ()
    together: bool = False
    table: Path | None = None
    task: str = "run"
    common: tuple[str, ...] = ()
    aim: Aim | None = None

    def cases(self, voice: Silent | None = None) -> list[SweepCase]:
        """The cases, each once; `voice` counts those checked. Raises SceneError."""
        settings = axes.combined(self.over, self.together, self._rows())
        pairs = [(source, one) for source in self.sources for one in settings]
        cases: dict[str, SweepCase] = {}
        for number, (source, one) in enumerate(pairs):
            (voice or Silent()).count("checking cases", number, len(pairs))
            try:
                case = self._case(source, one)
            except SceneError as error:
                which = f"case {number % len(settings) + 1} of {len(settings)}"
                raise SceneError(f"{which} ({', '.join(one) or source.name}): {error}") from None
            cases.setdefault(case.identity, case)
        return list(cases.values())

    def refinement(self, cases: Sequence[SweepCase]) -> SweepRefinement | None:
        """The refinement between these cases, which are all of the request; None without one.

        Raises:
            SceneError: no key with numbers is varied.
        """
        if self.aim is None:
            return None
        along, others = direction(self.over, self.together)
        fixed = axes.combined(others, False, self._rows())
        families = [Family(source, one, along) for source in self.sources for one in fixed]
        return SweepRefinement(families, self.aim, self._case, cases)

    def _rows(self) -> list[axes.Settings]:
        return [] if self.table is None else axes.table_of_cases(self.table)

    def _case(self, source: Source, settings: axes.Settings) -> SweepCase:
        return resolved(source, settings, self.task, self.common)


def requested(
    sources: Sequence[Source],
    over: Sequence[VariedKey] = (),
    together: bool = False,
    table: Path | None = None,
    task: str | None = None,
    common: Sequence[str] = (),
    refined: RefinementOptions = RefinementOptions(),
) -> Request:
    """The request; what is not given is taken from the section [sweep] of the first source, relative to its file.

    Raises:
        SceneError: nothing is varied, or the section cannot be understood.
    """
    section, name = sources[0].section, sources[0].name
    unknown = next((key for key in section if key not in _KEYS), None)
    if unknown is not None:
        raise SceneError(f"{name}: sweep.{unknown}: unknown key; known are {', '.join(_KEYS)}")
    of_section = section.get("over", {})
    if not isinstance(of_section, Mapping):
        raise SceneError(f"{name}: sweep.over: is not a section; write [sweep.over]")
    if not over and table is None:
        over, together = axes.of_mapping(of_section), together or bool(section.get("zip", False))
        table = sources[0].base / str(section["cases"]) if "cases" in section else None
    task = task or str(section.get("do", "run"))
    if task not in TASKS:
        raise SceneError(f'{name}: sweep.do: "{task}" is not known; use {", ".join(TASKS)}')
    if not over and table is None and len(sources) == 1:
        remedy = "give --over fluid.reynolds=log:0.1:200:17, --cases FILE.csv or a section [sweep]"
        raise SceneError(f"nothing is varied; {remedy}")
    aim = refined.aim(section, name, task)
    return Request(tuple(sources), tuple(over), together, table, task, tuple(common), aim)


def parsed_seconds(text: str | float, option: str) -> float:
    """A time such as 8h, 1h30m, 90s or 1.5d, or a number of seconds, of an option. Raises SceneError."""
    match = _TIME.fullmatch(str(text).strip())
    parts = zip(match.groups() if match else (), _UNITS, strict=False)
    try:
        total = sum(float(part) * unit for part, unit in parts if part)
    except ValueError:
        total = 0.0
    if total <= 0.0:
        raise SceneError(f"--{option} {text}: is not a time; write it as 8h, 30m or 1h30m")
    return total

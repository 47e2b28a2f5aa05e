"""What is asked of a sweep, from the command line, a section [sweep] or Python, and the cases that it means."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import SceneError
from ..progress import Silent
from . import axes
from .axes import VariedKey
from .case_refinement import MOST, USUAL, Aim, Family, SweepRefinement
from .cases import TASKS, Source, SweepCase, resolved
from .lattice import directions
from .procedure import FACTOR

ENDING = ".sqlite"
CHECKING = "checking cases"
_KEYS = ("over", "zip", "cases", "do", "refine", "most", "quantity")
_FITS = {
    "refine": "give a share of the range such as 0.01, or true",
    "most": "give a number of cases",
    "quantity": "give the name of a column",
}
_TIME = re.compile(r"(?:([\d.]+)d)?(?:([\d.]+)h)?(?:([\d.]+)m)?(?:([\d.]+)s?)?")
_UNITS = (86400.0, 3600.0, 60.0, 1.0)


@dataclass(frozen=True)
class RefinementOptions:
    """Options of a refinement: its tolerance, True for the usual one; number of cases; a column; None: not given."""

    refine: float | bool | None = None
    most: int | None = None
    quantity: str | None = None

    def aim(self, section: Mapping[str, Any], name: str) -> Aim | None:
        """Aim of the refinement; what is not given is taken from the section [sweep] of the scene of a name.

        Raises:
            SceneError: it cannot be understood, or there is no refinement to which it belongs.
        """
        given = {name: getattr(self, name) for name in ("refine", "most", "quantity")}
        said = {name: section.get(name) if one is None else one for name, one in given.items()}
        for key, kinds in (("refine", (int, float)), ("most", (int,)), ("quantity", (str,))):
            if said[key] is not None and not isinstance(said[key], kinds):
                raise SceneError(f"{name}: sweep.{key}: {said[key]!r} does not fit; {_FITS[key]}")
        if said["refine"] is None or said["refine"] is False:
            extra = next((key for key in ("most", "quantity") if given[key] is not None), None)
            if extra is not None:
                raise SceneError(
                    f"--{extra}: is for a refinement; give --refine too, or leave it out"
                )
            return None
        tolerance = USUAL if said["refine"] is True else float(said["refine"])
        return Aim(tolerance, MOST if said["most"] is None else said["most"], said["quantity"])


@dataclass(frozen=True)
class Request:
    """Sources and how they are varied.

    over: axes; together: they go along side by side; table: a CSV file of cases; task: one of `cases.TASKS`
    common: overrides of all cases; aim: what cases in between are for, None: there are none
    """

    sources: tuple[Source, ...]
    over: tuple[VariedKey, ...] = ()
    together: bool = False
    table: Path | None = None
    task: str = "run"
    common: tuple[str, ...] = field(default=())
    aim: Aim | None = None

    def cases(self, voice: Silent | None = None) -> tuple[list[SweepCase], list[str]]:
        """The cases, each once, and the keys that they vary; `voice` counts those checked. Raises SceneError."""
        settings = self.settings()
        voice, found = voice or Silent(), dict[str, SweepCase]()
        total = len(self.sources) * len(settings)
        for number in range(total):
            voice.count(CHECKING, number, total)
            case = self.case(number, settings)
            found.setdefault(case.identity, case)
        keys = dict.fromkeys(one.partition("=")[0].strip() for each in settings for one in each)
        return list(found.values()), list(keys)

    def settings(self) -> list[axes.Settings]:
        """Settings of each case of a source."""
        return axes.combined(self.over, self.together, self._rows())

    def case(self, number: int, settings: Sequence[axes.Settings]) -> SweepCase:
        """The case of a number: those of the first source come first. Raises as `cases`."""
        source, one = self.sources[number // len(settings)], settings[number % len(settings)]
        which = f"case {number % len(settings) + 1} of {len(settings)}"
        try:
            return self._case(source, one)
        except SceneError as error:
            raise SceneError(f"{which} ({', '.join(one) or source.name}): {error}") from None

    def refinement(self, cases: Sequence[SweepCase]) -> SweepRefinement | None:
        """The refinement between these cases, which are all of the request; None where none is asked for.

        Raises:
            SceneError: it is not one or two keys with numbers that are varied.
        """
        if self.aim is None:
            return None
        ways = directions(self.over, self.together)
        moving = {key.key for way in ways for key in way.keys}
        others = axes.combined(
            [axis for axis in self.over if axis.key not in moving], False, self._rows()
        )
        families = [
            Family(source, fixed, tuple(ways)) for source in self.sources for fixed in others
        ]
        distinct = len({source.name for source in self.sources}) == len(self.sources)
        return SweepRefinement(families, self.aim, self._case, cases if distinct else ())

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
    """The request; what is not said is taken from the section [sweep] of the first source, as relative to its file.

    Raises:
        SceneError: nothing is varied, or the section cannot be understood.
    """
    section = sources[0].section
    unknown = next((name for name in section if name not in _KEYS), None)
    if unknown is not None:
        raise SceneError(
            f"{sources[0].name}: sweep.{unknown}: unknown key; known are {', '.join(_KEYS)}"
        )
    given = section.get("over", {})
    if not isinstance(given, Mapping):
        raise SceneError(f"{sources[0].name}: sweep.over: is not a section; write [sweep.over]")
    if not over and table is None:
        over, together = axes.of_mapping(given), together or bool(section.get("zip", False))
        table = sources[0].base / str(section["cases"]) if "cases" in section else None
    task = task or str(section.get("do", "run"))
    if task not in TASKS:
        raise SceneError(
            f'{sources[0].name}: sweep.do: "{task}" is not known; use {", ".join(TASKS)}'
        )
    if not over and table is None and len(sources) == 1:
        remedy = "give --over fluid.reynolds=log:0.1:200:17, --cases FILE.csv or a section [sweep]"
        raise SceneError(f"nothing is varied; {remedy}")
    aim = refined.aim(section, sources[0].name)
    return Request(tuple(sources), tuple(over), together, table, task, tuple(common), aim)


def parsed_limit(given: str | float | None) -> tuple[float | None, float]:
    """What a case may take: seconds, None where its estimate counts, and times that. Raises SceneError."""
    text = "" if given is None else f"{given}"
    if text.endswith("x"):
        try:
            if (factor := float(text[:-1])) > 1.0:
                return None, factor
        except ValueError:
            pass
        raise SceneError(
            f"--limit {text}: is no multiple above 1 of the estimate; write it as 20x, or a time as 2h"
        )
    return (parsed_seconds(text, "limit") if text else None), FACTOR


def parsed_seconds(text: str, option: str = "wall") -> float:
    """A time such as 8h, 1h30m, 90s or 1.5d in seconds, of an option. Raises SceneError: it is not one."""
    found = _TIME.fullmatch(text.strip())
    parts = zip(found.groups() if found else (), _UNITS, strict=False)
    try:
        total = sum(float(part) * unit for part, unit in parts if part)
    except ValueError:
        total = 0.0
    if total <= 0.0:
        raise SceneError(f"--{option} {text}: is not a time; write it as 8h, 30m or 1h30m")
    return total


def usual_file(request: Request) -> Path:
    """Usual file of a sweep."""
    return Path("results") / f"{request.sources[0].name}_{request.task}{ENDING}"

"""The request of a sweep from the command line, a section [sweep] or Python."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError

from ..errors import SceneError
from ..progress import Silent
from ..scene.messages import one_line, problems_of
from ..scene.section import Section, key
from .cases import Axes, Settings, Source, SweepCase, axes_of, combined, resolved, table_of_cases
from .refinement import MOST, QUANTITIES, USUAL, Aim, SweepRefinement, refined_key


class SweepSection(Section):
    """The section [sweep] of a scene or case."""

    over: dict[str, Any] = key("Values by key", {})
    zip: bool = key("Whether values of several keys vary side by side", False)
    cases: str | None = key("CSV file of cases", None)
    do: Literal["run", "threshold", "gust", "entrainment", "judge"] = key("For each case", "run")
    refine: bool | float | None = key("Fraction of the range, or true", None)
    most: int | None = key("Largest number of cases of a refinement", None)
    quantity: str | None = key("Column that a refinement resolves", None)


class _Swept(Section):
    sweep: SweepSection = key("Variation of keys", SweepSection())


@dataclass(frozen=True)
class Request:
    """Sources and their variation.

    over: axes; together: they vary side by side; table: rows of a file of cases; task: one of `SweepSection.do`
    common: overrides of all cases; aim: of the refinement, None without one
    """

    sources: Sequence[Source]
    over: Axes
    together: bool
    table: Sequence[Settings]
    task: str
    common: Sequence[str]
    aim: Aim | None

    def cases(self, voice: Silent | None = None) -> list[SweepCase]:
        settings = combined(self.over, self.together, self.table)
        pairs = [(source, varied) for source in self.sources for varied in settings]
        cases: dict[str, SweepCase] = {}
        for number, (source, varied) in enumerate(pairs):
            (voice or Silent()).count("checking cases", number, len(pairs))
            try:
                case = self._case(source, varied)
            except SceneError as error:
                which = f"case {number % len(settings) + 1} of {len(settings)}"
                raise SceneError(f"{which} ({', '.join(varied) or source.name}): {error}") from None
            cases.setdefault(case.identity, case)
        return list(cases.values())

    def refinement(self, cases: Sequence[SweepCase]) -> SweepRefinement | None:
        """The refinement between these cases, or None. Raises SceneError if no key with numbers is varied."""
        if self.aim is None:
            return None
        if self.together and len(self.over) > 1:
            remedy = "leave out --zip, or give the others by --cases"
            raise SceneError(f"--refine: refines one key; {remedy}")
        along, texts = refined_key(self.over)
        others = {key: values for key, values in self.over.items() if key != along}
        fixed = combined(others, False, self.table)
        families = [(source, settings) for source in self.sources for settings in fixed]
        identities = {case.identity for case in cases}
        return SweepRefinement(along, texts, families, self.aim, self._case, identities)

    def _case(self, source: Source, settings: Settings) -> SweepCase:
        return resolved(source, settings, self.task, self.common)


def requested(
    sources: Sequence[Source],
    over: Mapping[str, Any] | Sequence[str] = (),
    together: bool = False,
    table: Path | None = None,
    task: str | None = None,
    common: Sequence[str] = (),
    refine: float | bool | None = None,
    most: int | None = None,
    quantity: str | None = None,
) -> Request:
    """The request; missing arguments come from the section [sweep] of the first source.

    refine, most, quantity: tolerance of a refinement, True for the default; number of cases; a column. Raises
    SceneError if nothing is varied, or the section is invalid.
    """
    section, axes, aim = _section_of(sources[0]), axes_of(over), None
    if not axes and table is None:
        axes, together = axes_of(section.over), together or section.zip
        table = sources[0].base / section.cases if section.cases else None
    if not axes and table is None and len(sources) == 1:
        remedy = "give --over fluid.reynolds=log:0.1:200:17, --cases FILE.csv or a section [sweep]"
        raise SceneError(f"nothing is varied; {remedy}")
    task, refine = task or section.do, section.refine if refine is None else refine
    if refine is not None and refine is not False:
        tolerance = USUAL if refine is True else float(refine)
        column = quantity or section.quantity or QUANTITIES.get(task, "safety_factor")
        aim = Aim(column, tolerance, next(n for n in (most, section.most, MOST) if n is not None))
    elif most is not None or quantity is not None:
        option, remedy = "most" if most is not None else "quantity", "give --refine as well"
        raise SceneError(f"--{option}: applies to a refinement; {remedy}, or leave it out")
    rows = [] if table is None else table_of_cases(table)
    return Request(sources, axes, together, rows, task, common, aim)


def _section_of(source: Source) -> SweepSection:
    try:
        section = tomllib.loads(source.text).get("sweep", {})
    except (ValueError, RecursionError):
        section = {}
    try:
        return _Swept.model_validate({"sweep": section}).sweep
    except ValidationError as error:
        raise SceneError(one_line(source.name, problems_of(error, _Swept))) from None


def parsed_seconds(text: str | float, option: str) -> float:
    """Seconds of an option, from a number or text such as 8h, 1h30m, 90s or 1.5d. Raises SceneError."""
    from dask.utils import parse_timedelta

    whole = str(text).replace(" ", "").lower()
    parts = re.findall(r"[\d.]+[a-z]*", whole)
    try:
        total = sum(float(parse_timedelta(part)) for part in parts) * ("".join(parts) == whole)
    except (ValueError, KeyError):
        total = 0.0
    if total <= 0.0:
        raise SceneError(f"--{option} {text}: is not a time; write it as 8h, 30m or 1h30m")
    return total

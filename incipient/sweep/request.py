"""The request of a sweep from the command line, a section [sweep] or Python."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from ..errors import SceneError
from ..progress import Silent
from ..scene.file import parsed_toml
from ..scene.messages import one_line, problems_of
from ..scene.section import Section, key
from .cases import Axes, Settings, Source, SweepCase, axes_of, combined, resolved, table_of_cases
from .refinement import SweepRefinement, refined_key

# Columns that are straight after a refinement unless it names another.
QUANTITIES = {"threshold": "shields", "gust": "strength", "entrainment": "probability"}


class SweepSection(Section):
    """The section [sweep] of a scene or case."""

    over: dict[str, Any] = key("Values by key", {})
    zip: bool = key("Whether values of several keys vary side by side", False)
    cases: str | None = key("CSV file of cases", None)
    do: Literal["run", "threshold", "gust", "entrainment", "judge"] = key("For each case", "run")
    refine: bool | Annotated[float, Field(ge=1e-6, le=1.0)] | None = key(
        "Fraction of the range, or true", None
    )
    most: int = key("Largest number of cases of a refinement", 1000, ge=1)
    quantity: str | None = key("Column that a refinement resolves", None)


class _Swept(Section):
    sweep: SweepSection = key("Variation of keys", SweepSection())


@dataclass(frozen=True)
class Request:
    """Sources and their variation: axes, rows of a file of cases, overrides of all cases, and the section's rest."""

    sources: Sequence[Source]
    axes: Axes
    table: Sequence[Settings]
    common: Sequence[str]
    section: SweepSection

    def cases(self, voice: Silent | None = None) -> list[SweepCase]:
        settings = combined(self.axes, self.section.zip, self.table)
        pairs = [(source, varied) for source in self.sources for varied in settings]
        cases: dict[str, SweepCase] = {}
        for number, (source, varied) in enumerate(pairs):
            (voice or Silent()).count("checking cases", number, len(pairs))
            try:
                case = self.resolve(source, varied)
            except SceneError as error:
                raise SceneError(
                    f"case {number % len(settings) + 1} of {len(settings)} "
                    f"({', '.join(varied) or source.name}): {error}"
                ) from None
            cases.setdefault(case.identity, case)
        return list(cases.values())

    def refinement(self, cases: Sequence[SweepCase]) -> SweepRefinement | None:
        """The refinement between these cases, or None. Raises SceneError if no key with numbers is varied."""
        section = self.section
        if not section.refine:
            return None
        if section.zip and len(self.axes) > 1:
            raise SceneError(
                "--refine: refines one key; leave out --zip, or give the others by --cases"
            )
        along, values = refined_key(self.axes)
        others = {key: texts for key, texts in self.axes.items() if key != along}
        fixed = combined(others, False, self.table)
        return SweepRefinement(
            along,
            values,
            [(source, settings) for source in self.sources for settings in fixed],
            self.resolve,
            {case.identity for case in cases},
            section.quantity or QUANTITIES.get(section.do, "safety_factor"),
            0.02 if section.refine is True else section.refine,
            section.most,
        )

    def resolve(self, source: Source, settings: Settings) -> SweepCase:
        return resolved(source, settings, self.section.do, self.common)


def requested(
    sources: Sequence[Source],
    over: Mapping[str, Any] | Sequence[str] = (),
    table: Path | None = None,
    common: Sequence[str] = (),
    **options: Any,
) -> Request:
    """The request; `options` other than None replace keys of the section [sweep] of the first source.

    Raises SceneError if nothing is varied, or an option or the section is invalid.
    """
    options = {name: option for name, option in options.items() if option is not None}
    axes = axes_of(over)
    if is_given := bool(axes or table):
        options = {"zip": False} | options
    section = _section_of(sources[0], options)
    if not is_given:
        axes = axes_of(section.over)
        table = sources[0].base / section.cases if section.cases else None
    if not axes and table is None and len(sources) == 1:
        raise SceneError(
            "nothing is varied; "
            "give --over fluid.reynolds=log:0.1:200:17, --cases FILE.csv or a section [sweep]"
        )
    for name in ("most", "quantity"):
        if name in options and not section.refine:
            raise SceneError(
                f"--{name}: applies to a refinement; give --refine as well, or leave it out"
            )
    return Request(sources, axes, [] if table is None else table_of_cases(table), common, section)


def _section_of(source: Source, options: dict[str, Any]) -> SweepSection:
    section = parsed_toml(source.text, source.name).get("sweep", {})
    try:
        merged = section | options if isinstance(section, dict) else section
        return _Swept.model_validate({"sweep": merged}).sweep
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

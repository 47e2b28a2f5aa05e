"""The section of error bars: where errors come from, and what would make them smaller."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ..pictures.judged import sentence
from ..results.safetybar import SafetyBar
from .page import Cell, PageSection, Rows, section, table, words
from .verdict import components, turning

# What makes an error smaller, by the name of its term.
REMEDIES = {
    "discretisation": "a smaller numerics.mesh_size or a higher numerics.order; numerics.accuracy chooses them",
    "time step": "a smaller time.step, or a smaller time.tolerance",
    "mesh": "a smaller numerics.mesh_size or a higher numerics.order",
    "gap": "a smaller contact.gap",
    "pocket": "nothing: in the plane what leaks past contacts is not known",
    "domain": "larger domain.length and domain.height",
    "datum": 'flow.datum = "auto", where it is not; a larger domain, slowly',
    "level ground": "a larger numerics.meshed_bed",
    "not steady": "another numerics.mesh_size: the wake changes for ever",
    "interaction": "a smaller contact.gap, larger domain.length and domain.height",
    "search": "nothing: steady flows near the threshold were not found",
}
BOTH = (
    'numerics.accuracy_includes = "all" changes gap and domain until their errors are small, too.'
)


def certainty(stored: dict[str, Any] | None, without: str) -> str:
    """How sure a verdict is, in words, by the error bars of a result."""
    if stored is None:
        return sentence(f"not known: {without or 'error bars were not asked for'}")
    if stored["safety_factor"] is None:
        return ""
    return sentence(bar(stored["safety_factor"]).sentence())


def bar(stored: dict[str, Any]) -> SafetyBar:
    """The range of safety factors as a result holds it, where null is infinite."""

    def ends(found: list[float | None] | None) -> tuple[float, float] | None:
        return None if found is None else (_finite(found[0]), _finite(found[1]))

    numbers = {name: _finite(stored[name]) for name in ("value", "low", "high")}
    ranges = {name: ends(stored[name]) for name in ("some", "every")}
    words_of = {name: tuple(stored[name]) for name in ("modes", "unknown")}
    return SafetyBar(**{**stored, **numbers, **ranges, **words_of})


def of_errors(stored: dict[str, Any] | None, planar: bool) -> tuple[PageSection, ...]:
    """The terms of error bars on force and couple, on elevations, u* or velocities on centrelines, with remedies."""
    if stored is None:
        return ()
    told = [column for column in _columns(planar) if stored.get(column.key) is not None]
    whole = (told[0].size(stored[told[0].key]) if told else 0.0) or math.nan
    rows: Rows = []
    for term in stored["terms"]:
        rows.append(_row(term, term["name"], whole, told))
        rows += [_row(part, f"· {part['name']}", whole, told) for part in term.get("parts", ())]
    if len(stored["terms"]) > 1:
        together = {**stored, "how": "the sum: an error bar is not a standard deviation"}
        rows.append(_row(together, "all", whole, told))
    head = (
        "error",
        *(column.head for column in told),
        "share",
        "estimated by",
        "what makes it smaller",
    )
    others = [(name, "does not count", why) for name, why in stored["left_out"].items()]
    others += [(name, "not computed", why) for name, why in stored["failed"].items()]
    modelled = {"gap", "domain"} & {term["name"] for term in stored["terms"]}
    return section(
        "Errors, and what would shrink them",
        table(head, rows),
        words(BOTH if modelled else ""),
        table(("other errors", "", "why"), others),
    )


@dataclass(frozen=True)
class _Column:
    """A quantity with errors: its key in a term, its name in a table, its errors as a cell and as one number."""

    key: str
    head: str
    cell: Callable[[list[float | None]], Cell]
    size: Callable[[list[float | None]], float]


def _columns(planar: bool) -> tuple[_Column, ...]:
    return (
        _Column("force", "of the force", partial(_vector, planar=planar), _norm),
        _Column("couple", "of the couple", partial(_vector, planar=planar, couple=True), _norm),
        _Column("elevation", "of elevations, at most", _largest, _largest),
        _Column("level", "of elevations at the end", _largest, _largest),
        _Column("shear_velocity", "of u*, at most", _largest, _largest),
        _Column("centreline", "of velocities on centrelines", _largest, _largest),
    )


def _norm(errors: list[float | None]) -> float:
    return float(np.linalg.norm([one or 0.0 for one in errors]))


def _largest(errors: list[float | None]) -> float:
    return max((one or 0.0 for one in errors), default=0.0)


def _row(term: dict[str, Any], name: str, whole: float, told: list[_Column]) -> tuple[Cell, ...]:
    """One term; its share is that of the first of its errors."""
    first = told[0] if told else None
    share = (
        math.nan
        if first is None or term[first.key] is None
        else first.size(term[first.key]) / whole
    )
    return (
        name,
        *("" if term[column.key] is None else column.cell(term[column.key]) for column in told),
        "–" if math.isnan(share) else f"{100 * share:.0f} %",
        term["how"] + _corrected(term),
        REMEDIES.get(name.removeprefix("· "), ""),
    )


def _corrected(term: dict[str, Any]) -> str:
    """What the loads are corrected by for a term, in words; nothing where they are not."""
    found = term.get("correction")
    if found is None:
        return ""
    shares = ((name, _norm(found[name])) for name in ("force", "couple"))
    said = " and ".join(f"the {name} by {size:.2g}" for name, size in shares if size)
    return f"; it corrects {said}, and this is what remains"


def _vector(errors: list[float | None], planar: bool, couple: bool = False) -> Cell:
    known = [math.nan if one is None else one for one in errors]
    return turning(known, planar) if couple else components(known, planar)


def _finite(value: float | None) -> float:
    """A number of a result, where null is infinite."""
    return math.inf if value is None else float(value)

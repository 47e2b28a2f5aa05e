"""The section of error bars: where errors come from, and what would make them smaller."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..pictures.judged import sentence
from ..results.safetybar import SafetyBar
from .page import Cell, Section, section, table, words
from .verdict import components, turning

# What makes an error smaller, by the name of its term.
REMEDIES = {
    "discretisation": "a smaller numerics.mesh_size or a higher numerics.order; numerics.accuracy chooses them",
    "time step": "a smaller time.step, or a smaller time.tolerance",
    "mesh": "a smaller numerics.mesh_size or a higher numerics.order",
    "gap": "a smaller contact.gap",
    "domain": "larger domain.length and domain.height",
    "level ground": "a larger numerics.meshed_bed",
    "search": "nothing: steady flows near the threshold were not found",
}
BOTH = 'numerics.accuracy_includes = "all" changes gap and domain until their errors are small, too.'


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

    changed: dict[str, Any] = {name: _finite(stored[name]) for name in ("value", "low", "high")}
    changed |= {name: ends(stored[name]) for name in ("some", "every")}
    changed |= {name: tuple(stored[name]) for name in ("modes", "unknown")}
    return SafetyBar(**{**stored, **changed})


def of_errors(stored: dict[str, Any] | None, planar: bool) -> tuple[Section, ...]:
    """The terms of error bars on force and couple, with remedies."""
    if stored is None:
        return ()
    whole = float(np.linalg.norm([one or 0.0 for one in stored["force"]])) or math.nan
    rows: list[tuple[Cell, ...]] = []
    for term in stored["terms"]:
        rows.append(_row(term, term["name"], whole, planar))
        rows += [_row(part, f"· {part['name']}", whole, planar) for part in term.get("parts", ())]
    if len(stored["terms"]) > 1:
        rows.append(
            _row({**stored, "how": "the sum: an error bar is not a standard deviation"}, "all", whole, planar)
        )
    head = ("error", "of the force", "of the couple", "share", "how it was found", "what makes it smaller")
    others = [(name, "does not count", why) for name, why in stored["left_out"].items()]
    others += [(name, "not computed", why) for name, why in stored["failed"].items()]
    modelled = {"gap", "domain"} & {term["name"] for term in stored["terms"]}
    return section(
        "Errors, and what would shrink them",
        table(head, rows),
        words(BOTH if modelled else ""),
        table(("other errors", "", "why"), others),
    )


def _row(term: dict[str, Any], name: str, whole: float, planar: bool) -> tuple[Cell, ...]:
    share = float(np.linalg.norm([one or 0.0 for one in term["force"]])) / whole
    return (
        name,
        _vector(term["force"], planar),
        _vector(term["couple"], planar, couple=True),
        "–" if math.isnan(share) else f"{100 * share:.0f} %",
        term["how"],
        REMEDIES.get(name.removeprefix("· "), ""),
    )


def _vector(errors: list[float | None], planar: bool, couple: bool = False) -> Cell:
    known = [math.nan if one is None else one for one in errors]
    return turning(known, planar) if couple else components(known, planar)


def _finite(value: float | None) -> float:
    """A number of a result, where null is infinite."""
    return math.inf if value is None else float(value)

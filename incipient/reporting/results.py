"""Context of the templates of results."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from ..pictures.judged import Judged, judged, pressed, sentence
from ..pictures.record import parsed_json, scene_of
from ..pictures.style import STATES
from ..pictures.verdict import critical_case
from ..planning.effects import percent
from ..results import of_runs
from ..results.accuracy import Omission
from ..results.errorbars import ALL, ERRORS
from ..results.kinds import CRITICAL, OF_RUNS, THRESHOLD
from ..results.quantity import (
    OutputQuantity,
    at,
    components,
    gdim_of,
    remarks,
    separation_words,
    trajectory_sentence,
)
from ..results.result import without_verdict
from ..results.si import HEADING, SI, si_loads
from ..setup.setup import Numbers
from .page import Bounded, erring

Context = dict[str, Any]

# Remedies for errors by the name of the term.
REMEDIES = {
    "discretisation": "a smaller numerics.mesh_size or a higher numerics.order; numerics.accuracy chooses them",
    "time step": "a smaller time.step, or a smaller time.tolerance",
    "mesh": "a smaller numerics.mesh_size or a higher numerics.order",
    "gap": "a smaller contact.gap",
    "facets": "a smaller numerics.mesh_size",
    "pocket": "nothing: in 2-D the leakage past contacts is unknown",
    "domain": "larger domain.length and domain.height",
    "datum": 'flow.datum = "auto", where it is not; a larger domain, slowly',
    "planar far bed": "a larger numerics.meshed_bed",
    "not steady": "another numerics.mesh_size: the wake is unsteady",
    "interaction": "a smaller contact.gap, larger domain.length and domain.height",
    "search": "nothing: steady flows near the threshold did not converge",
}


def context_of(record: Path) -> Context:
    """The context of a record's template.

    Raises OutputError for a damaged record or verdict; KeyError, TypeError, ValueError for an incomplete one.
    """
    stored = parsed_json(record)
    shared = {"stored": stored, "directory": record.parent, "title": stored.get("title") or ""}
    shared |= {"sentence": sentence, "pressed": pressed, "states": STATES, "percent": percent}
    shared |= {"remedies": REMEDIES, "in_si": _in_si}
    special = _SPECIAL.get(record.name)
    return shared if special is None else shared | special(stored, record)


def _of_run(stored: Context, record: Path) -> Context:
    case = None if stored["verdict"] is None else judged(stored["verdict"])
    bars = stored["error_bars"], stored["without_error_bars"]
    return {
        "planar": gdim_of(stored) == 2,
        "budget": partial(_budget, gdim_of(stored) == 2),
        "case": case,
        "statements": _statements(stored, case),
        "certainty": certainty(*bars) if case else "",
        "notes": _notes(stored),
        "plan_numbers": Numbers(**stored["plan"]["numbers"]).named,
        "captions": OF_RUNS,
        "quantities": partial(_rows, stored, of_runs.QUANTITIES),
        "loads": partial(_loads, stored),
        "reverse_flow": separation_words,
        "omissions": [Omission(**omission) for omission in stored["omitted"]],
    }


def _statements(stored: Context, case: Judged | None) -> tuple[str, ...]:
    if case is not None:
        return (*case.sentences, *map(sentence, remarks(stored["verdict"], stored["scene"])))
    path, why = stored["trajectory"], without_verdict(stored)
    missing = sentence(f"there is no verdict: {why or 'the scene asks for none'}")
    return (missing,) if path is None else (trajectory_sentence(path), missing if why else "")


def _notes(stored: Context) -> list[str]:
    notes = []
    if stored["status"] != "complete":
        why = stored["error"] or "its numbers are preliminary"
        notes.append(sentence(f"the run is {stored['status']}: {why}"))
    if stored["gap"] is not None and not stored["gap"]["resolved"]:
        remedy = "give a smaller numerics.mesh_size"
        notes.append(f"The gap between grain and bed is not resolved: {remedy}.")
    return notes


def _rows(
    stored: Context, quantities: Sequence[OutputQuantity], heading: str
) -> list[tuple[str, Any]]:
    rows: list[tuple[str, Any]] = []
    for quantity in quantities:
        if quantity.heading == heading and (value := quantity.value(stored)) is not None:
            bar = quantity.bar(stored)
            rows.append((quantity.label, value if bar is None else Bounded(value, *bar)))
    return rows


def _loads(stored: Context, unit: str) -> list[list[Any]]:
    gdim = gdim_of(stored)
    axes = range(gdim) if gdim == 3 or unit == "force" else (2,)
    rows = []
    for load in of_runs.QUANTITIES:
        if load.heading == unit and (value := load.shown(stored)) is not None:
            errors = (at(stored, load.error) if load.error else None) or [None] * 3
            rows.append([load.words, *(erring(value[axis], errors[axis]) for axis in axes)])
    return rows


def _budget(planar: bool, bars: Context) -> tuple[list[str], list[list[Any]]]:
    keys = [key for key in ERRORS if bars.get(key) is not None]
    whole = _size(bars, keys[0]) if keys else 0.0
    terms = [
        named
        for term in bars["terms"]
        for named in (term, *({**part, "name": f"· {part['name']}"} for part in term["parts"]))
    ]
    if len(bars["terms"]) > 1:
        terms.append({**bars, "name": "all", "how": ALL})
    rows = []
    for term in terms:
        cells = [term["name"], *(_error(term, key, planar) for key in keys)]
        known = whole and term[keys[0]] is not None
        cells.append(f"{100 * _size(term, keys[0]) / whole:.0f} %" if known else "–")
        remedy = REMEDIES.get(term["name"].removeprefix("· "), "")
        rows.append([*cells, term["how"] + _corrected(term), remedy])
    heads = ["error", *(ERRORS[key] for key in keys), "fraction", "estimated by", "reduced by"]
    return heads, rows


def _error(term: Context, key: str, planar: bool) -> Any:
    if term[key] is None:
        return ""
    if key not in ("force", "torque"):
        return _size(term, key)
    known = [math.nan if error is None else error for error in term[key]]
    return components(known, planar, key)


def _size(term: Context, key: str) -> float:
    known = [error or 0.0 for error in term[key]]
    return math.hypot(*known) if key in ("force", "torque") else max(known, default=0.0)


def _in_si(values: Context | None) -> list[tuple[str, Any]]:
    if values is None:
        return []
    loads = [
        (f"{name.replace('_', ' ')} of the flow [{unit}]", words)
        for name, words, unit in si_loads(values)
    ]
    named = (("length", "m"), ("time", "s"), ("velocity", "m/s"), ("stress", "Pa"))
    units = [(f"one unit of {name} of the scene [{u}]", values["units"][name]) for name, u in named]
    return [*_rows({"si": values}, SI, HEADING), *loads, *units]


def _of_threshold(stored: Context, record: Path) -> Context:
    scene = scene_of(record.parent)
    return {
        "title": scene.title,
        "planar": scene.gdim == 2,
        "budget": partial(_budget, scene.gdim == 2),
        "critical": _rows(stored, THRESHOLD.quantities, CRITICAL),
        "case": critical_case(stored, scene),
        "statements": [sentence(stored["sentence"]), *(f"{note}." for note in stored["notes"])],
        "certainty": certainty(stored["error_bars"], stored["without_error_bars"]),
    }


def _of_judgement(stored: Context, record: Path) -> Context:
    case = judged(stored["verdict"])
    return {"case": case, "statements": case.sentences}


_SPECIAL: dict[str, Callable[[Context, Path], Context]] = {
    "result.json": _of_run,
    "threshold.json": _of_threshold,
    "judgement.json": _of_judgement,
}


def certainty(stored: Context | None, without: str) -> str:
    """The certainty of a verdict as text, from the error bars."""
    if stored is None:
        return sentence(f"not known: {without or 'error bars were not asked for'}")
    bar = stored.get("safety_factor")
    return "" if bar is None else sentence(bar["sentence"])


def _corrected(term: Context) -> str:
    if (correction := term.get("correction")) is None:
        return ""
    sizes = {"force": math.hypot(*correction["force"]), "torque": math.hypot(*correction["torque"])}
    said = " and ".join(f"the {name} by {size:.2g}" for name, size in sizes.items() if size)
    return f"; it corrects {said}, and this is what remains"

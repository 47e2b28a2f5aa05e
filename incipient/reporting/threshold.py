"""What a page says of a critical flow."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..pictures.judged import judged, sentence
from ..pictures.record import parsed_json
from ..pictures.verdict import critical_sentence, with_motion
from ..scene import load
from .errors import REMEDIES, of_errors
from .expense import of_adaptation, of_cost, versions
from .page import Erring, PagePart, PageSection, Rows, picture_beside, section, table, words
from .units import of_si
from .verdict import of_contacts, of_judges, of_load

NAMES = {
    "factor": "critical flow over that of the scene",
    "computed": "the same for the load without corrections",
    "shields": "critical Shields number",
    "shields_nominal": "the same with the nominal diameter",
    "reynolds": "critical Reynolds number of the scene",
    "shear_reynolds": "shear Reynolds number u* d/ν",
}


def part(record: Path) -> PagePart:
    """What a page says of a threshold.json."""
    stored = parsed_json(record)
    scene = load(record.parent / "scene.toml")
    case = judged(with_motion(stored, scene.body, scene.placement), record)
    bars = stored["error_bars"]
    trials = [(one["factor"], one["safety_factor"]) for one in stored["trials"]]
    drawn = picture_beside(record, "The grain as it begins to move")
    return PagePart(
        kind="Critical flow",
        title=scene.title,
        statements=(critical_sentence(stored), *(f"{note}." for note in stored["notes"])),
        certainty=_certainty(stored),
        sections=(
            *section("Critical numbers", table(("", "value"), _numbers(stored)), drawn),
            *of_si(stored.get("si")),
            *of_load(case),
            *of_contacts(case),
            *of_judges(stored["verdict"], case),
            *_of_factor(bars),
            *of_errors(None if bars is None else bars["load"], scene.gdim == 2),
            *section("Flows solved", table(("times the scene's", "safety factor"), trials)),
            *of_adaptation(stored["adaptation"]),
            *of_cost(stored["cost"]),
        ),
        versions=versions(stored["cost"]),
    )


def _numbers(stored: dict[str, Any]) -> Rows:
    errors = stored["errors"]
    return [
        (name, stored[key] if errors.get(key) is None else Erring(stored[key], errors[key]))
        for key, name in NAMES.items()
        if stored.get(key) is not None
    ]


def _certainty(stored: dict[str, Any]) -> str:
    if stored["error_bars"] is None:
        return (
            sentence(f"not known: {stored['without_error_bars']}")
            if stored["without_error_bars"]
            else ""
        )
    factor = stored["error_bars"]["factor"]
    if factor["error"] is None:
        return "The error of the critical flow is without bound."
    largest = max(
        factor["terms"], key=lambda name: factor["terms"][name] or float("inf"), default=""
    )
    high = "without bound" if factor["high"] is None else f"{factor['high']:.4g}"
    said = f"Between {factor['low']:.4g} and {high} times the flow of the scene"
    return f"{said}; most of the error is that of the {largest}." if largest else f"{said}."


def _of_factor(bars: dict[str, Any] | None) -> tuple[PageSection, ...]:
    if bars is None:
        return ()
    rows = [
        (name, error, REMEDIES.get(name, "")) for name, error in bars["factor"]["terms"].items()
    ]
    told = words("Each line is the largest error of the factor that one source makes alone.")
    head = ("error", "of the factor", "what makes it smaller")
    return section("Error of the critical flow", told if rows else None, table(head, rows))

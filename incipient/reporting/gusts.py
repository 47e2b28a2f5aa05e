"""What a page says of the weakest gusts that move a grain out of its pocket."""

from __future__ import annotations

from pathlib import Path

from ..pictures.record import parsed_json
from .page import Erring, PagePart, Rows, picture_beside, section, table


def part(record: Path) -> PagePart:
    """What a page says of a gusts.json."""
    stored = parsed_json(record)
    rows: Rows = []
    for one in stored["points"]:
        strength = (
            one["strength"] if one["error"] is None else Erring(one["strength"], one["error"])
        )
        rows.append(
            (one["duration"], strength, one["held"], one["leaves"], one["impulse"], one["runs"])
        )
    names = ("duration", "strength", "stays at", "leaves at", "(strength - 1) x duration", "runs")
    drawn = picture_beside(record, "The weakest gusts that move the grain out of its pocket")
    return PagePart(
        kind="Critical gusts",
        title=stored["title"] or "Critical gusts",
        statements=(
            f"A steady flow moves the grain from {stored['static']:.4g} times its strength on.",
        ),
        sections=(*section("Picture", drawn), *section("Gusts", table(names, rows))),
    )

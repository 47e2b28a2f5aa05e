"""What a page says of motion in a fluctuating stream."""

from __future__ import annotations

from pathlib import Path

from ..pictures.record import parsed_json
from .page import Erring, PagePart, Rows, picture_beside, section, table


def part(record: Path) -> PagePart:
    """What a page says of an entrainment.json."""
    stored = parsed_json(record)
    rows: Rows = []
    for one in stored["quantiles"]:
        shields = one["shields"] if one["error"] is None else Erring(one["shields"], one["error"])
        rows.append((one["probability"], shields, one["strength"], one["rate"]))
    names = (
        "probability at an instant",
        "Shields number",
        "flow over the scene's",
        "exceeded anew in unit time",
    )
    drawn = picture_beside(record, "Probability of motion at an instant against the Shields number")
    steady, own = stored["threshold"], stored["scene"]
    statements = (
        f"A steady flow moves the grain from Shields number {steady['shields']:.4g} on, {steady['mode']}.",
        f"In the scene's mean flow motion at an instant has the probability {own['probability']:.3g}.",
        *(f"Assumed: {one}." for one in stored["assumed"]),
    )
    return PagePart(
        kind="Entrainment",
        title=stored["title"] or "Motion in a fluctuating stream",
        statements=statements,
        sections=(
            *section("Picture", drawn),
            *section("Mean flows by probability", table(names, rows)),
        ),
    )

"""What a page says of a survey of a bed of grains."""

from __future__ import annotations

from pathlib import Path

from ..pictures.record import parsed_json
from .page import PagePart, picture_beside, section, table


def part(record: Path) -> PagePart:
    """What a page says of a survey.json."""
    stored = parsed_json(record)
    bed, emulator = stored["bed"], stored["emulator"]
    statements = [
        f"{bed['grains']} grains, {stored['exposed']} of them exposed; {stored['free']} of these carry no other.",
    ]
    if emulator is not None:
        statements.append(
            f"{emulator['runs']} full runs. The drag of a run is foretold by four fifths of them with an error of "
            f"{emulator['error']:.1%}, by a bar of {emulator['bar']:.1%}; {emulator['to_halve']} more runs would halve "
            f"the mean bar. Bars hold with a probability of {emulator.get('level', 0.95):.0%}."
        )
    pivots = [(one["percentile"], one["pivot"], one["kirchner"]) for one in stored["pivots"]]
    others = {one["percentile"]: one["shields"] for one in stored["constant_drag"]}
    found = [
        (one["percentile"], one["shields"], one["low"], one["high"], others.get(one["percentile"]))
        for one in stored["distribution"]
    ]
    heads = (
        "percentile",
        "critical Shields number",
        "low",
        "high",
        "one drag coefficient and a log law",
    )
    drawn = picture_beside(record, "The bed from above, and distributions over its grains")
    return PagePart(
        kind="Survey",
        title=stored["title"] or "A bed of grains",
        statements=tuple(statements),
        sections=(
            *section("Picture", drawn),
            *(section("Critical Shields numbers", table(heads, found)) if found else ()),
            *section(
                "Pivot angles",
                table(("percentile", "pivot angle [degrees]", "Kirchner et al. 1990"), pivots),
            ),
        ),
    )

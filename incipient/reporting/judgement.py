"""What a page says of a judged case, and of a judged series of loads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import tomli_w

from ..pictures.judged import judged, sentence
from ..pictures.record import parsed_json
from .page import PagePart, PageSection, Rows, picture_beside, section, table
from .verdict import of_contacts, of_judges, of_load, statements

MOST_EVENTS = 50  # of a series, listed


def part(record: Path) -> PagePart:
    """What a page says of a judgement.json."""
    stored = parsed_json(record)
    case, chances = judged(stored["verdict"], record), stored["probabilities"]
    return PagePart(
        kind="Judged case",
        title=stored["title"] or "A case",
        statements=statements(case, stored["verdict"]),
        certainty="" if chances is None else sentence(chances["sentence"]),
        sections=(
            *section("Picture", picture_beside(record, "The load, and the forces at the contacts")),
            *of_load(case),
            *of_contacts(case),
            *of_judges(stored["verdict"], case),
            *_probabilities(chances),
        ),
        scene=tomli_w.dumps(stored["case"]) if stored.get("case") else "",
    )


def _probabilities(chances: dict[str, Any] | None) -> tuple[PageSection, ...]:
    if chances is None:
        return ()
    likely = sorted(chances["equilibrium"].items(), key=lambda item: -item[1]["value"])
    rows = [(mode, chance["value"], sentence(chance["words"])) for mode, chance in likely]
    heading = f"Probabilities, by {chances['samples']} samples"
    return section(heading, table(("mode", "probability", ""), rows))


def part_of_series(record: Path) -> PagePart:
    """What a page says of a series.json."""
    stored = parsed_json(record)
    shares, events = stored["shares"], stored["events"]
    longest = sorted(events, key=lambda event: -event["length"])[:MOST_EVENTS]
    rows: Rows = [
        (one["start"], one["length"], one["mode"], one["impulse"], one["least"]) for one in longest
    ]
    numbers: Rows = [
        ("samples", stored["samples"]),
        ("from", stored["start"]),
        ("to", stored["end"]),
        ("least safety factor", stored["least_safety_factor"]),
        ("events", len(events)),
    ]
    moving = sum(share for mode, share in shares.items() if mode != "rest")
    listed = (
        "Events"
        if len(events) <= MOST_EVENTS
        else f"The {MOST_EVENTS} longest of {len(events)} events"
    )
    drawn = picture_beside(record, "The safety factor in time")
    return PagePart(
        kind="Judged series",
        title="A series of loads",
        statements=(
            f"The grain is set in motion {len(events)} times, {100 * moving:.3g} % of the time.",
        ),
        sections=(
            *section("Series", table(("", "value"), numbers), drawn),
            *section("Shares of time", table(("mode", "share"), list(shares.items()))),
            *section(
                listed,
                table(("begins at", "lasts", "mode", "impulse", "least safety factor"), rows),
            ),
        ),
    )

"""What a page says of a study of what accuracy costs."""

from __future__ import annotations

from pathlib import Path

from ..pictures.record import parsed_json
from .page import PagePart, Rows, picture_beside, section, table

COLUMNS = {
    "name": "run",
    "error": "relative error",
    "cpu": "processor [s]",
    "wall": "wall time [s]",
    "unknowns": "unknowns",
    "peak_mib": "memory [MiB]",
}


def part(record: Path) -> PagePart:
    """What a page says of a cost.json."""
    stored = parsed_json(record)
    reference = stored["reference"]
    values: Rows = [
        (name.replace("_", " "), value, reference["uncertainty"].get(name))
        for name, value in reference["values"].items()
    ]
    runs: Rows = [(*(one[key] for key in COLUMNS), bool(one["on_front"])) for one in stored["runs"]]
    return PagePart(
        kind="What accuracy costs",
        title=stored["title"] or "What accuracy costs",
        statements=(f"{stored['words'][0].upper()}{stored['words'][1:]}.",),
        sections=(
            *section("Picture", picture_beside(record, "Error against time")),
            *section(f"Reference: {reference['run']}", table(("", "value", "uncertainty"), values)),
            *section("Runs", table((*COLUMNS.values(), "none better"), runs)),
        ),
    )

"""What a page says of a study of what accuracy costs."""

from __future__ import annotations

from pathlib import Path

from ..pictures.record import parsed_json
from .page import PagePart, Rows, picture_beside, section, table

COLUMNS = {
    "name": "run",
    "error": "relative error",
    "cpu": "CPU time [s]",
    "wall": "wall time [s]",
    "unknowns": "unknowns",
    "peak_mib": "memory [MiB]",
}


def part(record: Path) -> PagePart:
    """What a page says of a cost.json."""
    stored = parsed_json(record)
    reference = stored["reference"]
    values: Rows = [
        (name.replace("_", " "), value)
        for quantity in reference["quantities"].values()
        for name, value in quantity["numbers"].items()
    ]
    runs: Rows = [
        (*(run[key] for key in COLUMNS), bool(run["on_frontier"])) for run in stored["judged"]
    ]
    return PagePart(
        kind="What accuracy costs",
        title=stored["title"] or "What accuracy costs",
        statements=(stored["sentence"],),
        sections=(
            *section("Picture", picture_beside(record, "Error against time")),
            *section(f"Reference: {reference['source']}", table(("", "value"), values)),
            *section("Runs", table((*COLUMNS.values(), "on the frontier"), runs)),
        ),
    )

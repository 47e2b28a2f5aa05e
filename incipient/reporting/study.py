"""What a page says of a study of what accuracy costs."""

from __future__ import annotations

from pathlib import Path

from ..pictures.record import parsed_json
from .page import Cell, PagePart, Picture, section, table


def part(record: Path) -> PagePart:
    """What a page says of a cost.json."""
    stored, picture = parsed_json(record), record.with_suffix(".png")
    reference = stored["reference"]
    values: list[tuple[Cell, ...]] = [
        (name.replace("_", " "), value, reference["uncertainty"].get(name))
        for name, value in reference["values"].items()
    ]
    runs: list[tuple[Cell, ...]] = [
        (
            one["name"],
            one["error"],
            one["cpu"],
            one["wall"],
            one["unknowns"],
            one["peak_mib"],
            bool(one["on_front"]),
        )
        for one in stored["runs"]
    ]
    heads = (
        "run",
        "relative error",
        "processor [s]",
        "wall time [s]",
        "unknowns",
        "memory [MiB]",
        "none better",
    )
    drawn = Picture(picture, "Error against time") if picture.is_file() else None
    return PagePart(
        kind="What accuracy costs",
        title=stored["title"] or "What accuracy costs",
        statements=(f"{stored['words'][0].upper()}{stored['words'][1:]}.",),
        sections=(
            *section("Picture", drawn),
            *section(f"Reference: {reference['run']}", table(("", "value", "uncertainty"), values)),
            *section("Runs", table(heads, runs)),
        ),
    )

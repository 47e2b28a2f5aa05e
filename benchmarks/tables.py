"""Tables in Markdown, and numbers as they stand in them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parents[1] / "docs"

Row = dict[str, Any]


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table whose first column is text and the others numbers."""
    rule = [":--", *["--:"] * (len(heads) - 1)]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (heads, rule, *rows))


def publish(name: str, text: str) -> None:
    """Write a table between the marks of its name in whichever page of docs/ has them; print it, too."""
    print(text)
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    for page in sorted(DOCS.rglob("*.md")):
        before, found, rest = page.read_text(encoding="utf-8").partition(begin)
        if found:
            after = rest.partition(end)[2]
            page.write_text(f"{before}{begin}\n{text}\n{end}{after}", encoding="utf-8")


def small(number: float) -> str:
    """An error: two digits."""
    return f"{number:.1e}"


def seconds(number: float) -> str:
    """A time: three digits or hundredths."""
    return f"{number:.2f}" if number < 100 else f"{number:.0f}"


def mebibytes(number: float) -> str:
    """Memory, in whole MiB."""
    return f"{number:.0f}"


def expense(row: Row) -> list[str]:
    """Cells for processor time and memory, or dashes for a program that could not run."""
    if "error" in row:
        return ["-", "-"]
    return [seconds(row["cpu"]), mebibytes(row["peak_mib"])]


def failures(rows: Iterable[Row]) -> str:
    """A sentence for each program that could not run."""
    lines = [
        f"*{row['name']}* could not run here: `{row['error']}`." for row in rows if "error" in row
    ]
    return "\n".join(lines)


def cheapest(rows: Iterable[Row], reaches: Callable[[Row], bool]) -> dict[str, Row]:
    """For each family of programs the one of least wall time that reaches the accuracy asked for."""
    best: dict[str, Row] = {}
    for row in rows:
        if "error" in row or not reaches(row):
            continue
        known = best.get(row["family"])
        if known is None or row["wall"] < known["wall"]:
            best[row["family"]] = row
    return best

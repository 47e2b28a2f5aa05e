"""Tables in Markdown and the numbers in them; files of numbers: CSV, JSON."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"

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
        before, mark, rest = page.read_text(encoding="utf-8").partition(begin)
        if mark:
            after = rest.partition(end)[2]
            page.write_text(f"{before}{begin}\n{text}\n{end}{after}", encoding="utf-8")


def read_rows(path: Path) -> list[Row]:
    """Rows of a CSV file by its heads, numbers as such; lines that begin with # are comments."""
    with path.open(encoding="utf-8") as lines:
        texts = csv.DictReader(line for line in lines if not line.startswith("#"))
        return [{name: _number(text) for name, text in row.items()} for row in texts]


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def read_json(path: Path, default: Any = None) -> Any:
    """Stored results; the default where there are none yet."""
    return json.loads(path.read_text()) if path.exists() else default


def write_json(path: Path, results: Any) -> None:
    """Store results."""
    path.write_text(json.dumps(results, indent=1) + "\n")


def small(number: float) -> str:
    """An error: two digits."""
    return f"{number:.1e}"


def seconds(number: float) -> str:
    """A time: three digits or hundredths."""
    return f"{number:.2f}" if number < 100 else f"{number:.0f}"


def failures(rows: Iterable[Row]) -> str:
    """A sentence for each program that could not run."""
    return "\n".join(
        f"*{row['name']}* could not run here: `{row['error']}`." for row in rows if "error" in row
    )


def cheapest(rows: Iterable[Row], reaches: Callable[[Row], bool]) -> dict[str, Row]:
    """For each family of programs the one of least wall time that reaches the accuracy asked for."""
    best: dict[str, Row] = {}
    for row in rows:
        if "error" not in row and reaches(row):
            known = best.get(row["family"], row)
            best[row["family"]] = min(known, row, key=lambda each: each["wall"])
    return best

"""Context of the template of sweeps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w

from ..errors import OutputError
from ..pictures import draw_apart
from ..results.quantity import HIGH, LOW
from ..results.si import SI
from ..sweep.store import DONE, FAILED, Store
from ..sweep.table import rows
from .page import Bounded

# Columns of results, if present.
RESULTS = (
    *("mode", "safety_factor", "certain", "factor"),
    *("shields", "shields_nominal", "reynolds", "shear_reynolds"),
    *(*(quantity.column for quantity in SI if quantity.column), "paper", "note"),
)
FIRST = 300  # number of cases on a page
LAST = ("wall", "cpu", "peak_mib")
HEADS = {
    "wall": "wall time [s]",
    "cpu": "CPU time [s]",
    "peak_mib": "memory [MiB]",
    **{quantity.column: quantity.label for quantity in SI if quantity.column},
}
NAMES = {"map": "Modes over two parameters", "threshold": "Critical Shields numbers"}
Row = Mapping[str, Any]


def context_of(file: Path) -> dict[str, Any]:
    """The context of a sweep's page, with new pictures. Raises OutputError for an invalid or empty file."""
    with Store(file) as store:
        keys, scenes = store.keys(), _scenes(store)
    every = rows(file)
    if not every:
        raise OutputError(f"{file}: holds no case; fill it with incipient sweep")
    drawn, first_rows = draw_apart(file), every[:FIRST]
    done, failed = (
        [row for row in first_rows if row["status"] == state] for state in (DONE, FAILED)
    )
    counts = Counter(row["status"] for row in every)
    named = [key for key in ("source", *keys) if len({str(row.get(key)) for row in first_rows}) > 1]
    sources = ", ".join(dict.fromkeys(str(row["source"]) for row in first_rows))
    rest = len(every) - counts[DONE] - counts[FAILED]
    counted = f"{len(every)} cases: {counts[DONE]} computed, {counts[FAILED]} failed"
    counted += f", {rest} not computed yet." if rest else "."
    counted += f" Tables are of the first {FIRST}." if len(every) > FIRST else ""
    columns = [name for name in (*RESULTS, *LAST) if any(name in row for row in done)]
    return {
        "title": f"Sweep of {sources}",
        "counted": counted,
        "notes": [f"Pictures that are missing here: {drawn.complaint}."] if drawn.complaint else [],
        "pictures": {path: _caption(path, file) for path in drawn.paths},
        "named": named,
        "heads": ["case", *named, *(HEADS.get(name, name.replace("_", " ")) for name in columns)],
        "cases": [
            [*(row.get(key) for key in named), *(_cell(row, name) for name in columns)]
            for row in done
        ],
        "failed": [
            [*(row.get(key) for key in named), str(row["reason"]), int(row["tries"])]
            for row in failed
        ],
        "scenes": scenes,
        "versions": list(dict.fromkeys(row["versions"] for row in done if row["versions"])),
    }


def _scenes(store: Store) -> dict[str, str]:
    first: dict[str, Any] = {}
    for case in store.cases():
        first.setdefault(case["source"], case["scene"])
    return {source: tomli_w.dumps(scene) for source, scene in first.items()}


def _caption(path: Path, file: Path) -> str:
    name = path.stem.removeprefix(f"{file.stem}_").replace("_", " ")
    return NAMES.get(name, name.capitalize())


def _cell(row: Row, name: str) -> Any:
    value = row.get(name)
    if value is None or row.get(name + LOW) is None:
        return value
    return Bounded(value, row[name + LOW], row[name + HIGH])

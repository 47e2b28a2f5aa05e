"""What a page says of the file of a sweep."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import tomli_w

from ..errors import OutputError
from ..pictures.apart import draw_sweep_apart
from ..results.quantity import HIGH, LOW
from ..results.si import FLOW
from ..sweep.store import DONE, FAILED, Store
from ..sweep.table import rows
from .page import Bounded, Cell, PagePart, Picture, Settings, section, table

# Columns that say what came out, where there are any.
FOUND = (
    *("mode", "safety_factor", "certain", "factor"),
    *("shields", "shields_nominal", "reynolds", "shear_reynolds"),
    *(*(f"{name}_si" for name in FLOW), "paper", "note"),
)
FIRST = 300  # cases that a page has
LAST = ("wall", "cpu", "peak_mib")
HEADS = {
    "wall": "wall time [s]",
    "cpu": "processor [s]",
    "peak_mib": "memory [MiB]",
    **{f"{name}_si": f"{words} [{unit}]" for name, (unit, words) in FLOW.items()},
}
Row = Mapping[str, Any]


def part(file: Path) -> PagePart:
    """What a page says of a sweep, with new pictures. Not collective; raises OutputError for a bad or empty file."""
    with Store(file) as store:
        keys, scenes = store.keys(), _scenes(store)
    every = rows(file)
    if not every:
        raise OutputError(f"{file}: holds no case; fill it with incipient sweep")
    drawn, found = draw_sweep_apart(file), every[:FIRST]
    done, failed = ([row for row in found if row["status"] == state] for state in (DONE, FAILED))
    counts = Counter(row["status"] for row in every)
    named = [key for key in ("source", *keys) if len({str(row.get(key)) for row in found}) > 1]
    sources = ", ".join(dict.fromkeys(str(row["source"]) for row in found))
    rest = len(every) - counts[DONE] - counts[FAILED]
    counted = f"{len(every)} cases: {counts[DONE]} computed, {counts[FAILED]} failed"
    counted += f", {rest} not computed yet." if rest else "."
    counted += f" Tables are of the first {FIRST}." if len(every) > FIRST else ""
    varied = table(("key", "values", "how many"), [_varied(key, found) for key in named])
    first = [section(f"First case of {name}", Settings(text)) for name, text in scenes.items()]
    return PagePart(
        kind="Sweep",
        title=f"Sweep of {sources}",
        statements=(counted,),
        notes=(f"Pictures that are missing here: {drawn.complaint}.",) if drawn.complaint else (),
        sections=(
            *section("Curves", *(Picture(path, _caption(path, file)) for path in drawn.paths)),
            *section("What varies", varied),
            *section("Cases", _cases(done, named)),
            *section("Failed cases", _failed(failed, named)),
            *chain.from_iterable(first),
        ),
        versions="; ".join(dict.fromkeys(row["versions"] for row in done if row["versions"])),
    )


def _scenes(store: Store) -> dict[str, str]:
    """The scene of the first case of each source, as TOML."""
    first: dict[str, str] = {}
    for case in store.cases():
        if case["source"] not in first:
            first[case["source"]] = tomli_w.dumps(case["scene"])
    return first


def _caption(path: Path, file: Path) -> str:
    name = path.stem.removeprefix(f"{file.stem}_").replace("_", " ")
    named = {"map": "Modes over two parameters", "threshold": "Critical Shields numbers"}
    return named.get(name, name.capitalize())


def _varied(key: str, found: Sequence[Row]) -> tuple[Cell, ...]:
    values = list(dict.fromkeys(row.get(key) for row in found))
    shown = [f"{one:.6g}" if isinstance(one, float) else str(one) for one in values]
    listed = ", ".join(shown) if len(shown) <= 8 else f"{', '.join(shown[:4])} … {shown[-1]}"
    return key, listed, len(values)


def _cases(done: Sequence[Row], named: Sequence[str]) -> Any:
    """A row a case; columns that none of them has are left out."""
    columns = [name for name in (*FOUND, *LAST) if any(name in row for row in done)]
    heads = [HEADS.get(name, name.replace("_", " ")) for name in columns]
    cells = [
        (str(number), *(row.get(key) for key in named), *(_cell(row, name) for name in columns))
        for number, row in enumerate(done, start=1)
    ]
    return table(("case", *named, *heads), cells)


def _cell(row: Row, name: str) -> Cell:
    value = row.get(name)
    if value is None or row.get(name + LOW) is None:
        return value
    return Bounded(value, row[name + LOW], row[name + HIGH])


def _failed(failed: Sequence[Row], named: Sequence[str]) -> Any:
    cells = [
        (str(number), *(row.get(key) for key in named), str(row["reason"]), int(row["tries"]))
        for number, row in enumerate(failed, start=1)
    ]
    return table(("case", *named, "why", "tries"), cells)

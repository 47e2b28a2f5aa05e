"""One self-contained HTML page of a result directory or the file of a sweep."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import tomli_w
from jinja2 import UndefinedError
from markupsafe import Markup

from ..errors import OutputError, SceneError
from ..files import require_ending, require_own, write_text_atomically
from ..pictures import Drawn, draw_apart
from ..results.kinds import KINDS, ResultKind
from ..results.quantity import HIGH, LOW, at
from ..results.si import SI
from ..sweep.store import DONE, FAILED, Store
from ..sweep.table import rows
from . import results
from .page import TEMPLATES, Bounded, rendered

NAME = "report.html"
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
CAPTIONS = {"map": "Modes over two parameters", "threshold": "Critical Shields numbers"}


def write(path: Path, target: Path | None = None) -> Path:
    """Write the page of a result directory, or of the file of a sweep; returns its path.

    Missing and outdated pictures are drawn first. Default of `target`: DIRECTORY/report.html, or SWEEP_report.html.
    Raises SceneError without a result there, OutputError for a damaged result or a page that is not writable.
    """
    if target is not None:
        require_ending(target, ".html")
        require_own(target)
    if path.is_file():
        text, usual = of_sweep(path), path.with_name(f"{path.stem}_{NAME}")
    else:
        text, usual = of_directory(path), path / NAME
    target = target or usual
    write_text_atomically(target, text)
    return target


def of_directory(directory: Path) -> str:
    """The page of a result directory; missing pictures are drawn. Raises as `write`."""
    kinds = [kind for kind in KINDS if (directory / kind.record).is_file()]
    if not kinds:
        why = "holds no result yet" if directory.is_dir() else "there is no such file or directory"
        raise SceneError(
            f"{directory}: {why}; give the directory that a run was written to, or a sweep's file"
        )
    are_drawn = all(_is_drawn(directory, kind) for kind in kinds)
    notes = [] if are_drawn else _missing(draw_apart(directory))
    parts = [part(directory / kind.record, notes) for kind in kinds]
    contexts = [context for _, context in parts]
    stored = [context["stored"] for context in contexts]
    scene = directory / "scene.toml"
    scenes = [scene.read_text(encoding="utf-8")] if scene.is_file() else []
    scenes += [tomli_w.dumps(result["case"]) for result in stored if result.get("case")]
    versions = [at(result, "cost.versions") or {} for result in stored]
    computed = [", ".join(f"{name} {number}" for name, number in each.items()) for each in versions]
    title = contexts[0]["title"] or kinds[0].title or directory.resolve().name
    return _page(title, [text for text, _ in parts], scenes, list(filter(None, computed)))


def of_sweep(file: Path) -> str:
    """The page of the file of a sweep, with new pictures. Raises SceneError for others, OutputError if it is empty."""
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
    title = f"Sweep of {sources}"
    versions = [row["versions"] for row in done if row["versions"]]
    context = {
        "title": title,
        "counted": counted,
        "notes": _missing(drawn),
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
    }
    return _page(title, [rendered("sweep.html", **context)], [], versions)


def _scenes(store: Store) -> dict[str, str]:
    first: dict[str, Any] = {}
    for case in store.cases():
        first.setdefault(case["source"], case["scene"])
    return {source: tomli_w.dumps(scene) for source, scene in first.items()}


def _caption(path: Path, file: Path) -> str:
    name = path.stem.removeprefix(f"{file.stem}_").replace("_", " ")
    return CAPTIONS.get(name, name.capitalize())


def _cell(row: Mapping[str, Any], name: str) -> Any:
    value = row.get(name)
    if value is None or row.get(name + LOW) is None:
        return value
    return Bounded(value, row[name + LOW], row[name + HIGH])


def part(record: Path, notes: Sequence[str] = ()) -> tuple[Markup, dict[str, Any]]:
    """The part of the page for a record, and its template's context. Raises OutputError for a damaged one."""
    try:
        context = results.context_of(record)
        context["notes"] = [*context.get("notes", ()), *notes]
        return rendered(record.with_suffix(".html").name, **context), context
    except UndefinedError as error:
        lacks = re.search(r"has no (?:attribute|element) '?([^']+)'?$", str(error))
        what = lacks[1] if lacks else str(error)
        raise OutputError(f"{record}: holds no {what}; compute it again") from error
    except KeyError as error:
        raise OutputError(f"{record}: holds no {error.args[0]}; compute it again") from error
    except (AttributeError, TypeError, ValueError) as error:
        raise OutputError(f"{record}: cannot be understood: {error}; compute it again") from error


def _page(title: str, parts: list[Markup], scenes: list[str], versions: list[str]) -> str:
    style = Markup((TEMPLATES / "page.css").read_text(encoding="utf-8"))
    own, computed = metadata.version("incipient"), list(dict.fromkeys(versions))
    context = {"parts": parts, "scenes": scenes, "versions": computed, "version": own}
    return rendered("page.html", title=title, style=style, **context)


def _is_drawn(directory: Path, kind: ResultKind) -> bool:
    """Whether the pictures that are always drawn are there, and not older than the record."""
    pictures = [directory / name for name in kind.pictures]
    since = (directory / kind.record).stat().st_mtime_ns
    return all(path.is_file() and path.stat().st_mtime_ns >= since for path in pictures)


def _missing(drawn: Drawn) -> list[str]:
    return [f"Pictures that are missing here: {drawn.complaint}."] if drawn.complaint else []

"""One HTML page of what a directory or the file of a sweep holds, to be read anywhere, without a network.

`page` says what a page is made of and makes HTML of it; a module for each kind of result says what stands on it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from ..errors import OutputError, SceneError
from ..files import require_ending, require_own, write_text_atomically
from ..pictures.apart import draw_apart
from . import entrainment, gusts, judgement, run, study, survey, sweep, threshold
from .citation import closing
from .page import Page, PagePart, html

# What commands leave in a directory, with what a page says of it and the pictures that are always drawn of it.
RECORDS: dict[str, tuple[Callable[[Path], PagePart], tuple[str, ...]]] = {
    "result.json": (run.part, ("flow.png", "pressure.png", "mesh.png")),
    "threshold.json": (threshold.part, ("threshold.png",)),
    "gusts.json": (gusts.part, ("gusts.png",)),
    "entrainment.json": (entrainment.part, ("entrainment.png",)),
    "survey.json": (survey.part, ("survey.png",)),
    "judgement.json": (judgement.part, ("judgement.png",)),
    "series.json": (judgement.part_of_series, ("series.png",)),
    "cost.json": (study.part, ("cost.png",)),
}
NAME = "report.html"


def write(path: Path, target: Path | None = None) -> Path:
    """Write the page of a directory of results, or of the file of a sweep; return its path. Not collective.

    Pictures that are missing, or older than the numbers, are drawn, in a process of their own. One that fails is
    named on the page. `target` is the page, by default DIRECTORY/report.html or, beside the sweep, SWEEP_report.html.

    Raises:
        SceneError: there is no such directory or file, or no result in it.
        OutputError: a result is damaged or incomplete, or the page cannot be written.
    """
    if target is not None:
        require_ending(target, ".html")
        require_own(target)
    if path.is_file():
        page, usual = of_sweep(path), path.with_name(f"{path.stem}_{NAME}")
    else:
        page, usual = of_directory(path), path / NAME
    target = target or usual
    write_text_atomically(target, html(page))
    return target


def of_directory(directory: Path) -> Page:
    """The page of all results in a directory; missing pictures are drawn. Not collective; raises as `write`."""
    records = [directory / name for name in RECORDS if (directory / name).is_file()]
    if not records:
        why = "holds no result yet" if directory.is_dir() else "there is no such file or directory"
        remedy = "give the directory that a run was written to, or a sweep's file"
        raise SceneError(f"{directory}: {why}; {remedy}")
    parts = [
        _part(record) for record in records
    ]  # what is damaged is found before anything is drawn
    pictures = [
        (directory / name, record) for record in records for name in RECORDS[record.name][1]
    ]
    if not all(one.is_file() and _time(one) >= _time(record) for one, record in pictures):
        complaint = draw_apart(directory).complaint
        parts = [_part(record) for record in records]
        if complaint:
            missing = f"Pictures that are missing here: {complaint}."
            parts[0] = replace(parts[0], notes=(*parts[0].notes, missing))
    return Page(parts[0].title or directory.resolve().name, tuple(parts), closing(directory, parts))


def of_sweep(file: Path) -> Page:
    """The page of the file of a sweep, its pictures drawn again. Not collective; raises OutputError for other files."""
    made = sweep.part(file)
    return Page(made.title, (made,), closing(None, [made]))


def _time(path: Path) -> int:
    return path.stat().st_mtime_ns


def _part(record: Path) -> PagePart:
    """What the page says of a record; one that lacks something or holds something else than is expected is named."""
    try:
        return RECORDS[record.name][0](record)
    except KeyError as error:
        raise OutputError(f"{record}: holds no {error.args[0]}; compute it again") from error
    except (AttributeError, TypeError, ValueError) as error:
        raise OutputError(f"{record}: cannot be understood: {error}; compute it again") from error

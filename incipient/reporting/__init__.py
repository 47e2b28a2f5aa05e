"""One self-contained HTML page of a result directory or the file of a sweep."""

from __future__ import annotations

import re
from importlib import metadata
from pathlib import Path
from typing import Any

import tomli_w
from jinja2 import UndefinedError
from markupsafe import Markup

from ..errors import OutputError, SceneError
from ..files import require_ending, require_own, write_text_atomically
from ..pictures import draw_apart
from ..results.kinds import KINDS, ResultKind
from ..results.quantity import at
from . import results, sweep
from .page import TEMPLATES, rendered

NAME = "report.html"


def write(path: Path, target: Path | None = None) -> Path:
    """Write the page of a result directory, or of the file of a sweep; returns its path.

    Missing and outdated pictures are drawn first. Default of `target`: DIRECTORY/report.html, or SWEEP_report.html.
    Raises SceneError without a result there, OutputError for a damaged result or a page that is not writable.
    """
    if target is not None:
        require_ending(target, ".html")
        require_own(target)
    if path.is_file():
        context = sweep.context_of(path)
        parts = [rendered("sweep.html", **context)]
        text = _page(context["title"], parts, [], context["versions"])
        usual = path.with_name(f"{path.stem}_{NAME}")
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
    note = "" if all(_is_drawn(directory, kind) for kind in kinds) else _drawn_now(directory)
    parts = [part(directory / kind.record, note) for kind in kinds]
    contexts = [context for _, context in parts]
    stored = [context["stored"] for context in contexts]
    scene = directory / "scene.toml"
    scenes = [scene.read_text(encoding="utf-8")] if scene.is_file() else []
    scenes += [tomli_w.dumps(result["case"]) for result in stored if result.get("case")]
    versions = [at(result, "cost.versions") or {} for result in stored]
    computed = [", ".join(f"{name} {number}" for name, number in each.items()) for each in versions]
    title = contexts[0]["title"] or kinds[0].title or directory.resolve().name
    return _page(title, [text for text, _ in parts], scenes, list(filter(None, computed)))


def part(record: Path, note: str = "") -> tuple[Markup, dict[str, Any]]:
    """The part of the page for a record, and its template's context. Raises OutputError for a damaged one."""
    try:
        context = results.context_of(record)
        context["notes"] = [*context.get("notes", ()), note]
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


def _drawn_now(directory: Path) -> str:
    """Draw the pictures; returns a note on those that failed."""
    complaint = draw_apart(directory).complaint
    return f"Pictures that are missing here: {complaint}." if complaint else ""

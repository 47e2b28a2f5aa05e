"""One HTML page of what a directory or the file of a sweep holds, to be read anywhere, without a network.

Templates say what stands on a page, one for each kind of result; `results` and `sweep` prepare what they need.
"""

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
from ..pictures.apart import draw_apart
from ..results.kinds import KINDS
from . import results, sweep
from .page import TEMPLATES, rendered

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
        text, usual = of_sweep(path), path.with_name(f"{path.stem}_{NAME}")
    else:
        text, usual = of_directory(path), path / NAME
    target = target or usual
    write_text_atomically(target, text)
    return target


def of_directory(directory: Path) -> str:
    """The page of all results in a directory; missing pictures are drawn. Not collective; raises as `write`."""
    kinds = [kind for kind in KINDS if (directory / kind.record).is_file()]
    if not kinds:
        why = "holds no result yet" if directory.is_dir() else "there is no such file or directory"
        remedy = "give the directory that a run was written to, or a sweep's file"
        raise SceneError(f"{directory}: {why}; {remedy}")
    records = [directory / kind.record for kind in kinds]
    parts = [part(record) for record in records]  # damage is reported before anything is drawn
    pictures = [
        (directory / name, directory / kind.record) for kind in kinds for name in kind.pictures
    ]
    if not all(one.is_file() and _time(one) >= _time(record) for one, record in pictures):
        complaint = draw_apart(directory).complaint
        missing = f"Pictures that are missing here: {complaint}." if complaint else ""
        parts = [part(record, missing) for record in records]
    contexts = [context for _, context in parts]
    stored = [context["stored"] for context in contexts]
    scene = directory / "scene.toml"
    scenes = [scene.read_text(encoding="utf-8")] if scene.is_file() else []
    scenes += [tomli_w.dumps(result["case"]) for result in stored if result.get("case")]
    computed = [_versions(result) for result in stored]
    title = contexts[0]["title"] or kinds[0].title or directory.resolve().name
    return _page(title, [text for text, _ in parts], scenes, list(filter(None, computed)))


def of_sweep(file: Path) -> str:
    """The page of the file of a sweep, its pictures drawn again. Not collective; raises OutputError for other files."""
    context = sweep.context_of(file)
    return _page(context["title"], [rendered("sweep.html", **context)], [], context["versions"])


def part(record: Path, note: str = "") -> tuple[Markup, dict[str, Any]]:
    """What the page says of a record, and the context of its template; raises OutputError for a damaged one."""
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


def _time(path: Path) -> int:
    return path.stat().st_mtime_ns


def _versions(stored: dict[str, Any]) -> str:
    """The versions of the programs behind a result."""
    cost = stored.get("cost")
    versions = cost.get("versions", {}) if isinstance(cost, dict) else {}
    return ", ".join(f"{name} {number}" for name, number in versions.items())

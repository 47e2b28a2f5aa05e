"""Pictures of results, drawn off screen in a separate process: VTK and dolfinx conflict over std::regex."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from ..errors import IncipientError, OutputError, SceneError
from ..installed import missing_in_words
from ..parallel import environment_alone


@dataclass(frozen=True)
class Drawn:
    """Files drawn, and one line on failed ones, with the error to raise."""

    paths: list[Path]
    complaint: str = ""
    error: type[IncipientError] = OutputError


def draw_apart(path: Path, **options: str | None) -> Drawn:
    """Draw the pictures of a directory's results, or of a sweep's file with options of `sweep.draw`."""
    return _apart("not drawn", path=str(path), **options)


def animate_apart(directory: Path, target: Path | None, field: str) -> Path:
    """Write the animation of `film.animate` in another process; raises as it."""
    out = None if target is None else str(target)
    drawn = _apart("no animation", path=str(directory), target=out, field=field)
    if drawn.complaint:
        raise drawn.error(drawn.complaint)
    return drawn.paths[0]


def _apart(nothing: str, **options: str | None) -> Drawn:
    # -P: modules are not looked for in the working directory, where a file may be named like one of Python's.
    command = [sys.executable, "-P", "-m", "incipient.pictures", json.dumps(options)]
    # Names of files need not be UTF-8; pictures are files, wherever the user looks at others.
    settings = {"PYTHONIOENCODING": "utf-8:surrogateescape", "MPLBACKEND": "agg"}
    child = subprocess.run(
        command,
        capture_output=True,
        encoding="utf-8",
        errors="surrogateescape",
        env=environment_alone() | settings,
        check=False,
    )
    paths = [Path(line) for line in child.stdout.splitlines()]
    if not child.returncode:
        return Drawn(paths)
    lines = child.stderr.strip().splitlines() or [f"the drawing ended with code {child.returncode}"]
    if child.returncode == SceneError.exit_code:
        return Drawn(paths, lines[-1], SceneError)
    return Drawn(paths, f"{nothing}: {missing_in_words(lines[-1]) or lines[-1]}")

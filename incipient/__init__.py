"""Does a rigid grain resting on a rigid bed in a viscous flow begin to move, how, and with what margin?

    import incipient
    result = incipient.run(incipient.load("demos/scenes/grain_on_bed.toml"), "results/grain")
    print(result.text())

Importing this package is cheap: the finite element library is loaded on first use.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import (
    ConvergenceError,
    IncipientError,
    Interrupted,
    MeshError,
    MissingError,
    OutputError,
    SceneError,
)

if TYPE_CHECKING:
    from .flumes import flume
    from .output.runs import resume, run
    from .output.searches import entrainment, gusts, threshold
    from .planning.plan import Plan, make_plan
    from .scene import Scene, load

__all__ = [
    "ConvergenceError",
    "IncipientError",
    "Interrupted",
    "MeshError",
    "MissingError",
    "OutputError",
    "Plan",
    "Scene",
    "SceneError",
    "entrainment",
    "flume",
    "gusts",
    "load",
    "make_plan",
    "report",
    "resume",
    "run",
    "threshold",
]

# Loaded on first use: judging external forces needs neither scenes nor their dependencies.
_LATER = {
    "Plan": "planning.plan",
    "flume": "flumes",
    "make_plan": "planning.plan",
    "Scene": "scene",
    "load": "scene",
    "run": "output.runs",
    "resume": "output.runs",
    "threshold": "output.searches",
    "gusts": "output.searches",
    "entrainment": "output.searches",
}


def __getattr__(name: str) -> Any:
    if name in _LATER:
        globals()[name] = getattr(import_module(f".{_LATER[name]}", __name__), name)
        return globals()[name]
    if name in ("scene", "planning"):
        return import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def report(path: Path | str, target: Path | str | None = None) -> Path:
    """Write one self-contained HTML page of results; returns its path.

    Args:
        path: a result directory, or the file of a sweep.
        target: the page; default: report.html in the directory, SWEEP_report.html beside the file.

    Raises:
        SceneError: no results.
        OutputError: a damaged result, or a page that is not writable.
    """
    from .reporting import write

    return write(Path(path), None if target is None else Path(target))

"""All pictures of the results in a directory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from ..errors import IncipientError, OutputError
from ..results.kinds import (
    COST,
    ENTRAINMENT,
    GUSTS,
    JUDGEMENT,
    KINDS,
    POSES,
    RUN,
    SERIES,
    SURVEY,
    THRESHOLD,
    ResultKind,
)  # fmt: skip
from . import flow, style, surfaces, trajectory, verdict, walls
from .charts import cost, searches, survey
from .record import StoredRun, parsed_json, read

# What draws a record other than a run's, from its content and its directory.
CHARTS: dict[ResultKind, Callable[[dict[str, Any], Path], Figure]] = {
    THRESHOLD: verdict.of_threshold,
    GUSTS: searches.gusts,
    ENTRAINMENT: searches.entrainment,
    SURVEY: survey.figure,
    POSES: searches.poses,
    COST: cost.figure,
    SERIES: searches.series,
    JUDGEMENT: verdict.of_judgement,
}


def draw(directory: Path, announce: Callable[[Path], object] = lambda path: None) -> list[Path]:
    """Draw all pictures of the results in a directory, as PNG files beside them.

    `announce` is called with the path of every finished picture. Raises OutputError without a result, for a
    damaged one, or if a picture cannot be written; all others are drawn.
    """
    written: list[Path] = []
    failures: list[str] = []
    for kind in [kind for kind in KINDS if (directory / kind.record).exists()] or [RUN]:
        record = directory / kind.record
        makers: Mapping[str, Callable[[], Figure]] = {}
        with _failures_in(record, failures):
            if kind is RUN:
                makers = _of_run(read(directory))
            else:
                makers = {kind.name: partial(CHARTS[kind], parsed_json(record), directory)}
        for name, make in makers.items():
            path = directory / f"{name}.png"
            with _failures_in(path if kind is RUN else record, failures), style.applied():
                style.save(make(), path)
                written.append(path)
                announce(path)
        if kind is SURVEY:
            with _failures_in(record, failures):
                written.append(survey.for_paraview(directory))
                announce(written[-1])
    if failures:
        raise OutputError("; ".join(failures))
    return written


@contextmanager
def _failures_in(path: Path, failures: list[str]) -> Iterator[None]:
    try:
        yield
    except IncipientError as error:
        failures.append(str(error))
    except KeyError as error:
        failures.append(f"{path}: holds no {error.args[0]}; compute it again")
    except Exception as error:
        why = " ".join(f"{type(error).__name__}: {error}".split())
        failures.append(f"{path}: cannot be drawn: {why}")


def _of_run(run: StoredRun) -> dict[str, Callable[[], Figure]]:
    makers: dict[str, Callable[[StoredRun], Figure]] = {}
    if run.moves:
        makers["trajectory"] = trajectory.picture
    makers["flow"] = partial(flow.picture, shown=flow.SPEED)
    makers["pressure"] = partial(flow.picture, shown=flow.PRESSURE)
    if not run.in_space:
        makers["vorticity"] = partial(flow.picture, shown=flow.VORTICITY)
    elif run.setting("domain", "top") == "free-surface":
        makers["elevation"] = surfaces.elevation
    if run.surface is not None:
        makers["traction"] = surfaces.traction
        # A grain under way rests on nothing; where it has met the bed there is a verdict.
        if not (run.moves and run.result.get("verdict") is None):
            makers["verdict"] = verdict.of_run
    if walls.has_walls(run):
        makers["walls"] = walls.picture
    if run.setting("domain", "kind") == "box" and not (run.in_space or run.moves):
        makers["profiles"] = flow.profiles
    makers["mesh"] = flow.mesh
    return {name: partial(make, run) for name, make in makers.items()}

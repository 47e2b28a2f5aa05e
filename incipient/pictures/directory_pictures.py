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
from . import flow, searches, style, surfaces, survey, trajectory, verdict
from .record import StoredRun, parsed_json, read

# What draws a record other than a run's, from its content and its directory.
CHARTS: dict[ResultKind, Callable[[dict[str, Any], Path], Figure]] = {
    THRESHOLD: verdict.of_threshold,
    GUSTS: searches.gusts,
    ENTRAINMENT: searches.entrainment,
    SURVEY: survey.figure,
    POSES: searches.poses,
    COST: searches.cost,
    SERIES: searches.series,
    JUDGEMENT: verdict.of_judgement,
}


# Pictures of a run in their order: name, what draws it, and whether a run has it.
OF_RUN: tuple[tuple[str, Callable[[StoredRun], Figure], Callable[[StoredRun], Any]], ...] = (
    ("trajectory", trajectory.picture, lambda run: run.scene.moves),
    ("flow", partial(flow.picture, shown=flow.SPEED), bool),
    ("pressure", partial(flow.picture, shown=flow.PRESSURE), bool),
    ("vorticity", partial(flow.picture, shown=flow.VORTICITY), lambda run: not run.in_space),
    (
        "elevation",
        surfaces.elevation,
        lambda run: run.in_space and run.scene.has_surface,
    ),
    ("traction", surfaces.traction, lambda run: run.surface is not None),
    ("verdict", verdict.of_run, lambda run: run.result.get("verdict")),
    ("walls", flow.along_walls, lambda run: (run.result.get("turbulence") or {}).get("along")),
    ("mesh", flow.mesh, bool),
)


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
                run = read(directory)
                makers = {name: partial(make, run) for name, make, has in OF_RUN if has(run)}
            elif kind in CHARTS:
                makers = {kind.name: partial(CHARTS[kind], parsed_json(record), directory)}
        for name, make in makers.items():
            path = directory / f"{name}.png"
            with _failures_in(record, failures, path), style.applied():
                style.save(make(), path)
                written.append(path)
                announce(path)
        if kind is SURVEY:
            with _failures_in(record, failures):
                written.append(survey.for_paraview(directory))
                announce(written[-1])
    if failures:
        raise OutputError("; ".join(failures))
    if not written:
        raise OutputError(
            f"{directory}: has no pictures; read it with: incipient report {directory}"
        )
    return written


@contextmanager
def _failures_in(record: Path, failures: list[str], picture: Path | None = None) -> Iterator[None]:
    try:
        yield
    except IncipientError as error:
        failures.append(str(error))
    except KeyError as error:
        failures.append(f"{record}: holds no {error.args[0]}; compute it again")
    except Exception as error:
        why = " ".join(f"{type(error).__name__}: {error}".split())
        failures.append(f"{picture or record}: cannot be drawn: {why}")

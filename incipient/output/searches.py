"""Searches of critical flows, gusts and probabilities of motion, with a result directory."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import OutputError, SceneError
from ..files import csv_text, make_directory, write_results
from ..input_files import reading
from ..interrupt import one_at_a_time
from ..parallel import Comm, from_first, on_first, world
from ..progress import Silent
from ..results.kinds import ENTRAINMENT, GUSTS, THRESHOLD, ResultKind
from ..results.quantity import at
from ..scene import Scene
from ..scene.file import dumps
from ..scene.section import read_numbers
from ..setup.setup import Setup
from ..thresholds.critical import find_threshold
from ..thresholds.entrainment import Entrainment, find_entrainment
from ..thresholds.gusts import CriticalGust, GustSearch, Trials
from ..thresholds.laws import WeakestGusts
from ..thresholds.outcome import Threshold
from .ownership import SCENE, locked, place_scene

# Tables: key of their rows in the record, and keys of their columns in a row.
TABLES = {
    "gusts.csv": (
        "points",
        {
            name: name
            for name in ("duration", "strength", "error", "held", "leaves", "impulse", "runs")
        },
    ),
    "entrainment.csv": (
        "curve",
        {
            **{
                name: name for name in ("strength", "shields", "probability", "low", "high", "rate")
            },
            "lasting": "lasting.rate",
            "lasting_low": "lasting.low",
            "lasting_high": "lasting.high",
        },
    ),
}


def write(kind: ResultKind, path: Path, scene: Scene, stored: Mapping[str, Any]) -> None:
    """Write a record, its scene and its table, if any, to a directory.

    Results of another scene are moved to a numbered directory. Raises OutputError.
    """
    make_directory(path)
    place_scene(path, dumps(scene), kind.files)
    contents: dict[str, Any] = {kind.record: stored}
    for table in kind.tables:
        key, columns = TABLES[table]
        rows = ({name: at(row, place) for name, place in columns.items()} for row in stored[key])
        contents[table] = csv_text([*columns], rows)
    write_results(path, contents)


@contextmanager
def _kept(
    kind: ResultKind, scene: Scene, directory: Path | str | None, comm: Comm
) -> Iterator[Callable[[Mapping[str, Any]], Path | None]]:
    """A function that writes a record and its table to a locked directory, or nothing without one."""
    if directory is None:
        yield lambda stored: None
        return
    path = Path(directory)

    def keep(stored: Mapping[str, Any]) -> Path:
        on_first(comm, write, kind, path, scene, stored)
        return path

    with locked(path, comm, make=True):
        yield keep


@dataclass(frozen=True)
class SteadyFlow:
    """Stored threshold of the steady flow: its factor, infinite without any, and a sentence."""

    factor: float
    sentence: str


@dataclass(frozen=True)
class GustCurve:
    """Critical strengths of gusts by their duration.

    points: the longest duration first; static: threshold of the steady flow
    """

    scene: Scene
    static: SteadyFlow | Threshold
    points: tuple[CriticalGust, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        points = [point.to_dict() for point in self.points]
        static = {"static": self.static.factor, "steady": self.static.sentence}
        return {"title": self.scene.title, **static, "points": points}

    def text(self) -> str:
        steady = f"steady flow         {self.static.sentence}"
        return "\n".join([steady, *(point.line() for point in self.points)])


@one_at_a_time
def threshold(
    scene: Scene,
    directory: Path | str | None = None,
    comm: Comm | None = None,
    voice: Silent | None = None,
) -> Threshold:
    """Find the slowest steady flow that moves a grain at rest on its bed. Collective over `comm`.

    Args:
        directory: for threshold.json, written before its error bars are estimated, and the resolved scene; None writes
            nothing.

    Raises:
        IncipientError: on all ranks, one line; the threshold without error bars stays in the directory.
    """
    comm = comm or world()
    with _kept(THRESHOLD, scene, directory, comm) as keep:
        result = find_threshold(scene, comm, voice, lambda result: keep(result.to_dict()))
        keep(result.to_dict())
    return result


@one_at_a_time
def gusts(
    scene: Scene,
    durations: Sequence[float],
    directory: Path | str | None = None,
    comm: Comm | None = None,
    voice: Silent | None = None,
) -> GustCurve:
    """Find the weakest gusts that move a released grain out of its pocket. Collective over `comm`.

    Args:
        scene: shape and start of gusts are those of its [flow.gust].
        directory: for gusts.json, gusts.csv and the resolved scene, updated after each run; runs of the same scene
            there are not repeated. None writes nothing.

    Raises:
        IncipientError: on all ranks, one line; earlier results stay in the directory.
    """
    comm = comm or world()
    search = GustSearch(scene, comm, voice or Silent())
    if not durations or not all(0.0 < duration < math.inf for duration in durations):
        raise SceneError("durations: give one or more, each a number above zero")
    with _kept(GUSTS, scene, directory, comm) as keep:
        steady, search.trials = from_first(comm, lambda: _earlier_gusts(scene, directory))
        curve = GustCurve(scene, steady or search.steady_threshold())

        def keep_all() -> None:
            trials = [[*trial, leaves] for trial, leaves in search.trials.items()]
            keep({**curve.to_dict(), "trials": trials})

        keep_all()
        search.keep = keep_all
        for point in search.critical(durations):
            curve = replace(curve, points=(*curve.points, point))
            keep_all()
    return curve


def _earlier_gusts(scene: Scene, directory: Path | str | None) -> tuple[SteadyFlow | None, Trials]:
    """Steady threshold and runs of an earlier search of the same scene in a directory, if any."""
    record = Path(directory or "") / "gusts.json"
    placed = record.with_name(SCENE)
    if directory is None or not record.is_file() or not placed.is_file():
        return None, {}
    remedy = "remove it to search again"
    with reading(record, remedy, error=OutputError):
        stored = json.loads(record.read_text(encoding="utf-8"))
        if placed.read_bytes() != dumps(scene).encode() or "trials" not in stored:
            return None, {}
        static = math.inf if stored["static"] is None else stored["static"]
        trials = {(steps, s, d): leaves for steps, s, d, leaves in stored["trials"]}
        return SteadyFlow(static, stored["steady"]), trials


@one_at_a_time
def entrainment(
    scene: Scene,
    directory: Path | str | None = None,
    probabilities: Sequence[float] = (),
    strengths: Sequence[float] = (),
    gusts: Path | str | None = None,
    data: Path | str | None = None,
    comm: Comm | None = None,
    voice: Silent | None = None,
) -> Entrainment:
    """Compute the probability that a grain at rest moves in the flow of the scene's [gusts]. Collective over `comm`.

    Args:
        directory: for entrainment.json, entrainment.csv and the resolved scene; None writes nothing.
        probabilities: fractions of time with motion, for which Shields numbers are computed; default: 0.1%, 1%, 5%
            and 50%, within the range of the data.
        strengths: mean flows over the scene's, for a curve; default: along the whole curve.
        gusts: directory of `incipient gust`, for the rate of gusts that last long enough.
        data: CSV of measured Shields numbers and probabilities, for the picture.

    Raises:
        IncipientError: on all ranks, one line.
    """
    comm = comm or world()
    weakest = None if gusts is None else WeakestGusts.of(_stored(Path(gusts) / "gusts.json"))
    measured = [] if data is None else _points(Path(data))
    with _kept(ENTRAINMENT, scene, directory, comm) as keep:
        result = find_entrainment(Setup(scene), comm, probabilities, strengths, weakest, voice)
        keep({**result.to_dict(), "data": measured})
    return result


def _stored(path: Path) -> Any:
    remedy = "give the directory that incipient gust has written"
    with reading(path, remedy, name=f"--gusts: {path}"):
        return json.loads(path.read_text(encoding="utf-8"))


def _points(path: Path) -> list[tuple[float, ...]]:
    points = read_numbers(path, "x, y")
    for shields, probability in points:
        if not (shields > 0.0 and 0.0 <= probability <= 1.0):
            raise SceneError(
                f"--data: {path} has the Shields number {shields:g} with the probability {probability:g}; "
                "give numbers above zero, and probabilities from 0 to 1"
            )
    return points

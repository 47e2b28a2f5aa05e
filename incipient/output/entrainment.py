"""Entrainment by gusts: entrainment.json, entrainment.csv and the scene in a directory."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..arrays import Point
from ..errors import SceneError
from ..files import csv_text, write_json, write_text_atomically
from ..input_files import reading
from ..interrupt import one_at_a_time
from ..parallel import Comm, collectively, world
from ..planning.flow_setup import Setup
from ..progress import Silent
from ..scene import Scene
from ..scene.file import dumps
from ..scene.fluctuations import Gusts
from ..scene.messages import one_line, problems_of
from ..scene.points import read_points
from ..thresholds.entrainment import Entrainment, OfStrength, find_entrainment
from ..thresholds.lasting import WeakestGusts
from .lock import locked
from .ownership import OTHERS, place_scene

COLUMNS = (
    "strength",
    "shields",
    "probability",
    "low",
    "high",
    "rate",
    "lasting",
    "lasting_low",
    "lasting_high",
)


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
    """Compute the probability of motion in a fluctuating flow, by the scene's [gusts]. Collective over `comm`.

    Args:
        scene: a grain that rests on a bed, in a steady flow, with [gusts].
        directory: where to write entrainment.json, entrainment.csv and the resolved scene; None writes nothing.
        probabilities: of motion at an instant, for each of which the Shields number is computed; default: 0.1%,
            1%, 5% and 50%, of those what data can tell.
        strengths: mean flows over the scene's, for a curve; default: some that show it.
        gusts: directory of `incipient gust`; then the rate of gusts that last long enough is also computed.
        data: CSV of Shields number and probability, measured, for the picture.
        voice: reports every solved flow; default: none.

    Raises:
        IncipientError: on all ranks, one line.
    """
    comm = comm or world()
    weakest = None if gusts is None else WeakestGusts.of(_stored(Path(gusts) / "gusts.json"))
    measured = [] if data is None else _points(Path(data))
    if directory is None:
        return find_entrainment(Setup(scene), comm, probabilities, strengths, weakest, voice)
    path = Path(directory)
    with locked(path, comm, make=True):
        found = find_entrainment(Setup(scene), comm, probabilities, strengths, weakest, voice)
        with collectively(comm):
            if comm.rank == 0:
                place_scene(path, dumps(scene), OTHERS["entrainment"])
                write_json(path / "entrainment.json", {**found.to_dict(), "data": measured})
                write_text_atomically(
                    path / "entrainment.csv", csv_text(COLUMNS, map(_row, found.curve))
                )
    return found


def _row(one: OfStrength) -> dict[str, Any]:
    if one.lasting is None:
        return asdict(one)
    names = ("lasting", "lasting_low", "lasting_high")
    return {**asdict(one), **dict(zip(names, asdict(one.lasting).values(), strict=True))}


def _stored(path: Path) -> dict[str, Any]:
    """What a gusts.json holds; raises SceneError without one."""
    remedy = "give the directory that incipient gust has written"
    with reading(path, remedy, name=f"--gusts: {path}"):
        stored = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(stored, dict) or not {"points", "static"} <= stored.keys():
        raise SceneError(f"--gusts: {path} holds no gusts; {remedy}")
    return stored


def _points(path: Path) -> list[Point]:
    """Measured Shields numbers and probabilities; raises SceneError."""
    try:
        points = read_points(path, 1, "data")
    except ValidationError as error:
        raise SceneError(one_line("--data", problems_of(error, Gusts))) from None
    for shields, probability in points:
        if not (shields > 0.0 and 0.0 <= probability <= 1.0):
            why = f"has the Shields number {shields:g} with the probability {probability:g}"
            raise SceneError(
                f"--data: {path} {why}; give numbers above zero, and probabilities from 0 to 1"
            )
    return points

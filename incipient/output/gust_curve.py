"""The weakest gusts that move a grain out of its pocket: gusts.json, gusts.csv and the scene in a directory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..files import csv_text, write_json, write_text_atomically
from ..interrupt import one_at_a_time
from ..parallel import Comm, collectively, world
from ..progress import Silent
from ..scene import Scene
from ..scene.file import dumps
from ..thresholds.gusts import CriticalGust, GustSearch, require_durations
from .lock import locked
from .ownership import OTHERS, place_scene

COLUMNS = ("duration", "strength", "error", "held", "leaves", "impulse", "runs")


@dataclass(frozen=True)
class GustCurve:
    """Critical strengths of gusts by their duration, and that of a steady flow.

    points: the longest duration first; static: strength from which a steady flow moves the grain
    """

    scene: Scene
    static: float
    points: tuple[CriticalGust, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain data."""
        points = [one.to_dict() for one in self.points]
        return {"title": self.scene.title, "static": self.static, "points": points}

    def text(self) -> str:
        """A line for each duration."""
        lines = [f"a steady flow moves the grain from {self.static:.4g} times its strength on"]
        return "\n".join([*lines, *(one.line() for one in self.points)])


@one_at_a_time
def gusts(
    scene: Scene,
    durations: Sequence[float],
    directory: Path | str | None = None,
    comm: Comm | None = None,
    voice: Silent | None = None,
    announce: Callable[[CriticalGust], object] = lambda found: None,
) -> GustCurve:
    """Find the weakest gusts that move a released grain out of its pocket. Collective over `comm`.

    Args:
        scene: a released grain on a bed with forms; shape and start of gusts are those of its [flow.gust].
        durations: of the gusts [time].
        directory: where to write gusts.json, gusts.csv and the resolved scene, anew with each strength;
            None writes nothing.
        voice: reports every run; default: none.
        announce: is given each strength as soon as it is computed.

    Raises:
        IncipientError: on all ranks, one line; results so far stay in the directory.
    """
    comm = comm or world()
    found: list[CriticalGust] = []
    search = GustSearch(scene, comm, voice or Silent())
    require_durations(durations)
    static = search.static_strength()

    def keep(point: CriticalGust) -> None:
        """Announce a strength, and write all so far. Collective."""
        found.append(point)
        announce(point)
        if directory is not None:
            _write(Path(directory), GustCurve(scene, static, tuple(found)), comm)

    if directory is None:
        search.critical(durations, keep)
    else:
        with locked(Path(directory), comm, make=True):
            search.critical(durations, keep)
    return GustCurve(scene, static, tuple(found))


def _write(path: Path, curve: GustCurve, comm: Comm) -> None:
    with collectively(comm):
        if comm.rank == 0:
            place_scene(path, dumps(curve.scene), OTHERS["gusts"])
            write_json(path / "gusts.json", curve.to_dict())
            text = csv_text(COLUMNS, (one.to_dict() for one in curve.points))
            write_text_atomically(path / "gusts.csv", text)

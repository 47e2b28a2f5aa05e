"""All pictures that the results in a directory allow."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from ..errors import IncipientError, OutputError
from ..results import kinds
from . import cells, elevation, flow, style, traction, trajectory, verdict, walls
from .charts import cost, entrainment, gusts, poses, series, survey
from .record import StoredRun, read

Maker = Callable[[StoredRun], Figure]
# What draws the picture of each kind of results other than a run.
_OTHERS = {
    kinds.THRESHOLD: verdict.draw_threshold,
    kinds.GUSTS: gusts.draw,
    kinds.ENTRAINMENT: entrainment.draw,
    kinds.SURVEY: survey.draw,
    kinds.POSES: poses.draw,
    kinds.COST: cost.draw,
    kinds.SERIES: series.draw,
    kinds.JUDGEMENT: verdict.draw_judgement,
}


def draw(directory: Path, announce: Callable[[Path], object] = lambda path: None) -> list[Path]:
    """Draw all pictures that the results in a directory allow, as PNG files beside them. Not collective.

    A run (result.json): always flow, pressure, vorticity and mesh; with a grain the traction on it and the verdict,
    with one that moves its trajectory and the verdict if there is any; with wall functions y+ and friction along walls;
    for a box in which nothing moves the velocity profiles on both centrelines. Each other kind of results
    (`results.kinds`): one picture.

    Args:
        announce: called with the path of every picture as soon as it is there.

    Raises:
        OutputError: when there is no result, when one is incomplete or damaged, or a picture could not be drawn or
            written; all others have been drawn then.
    """
    drawing = _DrawnPictures(announce)
    others = [kind for kind in _OTHERS if (directory / kind.record).exists()]
    record = directory / kinds.RUN.record
    if record.exists() or not others:
        with drawing.attempt(record):
            _draw_run(directory, drawing)
    for kind in others:
        drawing.add(directory / kind.record, _OTHERS[kind])
    if drawing.failures:
        raise OutputError("; ".join(drawing.failures))
    return drawing.written


class _DrawnPictures:
    """Pictures drawn one after the other; a failure does not stop the others."""

    def __init__(self, announce: Callable[[Path], object]):
        self._announce = announce
        self.written: list[Path] = []
        self.failures: list[str] = []

    @contextmanager
    def attempt(self, path: Path) -> Iterator[None]:
        """Record errors of the block, which reads or writes a file."""
        try:
            yield
        except IncipientError as error:
            self.failures.append(str(error))
        except Exception as error:
            why = " ".join(f"{type(error).__name__}: {error}".split())
            self.failures.append(f"{path}: cannot be drawn: {why}")

    def done(self, path: Path) -> None:
        """Record and announce a picture."""
        self.written.append(path)
        self._announce(path)

    def add(self, source: Path, make: Callable[[Path], list[Path]]) -> None:
        """Draw the pictures of a file of results."""
        with self.attempt(source):
            for path in make(source.parent):
                self.done(path)


def _draw_run(directory: Path, drawing: _DrawnPictures) -> None:
    run = read(directory)
    if run.moves:
        drawing.add(directory / "history.csv", partial(trajectory.draw, title=run.headline))
    for name, make in _makers(run).items():
        path = directory / f"{name}.png"
        with drawing.attempt(path), style.applied():
            style.save(make(run), path)
            drawing.done(path)


def _makers(run: StoredRun) -> dict[str, Maker]:
    """Functions that draw the pictures of a run's last fields, by name."""
    makers: dict[str, Maker] = {"flow": flow.speed, "pressure": flow.pressure}
    if not run.in_space:
        makers["vorticity"] = flow.vorticity
    elif run.setting("domain", "top") == "free-surface":
        makers["elevation"] = elevation.picture
    if run.surface is not None:
        makers["traction"] = traction.picture
    # A grain under way rests on nothing; where it has met the bed there is a verdict.
    if run.surface is not None and not (run.moves and run.result.get("verdict") is None):
        makers["verdict"] = verdict.of_run
    if walls.has_walls(run):
        makers["walls"] = walls.picture
    if run.setting("domain", "kind") == "box" and not (run.in_space or run.moves):
        makers["profiles"] = flow.profiles
    makers["mesh"] = cells.picture
    return makers

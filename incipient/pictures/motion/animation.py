"""A run in motion: one field of the flow at the steps that were stored, as GIF or, with ffmpeg, as MP4."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import OutputError
from ...output.series_file import read_step, times
from .. import style
from . import film_file
from .film import FIELDS, FilmInPlane, FilmInSpace

_MOST_FRAMES = 200
_SECONDS, _RATES = 8.0, (4, 20)  # about how long it takes, and frames per second
_TETRAHEDRON = 10  # nodes of a cell in space


def animate(directory: Path, target: Path | None = None, field: str = "velocity") -> Path:
    """Show a field of a run in motion; returns the file written. Not collective.

    A run in space is shown in the vertical plane through the grain.

    `target` ends in .gif or .mp4; by default it is DIRECTORY/FIELD.gif. Every stored step is a frame, or 200 of
    them, evenly spaced in time. The result need not be there: a run may be watched while it goes on.

    Raises:
        OutputError: with fewer than two steps, without ffmpeg for an MP4, or when it cannot be written.
    """
    path = target or directory / f"{field}.gif"
    film_file.check(path)
    indices, moments = _frames(directory / "fields")
    rate = int(np.clip(len(indices) / _SECONDS, *_RATES))
    in_space = read_step(directory / "fields", int(indices[0])).cells.shape[1] == _TETRAHEDRON
    with style.applied():
        film = (FilmInSpace if in_space else FilmInPlane)(directory, FIELDS[field], indices, moments)
        film_file.write(film, path, rate)
    return path


def _frames(stem: Path) -> tuple[np.ndarray, np.ndarray]:
    """Indices and times of the steps to show: those closest to evenly spaced times."""
    stored = np.array(times(stem))
    if len(stored) < 2:
        remedy = "run the scene with [time] and --set output.every=1"
        raise OutputError(f"{stem}.h5: holds a single step; {remedy}")
    wanted = np.linspace(stored[0], stored[-1], min(len(stored), _MOST_FRAMES))
    after = np.clip(np.searchsorted(stored, wanted), 1, len(stored) - 1)
    nearest = np.where(wanted - stored[after - 1] < stored[after] - wanted, after - 1, after)
    if len(stored) <= _MOST_FRAMES:
        nearest = np.arange(len(stored))
    indices = np.unique(nearest)
    return indices, stored[indices]

"""The history of a run with a moving grain, read back from its CSV file."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import OutputError

if TYPE_CHECKING:
    from ..geometry.placement import Placement

PLACE = ("x", "y", "angle")
RATES = ("velocity_x", "velocity_y", "spin")
_READ = ("time", *PLACE, *RATES, "meshes")
_FULL_TURN = 2.0 * np.pi


@dataclass(frozen=True)
class History:
    """Columns (n,) by name, in the order of time; nan where nothing is known. Angles in radians, unbounded."""

    columns: dict[str, np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    @cached_property
    def times(self) -> np.ndarray:
        """(n,) ascending."""
        return self.columns["time"]

    @cached_property
    def centres(self) -> np.ndarray:
        """(n, 2) of the grain's centre."""
        return np.column_stack([self.columns["x"], self.columns["y"]])

    @property
    def remeshings(self) -> np.ndarray:
        """Times of the first steps on new meshes."""
        meshes = self.columns.get("meshes", np.ones(len(self.times)))
        new = np.diff(meshes, prepend=meshes[:1]) > 0
        return np.asarray(self.times[new])

    def at(self, time: float) -> Placement:
        """Where the grain is at a time, between rows on the straight line from one to the next."""
        from ..geometry.placement import Placement

        x, y, angle = (float(np.interp(time, self.times, self.columns[name])) for name in PLACE)
        return Placement((x, y), angle)

    def started(self, placement: Placement) -> History:
        """This path with the place at time zero before it, where the first step is later."""
        if self.times[0] <= 0.0:
            return self
        start = dict(zip(PLACE, (*placement.centre, self._near_first(placement.angle)), strict=True))
        start |= {"time": 0.0, "meshes": 1.0}
        return History(
            {k: np.concatenate([[start.get(k, np.nan)], column]) for k, column in self.columns.items()}
        )

    def _near_first(self, angle: float) -> float:
        """The angle with as many full turns as the first row has."""
        return angle + _FULL_TURN * round(float(self.columns["angle"][0] - angle) / _FULL_TURN)


def read_history(path: Path) -> History:
    """Read the history of a run with a moving grain.

    Raises:
        OutputError: naming the file that is missing, damaged, or of a run without a moving grain.
    """
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            header, *rows = list(csv.reader(stream)) or [[]]
    except FileNotFoundError:
        raise OutputError(f"{path}: no such file; is this the directory of a finished run?") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise OutputError(f"{path}: cannot be read: {error}; run the scene again") from error
    names = [heading.partition(" [")[0] for heading in header]
    missing = [name for name in ("time", *PLACE) if name not in names]
    if missing:
        raise OutputError(f"{path}: holds no {missing[0]}; run the scene again")
    return History(_columns(path, names, rows))


def _columns(path: Path, names: list[str], rows: list[list[str]]) -> dict[str, np.ndarray]:
    complete = [row for row in rows if len(row) == len(names)]
    if not complete or len(complete) < len(rows) - 1:  # the last may be on its way to the disk
        raise OutputError(f"{path}: holds no complete steps; run the scene again")
    try:
        by_name = zip(names, zip(*complete, strict=True), strict=False)
        found = {name: _numbers(column) for name, column in by_name if name in _READ}
    except ValueError as error:
        raise OutputError(f"{path}: cannot be read: {error}; run the scene again") from error
    known = np.isfinite([found[name] for name in ("time", *PLACE)]).all(axis=0)
    if not known.any():
        raise OutputError(f"{path}: holds no place of the grain; run the scene again")
    return {name: column[known] for name, column in found.items()}


def _numbers(texts: tuple[str, ...]) -> np.ndarray:
    return np.array([float(text) if text else np.nan for text in texts])

"""The history of a run with a moving grain, read back from its CSV file."""

from __future__ import annotations

import csv
from collections.abc import Container
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from ..errors import OutputError
from ..geometry.placement import Placement
from ..input_files import reading

# Columns of place and orientation, and of their rates, in 2-D and in 3-D.
PLACE = {2: ("x", "y", "angle"), 3: ("x", "y", "z", *(f"quaternion_{part}" for part in "wxyz"))}
RATES = {
    2: ("velocity_x", "velocity_y", "spin"),
    3: (*(f"velocity_{axis}" for axis in "xyz"), *(f"spin_{axis}" for axis in "xyz")),
}
_READ = {"time", "meshes"}.union(*PLACE.values(), *RATES.values())
_FULL_TURN = 2.0 * np.pi
REMEDY = "give the directory of a finished run, or run the scene again"


@dataclass(frozen=True)
class History:
    """Columns (n,) by name, in the order of time; nan where unknown. Angles in radians, unbounded."""

    columns: dict[str, np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    @cached_property
    def times(self) -> np.ndarray:
        """(n,) ascending."""
        return self.columns["time"]

    @property
    def gdim(self) -> int:
        """Dimension of the space that the grain moves in."""
        return _gdim(self.columns)

    @cached_property
    def centres(self) -> np.ndarray:
        """Coordinates (n, 2) of the grain's centre along the flow and upwards."""
        return np.column_stack([self.columns["x"], self.columns["xyz"[self.gdim - 1]]])

    @property
    def remeshings(self) -> np.ndarray:
        """Times of the first steps on new meshes."""
        meshes = self.columns.get("meshes", np.ones(len(self.times)))
        new = np.diff(meshes, prepend=meshes[:1]) > 0
        return np.asarray(self.times[new])

    def at(self, time: float) -> Placement:
        """Position of the grain at a time, interpolated linearly between rows."""
        place = [
            float(np.interp(time, self.times, self.columns[name])) for name in PLACE[self.gdim]
        ]
        if self.gdim == 2:
            return Placement((place[0], place[1]), place[2])
        w, x, y, z = (float(part) for part in np.divide(place[3:], np.linalg.norm(place[3:])))
        return Placement(tuple(place[:3]), quaternion=(w, x, y, z))

    def started(self, placement: Placement) -> History:
        """This path with the place at time zero before it, where the first step is later."""
        if self.times[0] <= 0.0:
            return self
        turned = self._turned(placement)
        start = dict(zip(PLACE[self.gdim], (*placement.centre, *turned), strict=True))
        start |= {"time": 0.0, "meshes": 1.0}
        first = {name: [start.get(name, np.nan)] for name in self.columns}
        return History({name: np.concatenate([first[name], self.columns[name]]) for name in first})

    def _turned(self, placement: Placement) -> tuple[float, ...]:
        """The angle with as many full turns as the first row has; in 3-D the quaternion with its sign."""
        if placement.quaternion is not None:
            first = [self.columns[name][0] for name in PLACE[3][3:]]
            sign = 1.0 if np.dot(first, placement.quaternion) >= 0.0 else -1.0
            return tuple(sign * part for part in placement.quaternion)
        ahead = float(self.columns["angle"][0] - placement.angle)
        return (placement.angle + _FULL_TURN * round(ahead / _FULL_TURN),)


def read_history(path: Path) -> History:
    """Read the history of a moving grain; raises OutputError for a file that is missing, damaged or not a history."""
    with (
        reading(path, REMEDY, error=OutputError),
        path.open(encoding="utf-8", newline="") as file,
    ):
        header, *rows = list(csv.reader(file)) or [[]]
    names = [heading.partition(" [")[0] for heading in header]
    missing = [name for name in ("time", *PLACE[_gdim(names)]) if name not in names]
    if missing:
        raise OutputError(f"{path}: holds no {missing[0]}; run the scene again")
    return History(_columns(path, names, rows))


def _columns(path: Path, names: list[str], rows: list[list[str]]) -> dict[str, np.ndarray]:
    complete = [row for row in rows if len(row) == len(names)]
    if not complete or len(complete) < len(rows) - 1:  # the last may be on its way to the disk
        raise OutputError(f"{path}: holds no complete steps; run the scene again")
    try:
        by_name = zip(names, zip(*complete, strict=True), strict=False)
        columns = {
            name: np.array([float(text) if text else np.nan for text in column])
            for name, column in by_name
            if name in _READ
        }
    except ValueError as error:
        raise OutputError(f"{path}: cannot be read: {error}; run the scene again") from error
    known = np.isfinite([columns[name] for name in ("time", *PLACE[_gdim(columns)])]).all(axis=0)
    if not known.any():
        raise OutputError(f"{path}: holds no place of the grain; run the scene again")
    return {name: column[known] for name, column in columns.items()}


def _gdim(names: Container[str]) -> int:
    return 3 if "z" in names else 2

"""Forces and moments on a grain in time as OpenFOAM's function object `forces` writes them.

Told apart by header and number of columns: `force.dat` and `moment.dat` of openfoam.com (total, pressure, viscous, and
porous where there is any), `forces.dat` of openfoam.org and foam-extend (pressure and viscous force, then moments, with
porous ones in between). A folder holds a folder a start, by its time: what a later start has written replaces what the
one before has from that time on.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arrays import Floats
from ..errors import SceneError
from ..input_files import LARGEST_TABLE, reading
from .motion_in_time import BATCHES, FEWEST, steps_of

NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf)", re.IGNORECASE)
CENTRE = re.compile(r"#\s*CofR\s*:?\s*\(?([^)]*)\)?", re.IGNORECASE)
ROUNDING = 1e-5  # of a total that is written beside its parts, relative to the largest
SHARE = 0.5  # of the time, the last, over which a mean is taken where nothing else is asked for
FORMATS = "force.dat and moment.dat (openfoam.com) or forces.dat (openfoam.org, foam-extend)"


@dataclass(frozen=True, eq=False)
class ForcesInTime:
    """Force and moment on the grain, in the units of the other program.

    times: (n,); forces, moments: (n, 3), the latter about `centre` (3,)
    """

    times: Floats
    forces: Floats
    moments: Floats
    centre: Floats

    def later(self, start: float) -> ForcesInTime:
        """What comes from a time on; raises SceneError where nothing does."""
        kept = self.times >= start
        if not kept.any():
            raise SceneError(
                f"--since: nothing is there from {start:g} on; the last time is {self.times[-1]:g}"
            )
        return ForcesInTime(self.times[kept], self.forces[kept], self.moments[kept], self.centre)

    def mean(self) -> tuple[Floats, Floats]:
        """Means (6,) of force and moment in time, and their standard errors (6,) by the means of batches.

        Raises SceneError where there are too few samples.
        """
        if len(self.times) < FEWEST:
            raise SceneError(
                f"--since: {len(self.times)} samples are left; a mean takes {FEWEST} or more"
            )
        values, weights = np.hstack([self.forces, self.moments]), steps_of(self.times)
        mean = weights @ values / weights.sum()
        batches = [
            weights[part] @ values[part] / weights[part].sum()
            for part in np.array_split(np.arange(len(self.times)), BATCHES)
        ]
        return mean, np.std(batches, axis=0, ddof=1) / np.sqrt(BATCHES)


def read_forces(path: Path, moments: Path | None = None) -> ForcesInTime:
    """The forces in a file or folder of OpenFOAM.

    Args:
        moments: file of the moments beside a `force.dat`; default: `moment.dat` next to it.

    Raises:
        SceneError: there are none, the file is of no known format, moments or their centre are missing.
    """
    if path.is_dir():
        return _joined([_of_start(folder) for folder in _starts(path)])
    if path.name == "moment.dat":
        raise SceneError(
            f"--forces: {path} has moments alone; give the force.dat next to it, or their folder"
        )
    return _of_file(path, moments or path.with_name("moment.dat"))


def _starts(path: Path) -> list[Path]:
    """Folders of starts, in the order of their times; the folder itself where it has the files."""
    if any((path / name).is_file() for name in ("force.dat", "forces.dat")):
        return [path]
    named = [
        (float(one.name), one)
        for one in path.iterdir()
        if one.is_dir() and NUMBER.fullmatch(one.name)
    ]
    if not named:
        raise SceneError(
            f"--forces: {path} holds no forces; give a folder with {FORMATS}, or with folders by time"
        )
    return [one for _, one in sorted(named)]


def _of_start(folder: Path) -> ForcesInTime:
    for name in ("force.dat", "forces.dat"):
        if (folder / name).is_file():
            return _of_file(folder / name, folder / "moment.dat")
    raise SceneError(f"--forces: {folder} holds no forces; give a folder with {FORMATS}")


def _of_file(path: Path, moments: Path) -> ForcesInTime:
    table, header = _table(path)
    columns = table.shape[1]
    if "moment" in header:  # both in one file
        if columns not in (13, 19):
            raise SceneError(
                f"--forces: {path} has {columns} numbers a line; forces.dat has 13, or 19 with porous ones"
            )
        halves = table[:, 1:].reshape(len(table), 2, -1, 3).sum(axis=2)
        return ForcesInTime(table[:, 0], halves[:, 0], halves[:, 1], _centre(path, header))
    if columns not in (10, 13):
        raise SceneError(
            f"--forces: {path} has {columns} numbers a line; force.dat has 10, or 13 with porous ones"
        )
    if not moments.is_file():
        raise SceneError(
            f"--forces: {moments} is missing; write moments, too, with CofR in the function object"
        )
    other, other_header = _table(moments)
    if other.shape != table.shape or not np.array_equal(other[:, 0], table[:, 0]):
        raise SceneError(
            f"--forces: {moments} has other times than {path.name}; give files of one run"
        )
    for one, name in ((table, path), (other, moments)):
        _require_sum(one, name)
    return ForcesInTime(table[:, 0], table[:, 1:4], other[:, 1:4], _centre(moments, other_header))


def _require_sum(table: Floats, path: Path) -> None:
    """Refuses totals that are not the sum of their parts."""
    parts = table[:, 4:].reshape(len(table), -1, 3)
    wrong = np.abs(table[:, 1:4] - parts.sum(axis=1)) > ROUNDING * np.abs(parts).max()
    if wrong.any():
        time = table[np.flatnonzero(wrong.any(axis=1))[0], 0]
        raise SceneError(
            f"--forces: {path}: the total at time {time:g} is not the sum of its parts; write it anew"
        )


def _table(path: Path) -> tuple[Floats, str]:
    """The numbers of a file (n, columns), and its heading in small letters."""
    with reading(path, f"give {FORMATS}", LARGEST_TABLE, name=f"--forces: {path}"):
        lines = path.read_text(encoding="utf-8").splitlines()
    header = "\n".join(line for line in lines if line.lstrip().startswith("#"))
    rows = [
        [float(one) for one in NUMBER.findall(line)] for line in lines if line[:1] not in ("#", "")
    ]
    if (
        rows and len(rows) > 1 and len(rows[-1]) != len(rows[0])
    ):  # of a run that was cut short, or goes on
        rows.pop()
    if not rows or not rows[0] or any(len(row) != len(rows[0]) for row in rows):
        raise SceneError(f"--forces: {path} is no table of numbers; give {FORMATS}")
    table = np.array(rows)
    if not np.isfinite(table).all():
        time = table[np.flatnonzero(~np.isfinite(table).all(axis=1))[0], 0]
        raise SceneError(f"--forces: {path} is not finite at time {time:g}; take such lines out")
    return table, header.lower()


def _centre(path: Path, header: str) -> Floats:
    """The point of the moments."""
    found = CENTRE.search(header)
    numbers = [float(one) for one in NUMBER.findall(found[1])] if found else []
    if len(numbers) != 3:
        why = "does not say what point its moments are about"
        raise SceneError(
            f"--forces: {path} {why}; add a line '# CofR : (x y z)' on top, or write it with a newer version"
        )
    return np.array(numbers)


def _joined(parts: Sequence[ForcesInTime]) -> ForcesInTime:
    """All starts one after the other; the later wins where they overlap."""
    if any(np.abs(one.centre - parts[0].centre).max() > 0.0 for one in parts):
        raise SceneError(
            "--forces: moments of several starts are about different points; give one start alone"
        )
    kept = []
    for one, following in zip(parts, [*parts[1:], None], strict=True):
        end = np.inf if following is None else following.times[0]
        before = one.times < end
        kept.append(
            ForcesInTime(one.times[before], one.forces[before], one.moments[before], one.centre)
        )
    times, forces, moments = (
        np.concatenate([getattr(one, name) for one in kept])
        for name in ("times", "forces", "moments")
    )
    return ForcesInTime(times, forces, moments, parts[0].centre)

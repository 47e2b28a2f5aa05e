"""Forces and moments on a grain in time as OpenFOAM's function object `forces` writes them.

Told apart by header and number of columns: `force.dat` and `moment.dat` of openfoam.com (total, pressure, viscous, and
porous where there is any), `forces.dat` of openfoam.org and foam-extend (pressure and viscous force, then moments, with
porous ones in between). A folder holds a folder for each start, by its time; a run that finds a file in its folder adds
its start to the name (`force_5.dat`). What a later start has written replaces what the one
before has from that time on.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..arrays import Booleans, Floats
from ..errors import SceneError
from ..input_files import LARGEST_TABLE, reading
from .motion_in_time import BATCHES, FEWEST, samples_from, steps_of

DECIMAL = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
NUMBER = re.compile(rf"{DECIMAL}|[-+]?(?:nan|inf)", re.IGNORECASE)
RUN = re.compile(rf"(?P<kind>forces?|moment)(?:_(?P<start>{DECIMAL}))?\.dat")
CENTRE = re.compile(r"#\s*CofR\s*:?\s*\(?([^)]*)\)?", re.IGNORECASE)
ROUNDING = 1e-5  # of a total that is written beside its parts, relative to the largest
SHARE = 0.5  # of the time, the last, over which a mean is taken where nothing else is asked for
FORMATS = "force.dat and moment.dat (openfoam.com) or forces.dat (openfoam.org, foam-extend)"


@dataclass(frozen=True, eq=False)
class ForcesInTime:
    """Force and moment on the grain, in the units of the other program.

    times: (n,); forces, moments: (n, 3), the latter about `centre` (3,)
    sources: files that were joined, each with the times that it gives
    """

    times: Floats
    forces: Floats
    moments: Floats
    centre: Floats
    sources: tuple[str, ...] = ()

    def later(self, start: float) -> ForcesInTime:
        """What comes from a time on; raises SceneError where nothing does."""
        return self.only(samples_from(self.times, start))

    def only(self, which: Booleans) -> ForcesInTime:
        """Some of the samples, by a mask (n,)."""
        return replace(
            self, times=self.times[which], forces=self.forces[which], moments=self.moments[which]
        )

    def mean(self) -> tuple[Floats, Floats]:
        """Means (6,) of force and moment in time, and their standard errors (6,) by the means of batches.

        Raises SceneError where there are too few samples.
        """
        if len(self.times) < FEWEST:
            raise SceneError(
                f"--forces: the mean would be of {len(self.times)} samples from time {self.times[0]:g} on, and takes "
                f"{FEWEST} or more; give an earlier time with --since, or write forces more often"
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
        moments: file of the moments beside a file of forces; default: that of the same run next to it.

    Raises:
        SceneError: there are none, a file is of no known format, moments or their centre are missing, or the files of
            a folder can be joined in more than one way.
    """
    if path.is_dir():
        return _joined(path, _runs(path))
    if path.name.startswith("moment"):
        raise SceneError(
            f"--forces: {path} has moments alone; give the force.dat next to it, or their folder"
        )
    return _of_file(path, moments or _moments_beside(path))


@dataclass(frozen=True)
class _Run:
    """A file of forces; `again`: its name has the start, since an earlier run's file was in the folder."""

    start: float
    again: bool
    path: Path


def _runs(path: Path) -> list[_Run]:
    """The files in a folder, or in the folders by time that it has, in the order of their starts."""
    runs = _in_folder(path, -np.inf)
    for folder in sorted(path.iterdir()):
        if folder.is_dir() and NUMBER.fullmatch(folder.name):
            if not np.isfinite(start := float(folder.name)):
                raise SceneError(f"--forces: {folder} is named by no time; move it away")
            runs += _in_folder(folder, start)
    if not runs:
        raise SceneError(
            f"--forces: {path} holds no forces; give a folder with {FORMATS}, or with folders by time"
        )
    return sorted(runs, key=lambda run: (run.start, run.again))


def _in_folder(folder: Path, start: float) -> list[_Run]:
    names = [name for file in sorted(folder.iterdir()) if (name := RUN.fullmatch(file.name))]
    runs = [
        _Run(float(name["start"] or start), name["start"] is not None, folder / name.string)
        for name in names
        if name["kind"] != "moment"
    ]
    known = {_moments_beside(run.path) for run in runs}
    for name in names:
        if name["kind"] == "moment" and folder / name.string not in known:
            raise SceneError(
                f"--forces: {folder / name.string} has no file of forces beside it; move it away"
            )
    return runs


def _older(run: _Run, later: _Run, overlap: bool) -> bool:
    """Whether the names of two runs' files tell that the earlier start is the older run."""
    if run.again:
        return not overlap
    if run.path.parent == later.path.parent:
        return later.again
    return -np.inf < run.start < later.start


def _moments_beside(path: Path) -> Path:
    return path.with_name(re.sub("^forces?", "moment", path.name))


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
    if not rows:
        raise SceneError(f"--forces: {path} has no samples yet; let the run go on, or move it away")
    if not rows[0] or any(len(row) != len(rows[0]) for row in rows):
        raise SceneError(f"--forces: {path} is no table of numbers; give {FORMATS}")
    table = np.array(rows)
    if not np.isfinite(table).all():
        time = table[np.flatnonzero(~np.isfinite(table).all(axis=1))[0], 0]
        raise SceneError(f"--forces: {path} is not finite at time {time:g}; take such lines out")
    if (back := np.diff(table[:, 0]) <= 0.0).any():
        time = table[1:, 0][back][0]
        raise SceneError(
            f"--forces: {path} has time {time:g} twice or out of order; leave one line for each time"
        )
    return table, header.lower()


def _centre(path: Path, header: str) -> Floats:
    """The point (3,) of the moments."""
    centres = {tuple(map(float, NUMBER.findall(text))) for text in CENTRE.findall(header)}
    if len(centres) > 1:
        raise SceneError(
            f"--forces: {path} has moments about {len(centres)} points (CofR); give one run's file"
        )
    centre = np.array(centres.pop() if centres else ())
    if len(centre) != 3 or not np.isfinite(centre).all():
        why = "does not say what point its moments are about"
        raise SceneError(
            f"--forces: {path} {why}; add a line '# CofR : (x y z)' on top, or write it with a newer version"
        )
    return centre


def _joined(folder: Path, runs: Sequence[_Run]) -> ForcesInTime:
    """All runs one after the other; the later start wins where they overlap."""
    parts = [_of_file(run.path, _moments_beside(run.path)) for run in runs]
    names = [str(run.path.relative_to(folder)) for run in runs]
    kept = []
    for k, (run, part) in enumerate(zip(runs, parts, strict=True)):
        before = part.times < np.inf
        for n in range(k + 1, len(runs)):
            if not _older(run, runs[n], bool(part.times[-1] > parts[n].times[0])):
                why = "have the same times, and which is the newer is not known"
                raise _one_of(folder, names[k], names[n], why)
            before &= (part.times <= runs[n].start) & (part.times < parts[n].times[0])
        kept.append(part.only(before))
    joined = [(name, part) for name, part in zip(names, kept, strict=True) if len(part.times)]
    first, centre = joined[0][0], joined[0][1].centre
    for name, part in joined:
        if (part.centre != centre).any():
            why = f"have moments about {centre} and {part.centre}"
            raise _one_of(folder, first, name, why)
    sources = [f"{name} {part.times[0]:g} to {part.times[-1]:g}" for name, part in joined]
    sources += [f"{name} superseded" for name in names if name not in dict(joined)]
    times, forces, moments = (
        np.concatenate([getattr(part, name) for _, part in joined])
        for name in ("times", "forces", "moments")
    )
    return ForcesInTime(times, forces, moments, centre, tuple(sources))


def _one_of(folder: Path, first: str, second: str, why: str) -> SceneError:
    remedy = "give one of them, or move away what no longer counts"
    return SceneError(f"--forces: {first} and {second} in {folder} {why}; {remedy}")

"""Forces of another program's run, and verdicts: on their mean with its standard errors, and on all times.

They are read as OpenFOAM's function object `forces` writes them. `force.dat` and `moment.dat` of openfoam.com have
total, pressure, viscous and possibly porous columns; `forces.dat` of openfoam.org and foam-extend pressure and viscous
force, then moments, possibly with porous ones. A folder has one folder for each start, named by its time; a run that
finds a file adds its start to the name (`force_5.dat`). Later starts replace earlier ones.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Booleans, Floats
from ..errors import SceneError
from ..input_files import LARGEST_TABLE, reading
from ..results.loads import columns_of_load
from ..results.quantity import labelled
from .case import Case, CaseErrors, judge_case, text
from .series import (
    FEWEST,
    Series,
    critical_velocities,
    judge_series,
    mean_in_time,
    samples_from,
    velocities_text,
)

DECIMAL = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
RUN = re.compile(rf"(?P<kind>forces?|moment)(?:_(?P<start>{DECIMAL}))?\.dat")
CENTRE = re.compile(r"#\s*CofR\s*:?\s*\(?([^)\n]*)\)?", re.IGNORECASE)
ROUNDING = 1e-5  # of a total that is written beside its parts, relative to the largest part
FORMATS = "force.dat and moment.dat (openfoam.com) or forces.dat (openfoam.org, foam-extend)"


@dataclass(frozen=True, eq=False)
class ForcesInTime:
    """Force and moment on the grain, in the units of the other program.

    times: (n,); forces, moments: (n, 3), the latter about `centre` (3,); sources: files, each with its times
    """

    times: Floats
    forces: Floats
    moments: Floats
    centre: Floats
    sources: tuple[str, ...] = ()

    def only(self, which: Booleans) -> ForcesInTime:
        chosen = {name: getattr(self, name)[which] for name in ("times", "forces", "moments")}
        return replace(self, **chosen)


def read_forces(path: Path) -> ForcesInTime:
    """Read the forces in a file or folder of OpenFOAM.

    Raises SceneError if there are none, a file is of no known format, moments or their centre are missing, or the files
    of a folder can be joined in more than one way.
    """
    if path.is_dir():
        return _joined(path, sorted(_runs(path)))
    if path.name.startswith("moment"):
        raise SceneError(
            f"--forces: {path} has only moments; give the force.dat next to it, or their folder"
        )
    return _of_file(path)


# Start, whether the run added its start to the name of an existing file, and the file.
_Run = tuple[float, bool, Path]


def _runs(path: Path) -> Iterator[_Run]:
    for file in [*sorted(path.glob("*.dat")), *sorted(path.glob("*/*.dat"))]:
        name, folder = RUN.fullmatch(file.name), file.parent
        if name is None or (folder != path and not re.fullmatch(DECIMAL, folder.name)):
            continue
        if name["kind"] == "moment":
            beside = (
                file.with_name(kind + file.name[len("moment") :]) for kind in ("force", "forces")
            )
            if not any(other.is_file() for other in beside):
                raise SceneError(f"--forces: {file} has no file of forces next to it; move it away")
            continue
        start = -np.inf if folder == path else float(folder.name)
        yield float(name["start"] or start), name["start"] is not None, file


def _of_file(path: Path) -> ForcesInTime:
    table, header = _table(path)
    if "moment" in header:  # both in one file
        _require_columns(path, table, "forces.dat", (13, 19))
        halves = table[:, 1:].reshape(len(table), 2, -1, 3).sum(axis=2)
        return ForcesInTime(table[:, 0], halves[:, 0], halves[:, 1], _centre(path, header))
    _require_columns(path, table, "force.dat", (10, 13))
    beside = path.with_name(re.sub("^forces?", "moment", path.name))
    if not beside.is_file():
        raise SceneError(
            f"--forces: {beside} is missing; write moments also, with CofR in the function object"
        )
    moments, header = _table(beside)
    if moments.shape != table.shape or not np.array_equal(moments[:, 0], table[:, 0]):
        raise SceneError(
            f"--forces: {beside} has other times than {path.name}; give files of one run"
        )
    for values, name in ((table, path), (moments, beside)):
        parts = values[:, 4:].reshape(len(values), -1, 3)
        wrong = np.abs(values[:, 1:4] - parts.sum(axis=1)) > ROUNDING * np.abs(parts).max()
        if wrong.any():
            raise SceneError(
                f"--forces: {name}: the total at time {values[wrong.any(axis=1), 0][0]:g} is not the sum of its parts; "
                "write it again"
            )
    return ForcesInTime(table[:, 0], table[:, 1:4], moments[:, 1:4], _centre(beside, header))


def _require_columns(path: Path, table: Floats, name: str, counts: tuple[int, int]) -> None:
    if table.shape[1] not in counts:
        raise SceneError(
            f"--forces: {path} has {table.shape[1]} numbers a line; "
            f"{name} has {counts[0]}, or {counts[1]} with porous ones"
        )


def _table(path: Path) -> tuple[Floats, str]:
    with reading(path, f"give {FORMATS}", LARGEST_TABLE, name=f"--forces: {path}"):
        lines = path.read_text(encoding="utf-8").splitlines()
        header = "\n".join(line for line in lines if line.startswith("#"))
        rows = [re.sub("[()]", " ", line).split() for line in lines if line[:1] not in ("#", "")]
        if len(rows) > 1 and len(rows[-1]) != len(rows[0]):  # of a run that was stopped, or goes on
            rows.pop()
        table = np.array(rows, dtype=float)
    if not len(table):
        raise SceneError(
            f"--forces: {path} has no samples yet; continue the run, or move the file away"
        )
    if len(times := table[~np.isfinite(table).all(axis=1), 0]):
        raise SceneError(f"--forces: {path} is not finite at time {times[0]:g}; remove such lines")
    if len(times := table[1:, 0][np.diff(table[:, 0]) <= 0.0]):
        raise SceneError(
            f"--forces: {path} has time {times[0]:g} twice or out of order; keep one line for each time"
        )
    return table, header.lower()


def _centre(path: Path, header: str) -> Floats:
    centres = {tuple(map(float, re.findall(DECIMAL, text))) for text in CENTRE.findall(header)}
    if len(centres) > 1:
        raise SceneError(
            f"--forces: {path} has moments about {len(centres)} points (CofR); give one run's file"
        )
    centre = np.array(list(*centres))
    if len(centre) != 3 or not np.isfinite(centre).all():
        raise SceneError(
            f"--forces: {path} does not name the point of its moments; "
            "add a line '# CofR : (x y z)' on top, or write it with a newer version"
        )
    return centre


def _joined(folder: Path, runs: Sequence[_Run]) -> ForcesInTime:
    if not runs:
        raise SceneError(
            f"--forces: {folder} holds no forces; give a folder with {FORMATS}, or with folders by time"
        )
    parts = [_of_file(path) for *_, path in runs]
    names = [str(path.relative_to(folder)) for *_, path in runs]
    for (run, other), (part, later), (earlier, newer) in zip(
        pairwise(runs), pairwise(parts), pairwise(names), strict=True
    ):
        # Was the later one resumed from a run that was started again, or from the one before it?
        unclear = run[1] and part.times[-1] > later.times[0]
        if run[:2] == other[:2] or unclear or (run[2].parent == folder != other[2].parent):
            raise _conflict(
                folder, earlier, newer, "have the same times, and which is newer is not known"
            )
    kept, until, before = dict[str, ForcesInTime](), np.inf, np.inf
    for (start, *_), part, name in zip(runs[::-1], parts[::-1], names[::-1], strict=True):
        there = (part.times <= until) & (part.times < before)
        if there.any():
            kept[name] = part.only(there)
        until, before = min(until, start), min(before, float(part.times[0]))
    joined = dict(reversed(kept.items()))
    first, *others = joined
    centre = joined[first].centre
    for name in others:
        if (joined[name].centre != centre).any():
            why = f"have moments about {centre} and {joined[name].centre}"
            raise _conflict(folder, first, name, why)
    sources = [f"{name} {part.times[0]:g} to {part.times[-1]:g}" for name, part in joined.items()]
    sources += [f"{name} superseded" for name in names if name not in joined]
    times, forces, moments = (
        np.concatenate([getattr(part, name) for part in joined.values()])
        for name in ("times", "forces", "moments")
    )
    return ForcesInTime(times, forces, moments, centre, tuple(sources))


def _conflict(folder: Path, first: str, second: str, why: str) -> SceneError:
    remedy = "give one of them, or move the obsolete one away"
    return SceneError(f"--forces: {first} and {second} in {folder} {why}; {remedy}")


@dataclass(frozen=True, eq=False)
class JudgedForces:
    """Verdicts on the mean from the time `since` on, and on all times; flows that move the grain."""

    since: float
    samples: int
    judgement: dict[str, Any]
    series: Series

    def text(self) -> str:
        sources, velocities = self.judgement["forces"], self.judgement["threshold"]
        lines = labelled("forces", ", ".join(sources)) if sources else []
        lines.append(f"mean from time {self.since:.6g} on, {self.samples} samples:")
        lines.append(text(self.judgement))
        lines += [] if velocities is None else [velocities_text(velocities)]
        return "\n".join([*lines, "", "all times:", self.series.text()])


def judge_forces(
    case: Case, forces: ForcesInTime, density: float, since: float | None, law: str | None = None
) -> JudgedForces:
    """Judge the forces of a run, with all but the flow's load from a case.

    Args:
        density: of the fluid, over that with which the other program computed the forces.
        since: start of the samples; None: all samples, and the mean of the last half of the time.
        law: growth of loads with the velocity, one of `series.LAWS`, for flows that move the grain.

    Raises SceneError for too few samples, or a density that is not positive.
    """
    if not 0.0 < density < np.inf:
        raise SceneError(
            f"--density: is {density:g}; give that of the fluid over rhoInf, a number above zero"
        )
    if since is None:
        start = float(forces.times[0] + 0.5 * np.ptp(forces.times))
    else:
        start, forces = since, forces.only(samples_from(forces.times, since))
    loads = density * np.hstack([forces.forces, forces.moments])
    last = samples_from(forces.times, start)
    mean, error = mean_in_time(loads[last], forces.times[last])
    if last.sum() < FEWEST:
        raise SceneError(
            f"--forces: the mean has {last.sum()} samples from time {forces.times[last][0]:g} on, and needs "
            f"{FEWEST} or more; give an earlier time with --since, or write forces more often"
        )
    about = tuple(forces.centre[: case.gdim].tolist())
    load = case.load.model_copy(update={**_flow(case.gdim, mean), "about": about})
    errors = (case.errors or CaseErrors()).model_copy(update=_flow(case.gdim, error))
    case = case.model_copy(update={"load": load, "errors": errors})
    columns = columns_of_load(loads.T, case.gdim, torque="couple") | {"time": forces.times}
    judgement, series = judge_case(case), judge_series(case, columns, start)
    threshold = None
    if law is not None:
        within = judgement["probabilities"]["within"]
        ends = (judgement["verdict"]["safety_factor"], within["low"], within["high"])
        factors = tuple(np.inf if factor is None else float(factor) for factor in ends)
        threshold = critical_velocities(law, series, factors)
    judgement |= {
        "motion": series.record["motion"],
        "threshold": threshold,
        "forces": list(forces.sources),
    }
    return JudgedForces(start, int(last.sum()), judgement, series)


def _flow(gdim: int, values: Floats) -> dict[str, Any]:
    numbers = values.tolist()
    torque = numbers[5] if gdim == 2 else tuple(numbers[3:])
    return {"flow_force": tuple(numbers[:gdim]), "flow_couple": torque}

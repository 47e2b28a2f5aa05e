"""Forces of another program's run on the grain and contacts of a case: the mean with its error, and all times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import SceneError
from .forces_of_openfoam import SHARE, ForcesInTime
from .judge_case import Case, CaseErrors, judge_case, load_case, text
from .judge_series import Series, judge_series
from .motion_in_time import FlowThreshold

LOAD = ("load.flow_force", "load.flow_couple")


@dataclass(frozen=True, eq=False)
class JudgedForces:
    """The verdict on the mean of the last part, with standard errors, and on all times; flows that move the grain.

    sources: files that the forces are from, each with the times that it gives
    """

    case: Case
    since: float
    samples: int
    judgement: dict[str, Any]
    series: Series
    threshold: FlowThreshold | None
    sources: tuple[str, ...] = ()

    def text(self) -> str:
        """Both in a few lines."""
        mean = f"mean from time {self.since:.6g} on, {self.samples} samples:"
        lines = [f"{'forces':<20}{', '.join(self.sources)}"] if self.sources else []
        lines += [mean, text(self.case, self.judgement)]
        lines += [] if self.threshold is None else [self.threshold.text()]
        return "\n".join([*lines, "", "all times:", self.series.text()])


def load_case_without_load(path: Path, overrides: Sequence[str]) -> Case:
    """The case in a file whose force and couple of the flow come from elsewhere; raises as `load_case`."""
    try:
        return load_case(path, overrides)
    except SceneError as error:
        if not any(name in str(error) for name in LOAD):
            raise
    messages = []
    for zeros in (("[0.0, 0.0]", "0.0"), ("[0.0, 0.0, 0.0]", "[0.0, 0.0, 0.0]")):
        none = [f"{name}={zero}" for name, zero in zip(LOAD, zeros, strict=True)]
        try:
            case = load_case(path, [*none, *overrides])
        except SceneError as error:
            message = str(error)
            for setting in none:  # nobody gave them
                message = message.replace(f" --set {setting}", "")
            messages.append(message)
        else:
            said = "".join(f", with {one}" for one in none)
            return case.model_copy(update={"title": case.title.replace(said, "")})
    of_others = (said for said in messages if not any(name in said for name in LOAD))
    raise SceneError(next(of_others, messages[0]))


def judge_forces(
    case: Case, found: ForcesInTime, density: float, since: float | None, law: str | None = None
) -> JudgedForces:
    """Judge the forces of a run on a case, of which everything but the flow's load is taken.

    Args:
        density: of the fluid, over that which the other program computed the forces with.
        since: time from which on they are taken; None: all, and the mean of the last half of the time.
        law: how loads grow with the velocity, one of `motion_in_time.LAWS`, for flows that move the grain.

    Raises:
        SceneError: the density is not positive, or too few samples are left.
    """
    if not 0.0 < density < np.inf:
        raise SceneError(
            f"--density: is {density:g}; give that of the fluid over rhoInf, a number above zero"
        )
    kept = found if since is None else found.later(since)
    start = (
        float(kept.times[0] + SHARE * (kept.times[-1] - kept.times[0])) if since is None else since
    )
    last = kept.later(start)
    mean, errors = (density * one for one in last.mean())
    case = _about(case, found)
    changes = {"flow_force": _vector(case, mean), "flow_couple": _couple(case, mean)}
    own = case.errors or CaseErrors()
    given = {"flow_force": _vector(case, errors), "flow_couple": _couple(case, errors)}
    of_mean = case.model_copy(
        update={
            "load": case.load.model_copy(update=changes),
            "errors": own.model_copy(update=given),
        }
    )
    force, moment = density * kept.forces, density * kept.moments
    axes = "xyz"[: case.gdim]
    columns = {"time": kept.times, **{f"force_{axis}": force[:, i] for i, axis in enumerate(axes)}}
    if case.gdim == 2:
        columns["couple"] = moment[:, 2]
    else:
        columns |= {f"couple_{axis}": moment[:, i] for i, axis in enumerate(axes)}
    judgement, series = judge_case(of_mean), judge_series(case, columns, start)
    threshold = None
    if law is not None:
        within = judgement["probabilities"]["within"]
        ends = (judgement["verdict"]["safety_factor"], within["low"], within["high"])
        value, low, high = (np.inf if one is None else float(one) for one in ends)
        threshold = FlowThreshold.of(law, series.times, series.batch, start, (value, low, high))
    judgement |= {
        "motion": asdict(series.motion),
        "threshold": None if threshold is None else asdict(threshold),
        "forces": list(found.sources),
    }
    return JudgedForces(
        of_mean, start, len(last.times), judgement, series, threshold, found.sources
    )


def _about(case: Case, found: ForcesInTime) -> Case:
    """The case with its couple about the point of the moments."""
    about = tuple(found.centre[: case.gdim].tolist())
    return case.model_copy(update={"load": case.load.model_copy(update={"about": about})})


def _vector(case: Case, values: Any) -> tuple[float, ...]:
    return tuple(values[: case.gdim].tolist())


def _couple(case: Case, values: Any) -> float | tuple[float, ...]:
    return float(values[5]) if case.gdim == 2 else tuple(values[3:].tolist())

"""Verdicts on the forces of another program's run: on their mean with its standard errors, and on all times."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..arrays import Floats
from ..errors import SceneError
from .case import Case, CaseErrors, judge_case, text
from .motion import FEWEST, FlowThreshold, mean_in_time, samples_from
from .openfoam import ForcesInTime
from .series import Series, judge_series
from .table import columns_of

FRACTION = 0.5  # of the time, the last, over which a mean is taken by default


@dataclass(frozen=True, eq=False)
class JudgedForces:
    """Verdicts on the mean from the time `since` on, and on all times; flows that move the grain."""

    case: Case
    since: float
    samples: int
    judgement: dict[str, Any]
    series: Series
    threshold: FlowThreshold | None

    def text(self) -> str:
        sources = self.judgement["forces"]
        lines = [f"{'forces':<20}{', '.join(sources)}"] if sources else []
        lines.append(f"mean from time {self.since:.6g} on, {self.samples} samples:")
        lines.append(text(self.case, self.judgement))
        lines += [] if self.threshold is None else [self.threshold.text()]
        return "\n".join([*lines, "", "all times:", self.series.text()])


def judge_forces(
    case: Case, forces: ForcesInTime, density: float, since: float | None, law: str | None = None
) -> JudgedForces:
    """Judge the forces of a run, with all but the flow's load from a case.

    Args:
        density: of the fluid, over that with which the other program computed the forces.
        since: start of the samples; None: all samples, and the mean of the last half of the time.
        law: growth of loads with the velocity, one of `motion.LAWS`, for flows that move the grain.

    Raises SceneError for too few samples, or a density that is not positive.
    """
    if not 0.0 < density < np.inf:
        remedy = "give that of the fluid over rhoInf, a number above zero"
        raise SceneError(f"--density: is {density:g}; {remedy}")
    if since is None:
        start = float(forces.times[0] + FRACTION * np.ptp(forces.times))
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
    columns = columns_of("force", loads[:, :3], case.gdim)
    columns |= columns_of("couple", loads[:, 3:], case.gdim) | {"time": forces.times}
    judgement, series = judge_case(case), judge_series(case, columns, start)
    threshold = None
    if law is not None:
        within = judgement["probabilities"]["within"]
        ends = (judgement["verdict"]["safety_factor"], within["low"], within["high"])
        factors = tuple(np.inf if factor is None else float(factor) for factor in ends)
        threshold = FlowThreshold.of(law, series.times, series.batch, start, factors)
    judgement |= {
        "motion": asdict(series.motion),
        "threshold": None if threshold is None else asdict(threshold),
        "forces": list(forces.sources),
    }
    return JudgedForces(case, start, int(last.sum()), judgement, series, threshold)


def _flow(gdim: int, values: Floats) -> dict[str, Any]:
    numbers = values.tolist()
    torque = numbers[5] if gdim == 2 else tuple(numbers[3:])
    return {"flow_force": tuple(numbers[:gdim]), "flow_couple": torque}

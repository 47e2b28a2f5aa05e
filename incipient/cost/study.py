"""What accuracy costs for a scene: a ladder of runs, their errors against a finer one, and the law behind them.

Every run has a process of its own (`incipient.cost.measurement`). Their numbers are kept as they come
(`incipient.cost.records`): a study that was interrupted resumes there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ConvergenceError, OutputError, SceneError
from ..files import reported
from ..output.ownership import OTHERS, SCENE, place_scene, refuse_foreign
from ..planning import expense
from ..scene import Scene, load
from ..scene.file import dumps
from . import calibration, frontier
from .calibration import Calibration, Findings
from .comparison import Compared, compared
from .frontier import CostLaw, Reference, percent, seconds
from .ladder import Ladder
from .laws import ErrorLaw, fitted_errors, fitted_time, geometric_mean
from .measurement import JudgedRun, MeasuredRun, Variant
from .quantities import ComparedNumbers, ErrorNorm
from .records import TABLE, append, completed, known_runs

LEAST_WORK = 1.05  # times its start: what the shortest run takes
EARLIER = (
    "of an earlier version; its runs are kept, but those to be compared with other solver options. Times of "
    "different days compare badly: delete it to measure all again"
)
Measure = Callable[[Scene, Variant], MeasuredRun]
Say = Callable[[str], None]


class Study:
    """The runs of a scene's ladder, judged: their errors against the finest of them, and what they cost.

    compared_with, reference: the finest run, and its numbers, improved
    goals:  the errors that are looked at
    judged: completed runs without the reference, cheapest first; failed: those that gave nothing
    front:  indices of those that are better, by a tenth at least, than all that take less processor time
    laws:   time [s] against error on the fronts, of processor ("cpu") and wall time ("wall")
    of_goals: the laws of processor time by goal

    Args:
        runs: of the ladder, the reference last.

    Raises:
        ConvergenceError: fewer than two runs succeeded, or there is nothing to compare.
    """

    def __init__(self, scene: Scene, ladder: Ladder, runs: Sequence[MeasuredRun]):
        self.scene, self.ladder = scene, ladder
        self.failed = tuple(run for run in runs if run.failed)
        good = [run for run in runs if not run.failed]
        if len(good) < 2:
            reasons = "; ".join(dict.fromkeys(run.failed for run in self.failed))
            raise ConvergenceError(f"cost: fewer than two runs of the ladder succeeded: {reasons}")
        self.compared_with, self.reference = _reference(ladder, good)
        self.goals = ComparedNumbers(scene).goals(self.reference.values)
        if not self.goals:
            raise ConvergenceError("cost: all numbers to compare are zero")
        rest = sorted(
            (run for run in good if run is not self.compared_with), key=lambda run: run.cpu
        )
        self.judged = tuple(map(self._judged, rest))
        errors = [one.error if one.told_apart else math.inf for one in self.judged]
        self.front = tuple(self._front(errors))
        starts = {name: _start(good, name) for name in ("cpu", "wall")}
        self.laws = {name: self._law(errors, name, start) for name, start in starts.items()}
        clear = {goal.name: self._clear_errors(goal) for goal in self.goals}
        self.of_goals = {
            name: self._law(errors, "cpu", starts["cpu"]) for name, errors in clear.items()
        }

    def frontier(self) -> tuple[list[float], list[float]]:
        """Processor times [s] and errors of the runs on the front."""
        best = [self.judged[index] for index in self.front]
        return [one.run.cpu for one in best], [one.error for one in best]

    def solvers(self) -> tuple[Compared, ...]:
        """Other solver options compared with the scene's own."""
        return compared(self.judged, self.front, self.goals)

    def words(self) -> str:
        """What accuracy costs, in a line of words."""
        if law := self.laws["cpu"]:
            times, errors = self.frontier()
            return frontier.words(law, errors, times)
        shown = dict.fromkeys((0, min(range(len(self.judged)), key=lambda i: self.judged[i].error)))
        said = [
            f"{percent(self.judged[i].error)}: {seconds(self.judged[i].run.cpu)}" for i in shown
        ]
        return f"{', '.join(said)}; too few runs can be told apart from the reference for a law"

    def doubt(self, goal: ErrorNorm) -> float:
        """Uncertainty of the reference in terms of a goal's relative error."""
        return math.hypot(*(self.reference.uncertainty[name] for name in goal.columns)) / goal.scale

    def _judged(self, run: MeasuredRun) -> JudgedRun:
        errors = {goal.name: goal.error(run.found, self.reference.values) for goal in self.goals}
        known = [(errors[goal.name], self.doubt(goal)) for goal in self.goals if goal.leading]
        return JudgedRun(run, errors, max(error for error, _ in known), _clear(known))

    def _clear_errors(self, goal: ErrorNorm) -> list[float]:
        """The errors of a goal; infinite where they are not clearly more than the doubt about the reference."""
        found, unsure = [one.errors[goal.name] for one in self.judged], self.doubt(goal)
        return [error if _clear([(error, unsure)]) else math.inf for error in found]

    def _front(self, errors: Sequence[float]) -> list[int]:
        return frontier.front([one.run.cpu for one in self.judged], errors, frontier.WORTH)

    def _law(self, errors: Sequence[float], time: str, start: float) -> CostLaw | None:
        """The law of a time, "cpu" or "wall", on the front of errors."""
        best = self._front(errors)
        times = [getattr(self.judged[index].run, time) for index in best]
        return frontier.fitted(times, [errors[index] for index in best], start)


def _start(runs: Sequence[MeasuredRun], time: str) -> float:
    """Time, "cpu" or "wall", of a run before it computes anything; less than the shortest run."""
    # Corrections with another solver option have another price.
    own = _own(runs) or runs
    unknowns, solves = [run.unknowns for run in own], [max(run.counts.newton, 1) for run in own]
    found = frontier.overhead([getattr(run, time) for run in own], unknowns, solves)
    shortest = min(getattr(run, time) for run in runs)
    return max(min(found, shortest / LEAST_WORK), min(run.start for run in runs))


def _own(runs: Sequence[MeasuredRun]) -> list[MeasuredRun]:
    """The runs solved as the scene says."""
    return [run for run in runs if not run.variant.solver]


def _reference(ladder: Ladder, good: Sequence[MeasuredRun]) -> tuple[MeasuredRun, Reference]:
    """The run that the others are compared with, the finest that there is, and its improved numbers."""
    by_rung = {run.variant.key: run for run in good}
    line = [by_rung[variant.key] for variant in ladder.line if variant.key in by_rung]
    if not line or line[-1].variant.key != ladder.reference.key:
        # The reference failed: the finest of the others, as it is.
        line = [max(_own(good) or good, key=_fineness)]
    ratio = ladder.ratio if len(line) == len(ladder.line) else math.nan
    others = [run.found for run in _own(good) if run is not line[-1]]
    return line[-1], frontier.reference([run.found for run in line], ratio, others)


def _fineness(run: MeasuredRun) -> tuple[float, ...]:
    return run.variant.order, -(run.variant.step or 0.0), -run.variant.mesh_size


def _clear(known: Sequence[tuple[float, float]]) -> bool:
    """Whether the largest of errors is known to a factor, each of them with the doubt about its reference.

    A large error that is well known may still be less than another that is not.
    """
    least = max(error - doubt for error, doubt in known)
    most = max(error + doubt for error, doubt in known)
    return least > frontier.ROUND_OFF and most < frontier.TOLD_APART * least


def to_dict(study: Study) -> dict[str, Any]:
    """The study as plain data for cost.json."""
    found: dict[str, Any] = {
        "schema_version": 1,
        "title": study.scene.title,
        "words": study.words(),
    }
    found["reference"] = {"run": study.compared_with.variant.name, **vars(study.reference)}
    found["goals"] = [{**vars(goal), "doubt": study.doubt(goal)} for goal in study.goals]
    found["laws"] = {name: law and vars(law) for name, law in study.laws.items()}
    found["laws_of_goals"] = {name: law and vars(law) for name, law in study.of_goals.items()}
    found["solvers"] = [vars(one) for one in study.solvers()]
    found["runs"] = [
        {
            **vars(one.run.variant),
            "name": one.run.variant.name,
            **{name: getattr(one, name) for name in ("error", "errors", "told_apart")},
            "on_front": index in study.front,
            **{name: getattr(one.run, name) for name in ("wall", "cpu", "unknowns", "peak_mib")},
        }
        for index, one in enumerate(study.judged)
    ]
    found["failed"] = [{"name": run.variant.name, "why": run.failed} for run in study.failed]
    return found


def run_ladder(scene: Scene, ladder: Ladder, directory: Path, measure: Measure, say: Say) -> Study:
    """Make the runs of a ladder that a directory does not hold yet, and judge all of them. Not collective.

    Raises:
        SceneError: the scene's runs give nothing to compare.
        OutputError: the directory holds the ladder of another scene, or cannot be written.
        ConvergenceError: too few runs succeeded.
    """
    columns = ComparedNumbers(scene).columns
    if not columns:
        raise SceneError("cost: the scene gives no number to compare")
    prepare(scene, directory)
    done, wanted = known_runs(columns, directory), [*ladder.variants, ladder.reference]
    if completed(directory, ladder.compared):
        done = known_runs(columns, directory)
        if any(variant.key not in done for variant in wanted):
            say(f"{directory}: {EARLIER}")
    for number, variant in enumerate(wanted, 1):
        if variant.key in done:
            continue
        run = done[variant.key] = measure(scene, variant)
        append(columns, run, directory)
        spent = f"{run.unknowns} unknowns, processor {run.cpu:.2f} s, wall {run.wall:.2f} s"
        came = run.failed or f"{spent}, {run.peak_mib:.0f} MiB"
        say(f"{number} of {len(wanted)}: {variant.name}: {came}")
    return Study(scene, ladder, [done[variant.key] for variant in wanted])


def prepare(scene: Scene, directory: Path) -> None:
    """Make the directory of a scene's ladder, or check that it is; raises OutputError."""
    stored = directory / SCENE
    refuse_foreign(directory, {*OTHERS["cost"], SCENE})
    if (directory / TABLE).exists() and stored.exists():
        if load(stored) != scene:
            remedy = "choose another --out or delete it"
            raise OutputError(f"{directory}: holds the runs of another scene; {remedy}")
        return
    with reported(directory):
        directory.mkdir(parents=True, exist_ok=True)
        (directory / TABLE).unlink(missing_ok=True)
    place_scene(directory, dumps(scene), OTHERS["cost"])


def findings(study: Study) -> Calibration:
    """Findings of a study by its runs solved as the scene says, none without any. Not collective."""
    scene, end = study.scene, study.scene.time.end if study.scene.time else 0.0
    runs = [*(one.run for one in study.judged), study.compared_with]
    if not (own := _own(runs)):
        return {}
    steps = np.array([end / run.variant.step if run.variant.step else 0.0 for run in own])
    unknowns, cpu = np.array([(run.unknowns, run.cpu) for run in own], dtype=float).T
    errors = {goal.name: _errors(study, goal.name) for goal in study.goals if goal.leading}
    cheaper = {one.solver: one.time_at_error for one in study.solvers() if one.cheaper}
    found = Findings(
        title=scene.title or "a scene without a title",
        kind=calibration.kind(scene),
        time=fitted_time(unknowns, steps, cpu, min(run.start for run in own)),
        memory=geometric_mean([run.peak_mib / expense.memory(run.unknowns) for run in own]),
        errors={name: laws for name, laws in errors.items() if laws},
        cheaper={solver: share for solver, share in cheaper.items() if share},
    )
    return {calibration.digest(scene): found}


def _errors(study: Study, goal: str) -> dict[int, ErrorLaw]:
    """The laws of an error, by the runs that can be told apart from the reference."""
    scene, time, seen = study.scene, study.scene.time, []
    for one in study.judged:
        variant, error = one.run.variant, one.errors[goal]
        if one.told_apart and not variant.solver and error > 0.0:
            step = calibration.step_of_flow(
                variant.step, scene.reference_velocity, scene.reference_length
            )
            seen.append((variant.order, variant.mesh_size, step, error))
    return fitted_errors(
        np.array(seen).reshape(-1, 4), 1.0 if time and time.scheme == "bdf1" else 2.0
    )

"""Cost study of a scene; `cost.json` stores each run, so that an interrupted study resumes."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from ..errors import ConvergenceError, OutputError
from ..files import csv_text, make_directory, write_json, write_results
from ..input_files import reading
from ..output.ownership import SCENE, place_scene, refuse_foreign
from ..results.kinds import COST
from ..scene import Scene, load
from ..scene.file import dumps
from . import frontier
from .frontier import percent, seconds
from .ladder import RATIO, Rung, own_rung
from .measurement import MeasuredRun, Quantity

STUDY, TABLE = "cost.json", "cost.csv"
ROUND_OFF = 1e-9  # relative error that counts as zero

Measure = Callable[[Scene, Rung, str], MeasuredRun]


@dataclass(frozen=True)
class Reference:
    """Reference quantities, their largest relative uncertainty, and their origin."""

    quantities: Mapping[str, Quantity]
    doubt: float
    source: str


@dataclass(frozen=True)
class JudgedRun:
    """A run, its relative errors by quantity, and the uncertainty of the reference."""

    run: MeasuredRun
    errors: dict[str, float]
    doubt: float

    @property
    def resolved(self) -> bool:
        # Errors below twice the uncertainty of the reference are not.
        return 2.0 * self.doubt < max(self.errors.values())

    @property
    def error(self) -> float:
        return max(self.errors.values()) + (0.0 if self.resolved else self.doubt)

    @property
    def said(self) -> str:
        return f"{'' if self.resolved else '<'}{percent(self.error)}"

    @property
    def row(self) -> dict[str, Any]:
        names = ("cpu", "wall", "peak_mib", "cells", "unknowns", "newton")
        cost = {name: getattr(self.run, name) for name in names}
        return asdict(self.run.rung) | {"error": self.error} | cost


class Study:
    """Completed runs of a ladder, compared with the last of them.

    judged: cheapest first. own: the scene's resolution, None if it failed. frontier: runs with an
    error at least a tenth smaller than all cheaper ones. law: CPU time against error along it, or None.

    Raises ConvergenceError if fewer than two runs succeeded.
    """

    def __init__(self, scene: Scene, runs: Sequence[MeasuredRun]):
        self.own_rung = own_rung(scene)
        runs = _comparable(runs)
        self.failed = tuple(run for run in runs if run.failed)
        good = [run for run in runs if not run.failed]
        if len(good) < 2:
            reasons = "; ".join(dict.fromkeys(run.failed for run in self.failed))
            raise ConvergenceError(f"cost: fewer than two runs of the ladder succeeded: {reasons}")
        self.finest = good[-1]
        self.reference = _reference(good)
        good.sort(key=lambda run: run.cpu)
        quantities, doubt = self.reference.quantities.items(), self.reference.doubt
        errors = ({name: each.error(run.numbers) for name, each in quantities} for run in good)
        self.judged = tuple(JudgedRun(*pair, doubt) for pair in zip(good, errors, strict=True))
        self.own = next(
            (judged for judged in self.judged if judged.run.rung == self.own_rung), None
        )
        times = [run.cpu for run in good]
        best = frontier.front(times, [judged.error for judged in self.judged], frontier.WORTH)
        self.frontier = tuple(self.judged[index] for index in best)
        self.law = frontier.fitted(
            [(each.run.cpu, each.error) for each in self.frontier if each.resolved],
            frontier.overhead(
                times, [run.unknowns for run in good], [max(run.newton, 1) for run in good]
            ),
        )

    @cached_property
    def sentence(self) -> str:
        """Cost of the scene's resolution, and of a tenth of its error, as a sentence."""
        if self.own is None:
            return f"As the scene stands ({self.own_rung.name}) its run failed."
        own, target, cheapest = self.own, 0.1 * self.own.error, self.judged[0].run
        spent = (
            f"As the scene stands ({own.run.rung.name}) a run takes {seconds(own.run.cpu)} of CPU time without error "
            "bars"
        )
        if max(judged.error for judged in self.judged) < ROUND_OFF:
            cheap = f"{cheapest.rung.name}, {seconds(cheapest.cpu)}"
            return f"{spent}; all runs agree to round-off, so that the cheapest is as accurate ({cheap})."
        if not own.resolved:
            below = f"below {percent(max(own.error, ROUND_OFF))}"
            return f"{spent}. Its error is {below}, which these runs do not resolve; add finer cells by --sizes."
        return (
            f"{spent} for an error of {percent(own.error)}; ten times less error ({percent(target)}) "
            f"{self._price(target, own.run.cpu)}."
        )

    def _price(self, error: float, own_time: float) -> str:
        reached = [judged.run for judged in self.judged if judged.error <= error]
        if reached:
            return f"takes {seconds(reached[0].cpu)} ({reached[0].rung.name})"
        time = self.law.time(error) if self.law else 0.0
        if time < own_time:
            return f"is reached by no run here; the finest takes {seconds(self.finest.cpu)}"
        return f"takes about {seconds(time)} by extrapolation, {time / own_time:.2g} times as much"

    def text(self) -> str:
        names, doubt = ", ".join(self.reference.quantities), self.reference.doubt
        known = f", known to {percent(doubt)}" if doubt else ""
        lines = [
            f"{self.sentence}\n",
            f"  {'error':>9} {'CPU time':>9} {'of own':>7} {'memory':>9} {'unknowns':>9}  run",
            *map(self._line, self.judged),
            "\n* frontier: no cheaper run is as accurate; errors of cells, order and steps, not of gap and domain: the "
            f"largest relative one of: {names}",
            f"reference: {self.reference.source}{known}",
        ]
        if self.law:
            lines.append(
                f"along the frontier the time beyond the {seconds(self.law.start)} of starting grows by a factor of "
                f"{10.0 ** (1.0 / self.law.power):.2g} for ten times less error"
            )
        return "\n".join(
            [*lines, *(f"failed: {run.rung.name}: {run.failed}" for run in self.failed)]
        )

    def _line(self, judged: JudgedRun) -> str:
        run, mark = judged.run, "*" if judged in self.frontier else " "
        ratio = f"{run.cpu / self.own.run.cpu:.2g} x" if self.own else ""
        spent = f"{seconds(run.cpu):>9} {ratio:>7} {run.peak_mib:>5.0f} MiB {run.unknowns:>9,}"
        own = "  (the scene's own)" if judged is self.own else ""
        return f"{mark} {judged.said:>9} {spent}  {run.rung.name}{own}"

    def to_dict(self) -> dict[str, Any]:
        return {
            "sentence": self.sentence,
            "reference": self.reference,
            "law": self.law and vars(self.law),
            "judged": [
                judged.row
                | {"name": judged.run.rung.name, "said": judged.said, "resolved": judged.resolved}
                | {
                    "on_frontier": judged in self.frontier,
                    "own": judged is self.own,
                    "errors": judged.errors,
                }
                for judged in self.judged
            ],
        }


def _comparable(runs: Sequence[MeasuredRun]) -> list[MeasuredRun]:
    """The runs; those that lack a quantity of the finest one count as failed."""
    wanted = next((run.quantities for run in reversed(runs) if not run.failed), {})
    lacking = [
        ", ".join(name for name in wanted if not wanted[name].numbers.keys() <= run.numbers.keys())
        for run in runs
    ]
    return [
        replace(run, failed=f"its result has no {names}") if names and not run.failed else run
        for run, names in zip(runs, lacking, strict=True)
    ]


def _reference(good: Sequence[MeasuredRun]) -> Reference:
    finest, *others = reversed(good)
    at = [finest.rung.finer(-1), finest.rung.finer(-2)]
    line = [run.numbers for rung in at for run in others if run.rung.is_close(rung)]
    limits: dict[str, float] = {}
    if len(line) == 2:
        for name, value in finest.numbers.items():
            limit = frontier.extrapolated((line[1][name], line[0][name], value), RATIO)
            limits |= {} if limit is None else {name: limit}
    before = line[0] if line else others[0].numbers
    doubts = [quantity.error(before | limits) for quantity in finest.quantities.values()]
    best = finest.numbers | limits
    quantities = {
        key: Quantity({name: best[name] for name in quantity.numbers}, quantity.scale)
        for key, quantity in finest.quantities.items()
    }
    by = ", extrapolated by Richardson's rule" if limits else ""
    return Reference(quantities, max(doubts), f"{finest.rung.name}{by}")


def run_ladder(
    scene: Scene,
    rungs: Sequence[Rung],
    directory: Path,
    measure: Measure,
    say: Callable[[str], None],
    task: str = "run",
) -> Study:
    """Complete and evaluate the runs of a ladder.

    Raises OutputError for a directory of another scene or not writable, ConvergenceError if too few
    runs succeeded.
    """
    runs = _prepared(scene, task, directory)
    stored = {"schema_version": 2, "title": scene.title, "task": task}
    for number, rung in enumerate(rungs, 1):
        if rung in runs:
            continue
        run = runs[rung] = measure(scene, rung, task)
        write_json(directory / STUDY, stored | {"runs": [*runs.values()]})
        spent = f"{run.unknowns} unknowns, {seconds(run.cpu)} of CPU time, {run.peak_mib:.0f} MiB"
        say(f"{number} of {len(rungs)}: {rung.name}: {run.failed or spent}")
    study = Study(scene, [runs[rung] for rung in rungs])
    rows = [judged.row | judged.run.numbers for judged in study.judged]
    record = stored | study.to_dict() | {"runs": [*runs.values()]}
    write_results(directory, {STUDY: record, TABLE: csv_text([*rows[-1]], rows)})
    return study


def _prepared(scene: Scene, task: str, directory: Path) -> dict[Rung, MeasuredRun]:
    source, kept = directory / STUDY, directory / SCENE
    refuse_foreign(directory, {*COST.files, SCENE})
    if not (source.exists() and kept.exists()):
        make_directory(directory, source)
        place_scene(directory, dumps(scene), COST.files)
        return {}
    with reading(source, "delete it to start again", error=OutputError):
        stored = json.loads(source.read_text(encoding="utf-8"))
        runs = TypeAdapter(list[MeasuredRun]).validate_python(stored["runs"])
        if stored["task"] == task and load(kept) == scene:
            return {run.rung: run for run in runs}
    raise OutputError(
        f"{directory}: holds the study of another scene; choose another --out or delete it"
    )

"""A survey from start to end: the bed, its exposed grains, full runs of some by a sweep, thresholds of all."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Floats
from ..errors import SceneError
from ..files import csv_text, make_directory, write_json, write_text_atomically
from ..input_files import read_text
from ..output.lock import locked
from ..parallel import Comm, collectively, from_first
from ..progress import Silent
from ..scene.file import parse
from ..sweep import run as run_sweep
from ..sweep.cases import identity_of
from ..sweep.store import DONE, FAILED
from ..sweep.table import rows as rows_of
from .beds import spheres_of
from .deposition import Spheres
from .emulator import FEWEST, NINETY_FIVE, Emulator, designed, runs_to_halve
from .full_runs import (
    FullRun,
    LoadCoefficients,
    coefficients_of,
    reynolds_of,
    scene_of,
    share_of_error,
)
from .outcome import COLUMNS, EmulatorRecord, SurveyOutcome
from .pockets import Pocket, Surface, exposed, pockets
from .request import SurveyRequest
from .thresholds import LoadErrors, Threshold, features_of, thresholds

RUNS, GRAINS, SPHERES, RECORD = "runs.sqlite", "grains.csv", "spheres.csv", "survey.json"
FILES = (GRAINS, SPHERES, RECORD, "survey.png", "survey.vtp")


@dataclass(frozen=True)
class RunMeans:
    """How full runs are computed: more of them than asked in the file, at a time, in what time, failed ones again.

    scheduler, limit: as of a sweep
    """

    more: int = 0
    jobs: int | None = None
    wall: str | None = None
    retry: bool = False
    scheduler: Any = None
    limit: str | None = None

    def of_sweep(self) -> dict[str, Any]:
        """Arguments of a sweep. A run that dies or takes too long is one of many, and not begun again by itself."""
        given = {"jobs": self.jobs, "wall": self.wall, "retry": self.retry, "limit": self.limit}
        return {**given, "scheduler": self.scheduler, "tries": 1}


def load_request(path: Path, overrides: Sequence[str] = ()) -> SurveyRequest:
    """A survey from a TOML file. Raises SceneError."""
    text = read_text(path, "give the name of a survey file")
    return parse(SurveyRequest, text, path.parent, overrides, str(path))


def survey(
    asked: SurveyRequest,
    base: Path,
    directory: Path,
    comm: Comm,
    means: RunMeans = RunMeans(),
    voice: Silent | None = None,
) -> SurveyOutcome:
    """Survey a bed; leaves its numbers in a directory, where runs that are known are not computed again. Collective.

    Args:
        base: directory that files of the bed are relative to.

    Raises:
        IncipientError: on all ranks; runs that are finished are in the directory.
    """
    with locked(directory, comm, make=True):
        return _Survey(asked, base, directory, comm, means, voice or Silent()).outcome()


@dataclass(frozen=True, eq=False)
class _Survey:
    asked: SurveyRequest
    base: Path
    directory: Path
    comm: Comm
    means: RunMeans
    voice: Silent

    @cached_property
    def spheres(self) -> Spheres:
        """The grains of the bed."""
        return spheres_of(self.asked.bed, self.base)

    @cached_property
    def mark(self) -> str:
        """What tells runs of this bed, in this flow, from those of others in one directory."""
        table = np.round(np.column_stack([self.spheres.centres, self.spheres.radii]), 9)
        runs = self.asked.runs.model_dump(exclude={"number", "with_error_bars", "seed"})
        said = json.dumps([table.tolist(), self.asked.flow.model_dump(), runs])
        return hashlib.sha256(said.encode()).hexdigest()[:8]

    def outcome(self) -> SurveyOutcome:
        """Everything in turn. All ranks know the bed; the first writes."""
        asked = self.asked
        self.voice.begin("bed")
        spheres = self.spheres
        surface = Surface.of(spheres)
        numbers = exposed(spheres, surface, asked.grains)
        found = []
        for count, one in enumerate(pockets(spheres, surface, numbers, asked.flow)):
            found.append(one)
            self.voice.count("grains", count, len(numbers))
        begun = from_first(self.comm, self._begun)
        outcome = SurveyOutcome(
            asked, spheres, surface, len(numbers), found, runs=begun, mark=self.mark
        )
        if not outcome.free:
            raise SceneError(
                "bed: no exposed grain is free to move; enlarge the bed or lower grains.visible"
            )
        self._write(outcome)
        if asked.runs.number or self.means.more:
            Emulator.require()
            outcome = self._with_loads(outcome)
            self._write(outcome)
        return outcome

    def _write(self, outcome: SurveyOutcome) -> None:
        with collectively(self.comm):
            if self.comm.rank:
                return
            make_directory(self.directory)
            write_text_atomically(self.directory / GRAINS, csv_text(COLUMNS, outcome.rows()))
            places = np.column_stack([outcome.spheres.centres, 2.0 * outcome.spheres.radii])
            named = ({"x": x, "y": y, "z": z, "diameter": d} for x, y, z, d in places.tolist())
            write_text_atomically(
                self.directory / SPHERES, csv_text(("x", "y", "z", "diameter"), named)
            )
            write_json(self.directory / RECORD, outcome.to_dict())

    # Full runs.

    def _with_loads(self, outcome: SurveyOutcome) -> SurveyOutcome:
        grains, surface = outcome.free, outcome.surface
        features = np.array([features_of(one, surface.median, 1.0) for one in grains])
        order = designed(features, min(self.asked.runs.number, len(grains))).tolist()
        first = [grains[place].number for place in order]
        # Those of an earlier call first: the place of a run decides its Reynolds number.
        chosen = list(dict.fromkeys([*outcome.runs, *first]))
        begun = sum(row["status"] not in (DONE, FAILED) for row in self._rows(outcome, chosen))
        if (more := self.means.more - begun) > 0:
            chosen += self._further(outcome, features, chosen, more)
        if len(chosen) < FEWEST:
            remedy = "enlarge the bed" if len(grains) < FEWEST else f"give {FEWEST} or more"
            raise SceneError(
                f"runs.number: {len(chosen)} grains have a full run, the emulator needs {FEWEST}; {remedy}"
            )
        outcome = replace(outcome, runs=tuple(chosen))
        self._write(outcome)
        self._run(outcome)
        runs, failed = self._computed(outcome, chosen)
        if len(runs) < FEWEST:
            why = f"{len(runs)} runs are finished and {failed} failed, the emulator needs {FEWEST}"
            raise SceneError(f"runs.number: {why}; give more, or --runs {FEWEST - len(runs)}")
        found, record = self._thresholds(outcome, runs, failed)
        return replace(outcome, thresholds=found, emulator=record)

    def _begun(self) -> tuple[int, ...]:
        """Grains with a full run of an earlier call for this bed and flow, in their order."""
        if not (file := self.directory / RECORD).is_file():
            return ()
        try:
            runs = json.loads(file.read_text(encoding="utf-8"))["runs"]
            return tuple(map(int, runs["grains"])) if runs["of"] == self.mark else ()
        except (OSError, ValueError, LookupError, TypeError):
            return ()

    def _further(
        self, outcome: SurveyOutcome, features: Floats, chosen: list[int], more: int
    ) -> list[int]:
        """Grains to compute besides those chosen: where the emulator is least sure, without one far from others."""
        grains = outcome.free
        places = [place for place, one in enumerate(grains) if one.number not in chosen]
        runs = self._computed(outcome, chosen)[0]
        if len(runs) >= FEWEST:
            emulator = self._emulator(grains, runs, outcome.surface)
            order = emulator.most_wanted(features[places], more)
        else:
            order = designed(features[places], more)
        return [grains[places[place]].number for place in order.tolist()]

    def _run(self, outcome: SurveyOutcome) -> None:
        runs = self._full_runs(outcome, outcome.runs)
        run_sweep(
            [scene for run in runs for scene in (run.scene, run.wide) if scene is not None],
            self.directory / RUNS,
            {"fluid.inertia": [self.asked.flow.galileo is not None]},
            do="run",
            **self.means.of_sweep(),
            voice=self.voice,
        )

    def _full_runs(self, outcome: SurveyOutcome, chosen: Sequence[int]) -> list[FullRun]:
        """The runs of grains; the first ones with error bars, and once more with a wider gap."""
        by_number = {one.number: one for one in outcome.free}
        for place, number in enumerate(chosen):
            if number in by_number and (number, place) not in self._scenes:
                run = self._full_run(by_number[number], outcome.surface, place)
                self._scenes[number, place] = run
        keys = ((number, place) for place, number in enumerate(chosen))
        return [self._scenes[key] for key in keys if key in self._scenes]

    @cached_property
    def _scenes(self) -> dict[tuple[int, int], FullRun]:
        """Runs by grain and place, each of whose scenes takes a tenth of a second."""
        return {}

    def _full_run(self, grain: Pocket, surface: Surface, place: int) -> FullRun:
        level = (surface.level - float(grain.centre[2])) / grain.diameter
        given = grain, level, self.asked, reynolds_of(place, self._galileo(grain, surface))
        with_bars = place < self.asked.runs.with_error_bars
        wide = scene_of(*given, wide=True) if with_bars else None
        return FullRun(grain.number, scene_of(*given, error_bars=with_bars), wide)

    def _galileo(self, grain: Pocket, surface: Surface) -> float | None:
        galileo = self.asked.flow.galileo
        return (
            None if galileo is None else galileo * float((grain.diameter / surface.median) ** 1.5)
        )

    def _rows(self, outcome: SurveyOutcome, chosen: Sequence[int]) -> list[dict[str, Any]]:
        """Rows of the sweep of the runs of grains, those with a wider gap left out."""
        rows = self._table
        found = (
            rows.get(identity_of(run.scene, "run")) for run in self._full_runs(outcome, chosen)
        )
        return [row for row in found if row is not None]

    @property
    def _table(self) -> dict[str, dict[str, Any]]:
        """The rows of all runs in the directory by their identity."""
        file = self.directory / RUNS
        return {row["id"]: row for row in rows_of(file)} if file.is_file() else {}

    def _computed(
        self, outcome: SurveyOutcome, chosen: Sequence[int]
    ) -> tuple[list[LoadCoefficients], int]:
        """Load coefficients of runs that are done, and how many grains' runs have failed."""
        found = coefficients_of(self._full_runs(outcome, chosen), self._table)
        return found, sum(row["status"] == FAILED for row in self._rows(outcome, chosen))

    # Thresholds.

    def _emulator(
        self, grains: list[Pocket], runs: list[LoadCoefficients], surface: Surface
    ) -> Emulator:
        by_number = {one.number: one for one in grains}
        known = [one for one in runs if one.number in by_number]
        features = [
            features_of(by_number[one.number], surface.median, one.reynolds) for one in known
        ]
        return Emulator.of(np.array(features), np.array([one.values for one in known]))

    def _thresholds(
        self, outcome: SurveyOutcome, runs: list[LoadCoefficients], failed: int
    ) -> tuple[list[Threshold], EmulatorRecord]:
        flow, grains, median = self.asked.flow, outcome.free, outcome.surface.median
        self.voice.begin("thresholds")
        emulator, of_flow = self._emulator(grains, runs, outcome.surface), share_of_error(runs)
        errors = LoadErrors(emulator.correlation, of_flow, self.asked.runs.seed)
        found = thresholds(grains, median, flow.friction, flow.galileo, runs, emulator, errors)
        wrong, bars = emulator.errors, emulator.bars
        drag = float(np.mean([abs(one.values[0]) for one in runs]))
        features = np.array([features_of(one, median, runs[0].reynolds) for one in grains])
        computed = {one.number for one in runs}
        unknown = [place for place, one in enumerate(grains) if one.number not in computed]
        record = EmulatorRecord(
            runs=len(runs),
            failed=failed,
            error=float(np.sqrt((wrong[:, 0] ** 2).mean())) / drag,
            bar=float(np.sqrt((bars[:, 0] ** 2).mean())) / drag,
            within=float((np.abs(wrong) <= NINETY_FIVE * bars).mean()),
            mean_bar=_mean_bar(found),
            to_halve=runs_to_halve(emulator, features, unknown),
            flow=float(of_flow[0]) if of_flow.any() else None,
            level=emulator.level,
        )
        return found, record


def _mean_bar(found: Sequence[Threshold]) -> float:
    """Half of the 95% bar of the critical Shields number over it, the mean over emulated grains with a finite one."""
    shares = []
    for one in found:
        low, high = one.bar
        if not one.is_computed and np.isfinite([one.shields, high]).all() and one.shields > 0.0:
            shares.append(0.5 * (high - low) / one.shields)
    return float(np.mean(shares)) if shares else float("nan")

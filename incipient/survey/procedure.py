"""A survey: the bed, its exposed grains, full runs of some in a sweep, thresholds of all."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Floats
from ..errors import SceneError
from ..files import csv_text, write_json, write_text_atomically
from ..installed import optional
from ..output.ownership import locked
from ..parallel import Comm
from ..progress import Silent
from ..scene import Scene
from ..sweep import run as run_sweep
from ..sweep.cases import identity_of
from ..sweep.store import DONE, FAILED
from ..sweep.table import rows as rows_of
from .beds import Spheres, spheres_of
from .emulator import FEWEST, Emulator, designed, runs_to_halve
from .full_runs import (
    FullRun,
    LoadCoefficients,
    coefficients_of,
    reynolds_of,
    scene_of,
)
from .outcome import COLUMNS, EmulatorRecord, SurveyOutcome
from .pockets import Surface, exposed, pockets
from .request import Survey
from .thresholds import features_of, thresholds

RUNS, GRAINS, SPHERES, RECORD = "runs.sqlite", "grains.csv", "spheres.csv", "survey.json"
Rows = Mapping[str, Mapping[str, Any]]


def survey(
    request: Survey,
    base: Path,
    directory: Path,
    comm: Comm,
    more: int = 0,
    sweep: Mapping[str, Any] = {},
    voice: Silent | None = None,
) -> SurveyOutcome:
    """Survey a bed; results are written to a directory, whose finished runs are reused. Not collective.

    Args:
        base: directory that files of the bed are relative to.
        more: full runs beyond those of the request.
        sweep: arguments of the sweep of full runs, such as jobs, wall, retry, scheduler, limit.

    Raises IncipientError; finished runs are in the directory.
    """
    voice = voice or Silent()
    with locked(directory, comm, make=True):
        voice.begin("bed")
        spheres = spheres_of(request.bed, base)
        surface = Surface.of(spheres)
        numbers, grains = exposed(spheres, surface, request.grains), []
        for count, grain in enumerate(pockets(spheres, surface, numbers, request.flow)):
            grains.append(grain)
            voice.count("grains", count, len(numbers))
        mark = _mark(request, spheres)
        bed = spheres, surface, len(numbers), grains
        outcome = SurveyOutcome(request, *bed, runs=_begun(directory / RECORD, mark), mark=mark)
        if not outcome.free:
            why = "no exposed grain is free to move; enlarge the bed or lower grains.visible"
            raise SceneError(f"bed: {why}")
        _write(outcome, directory)
        if request.runs.number or more:
            optional("sklearn.gaussian_process", "survey", "scikit-learn")
            outcome = _with_loads(outcome, directory, more, sweep, voice)
            _write(outcome, directory)
        return outcome


def _mark(request: Survey, spheres: Spheres) -> str:
    table = np.round(np.column_stack([spheres.centres, spheres.radii]), 9)
    runs = request.runs.model_dump(exclude={"number", "with_error_bars", "seed"})
    key = json.dumps([table.tolist(), request.flow.model_dump(), runs])
    return hashlib.sha256(key.encode()).hexdigest()[:8]


def _begun(record: Path, mark: str) -> tuple[int, ...]:
    try:
        runs = json.loads(record.read_text(encoding="utf-8"))["runs"]
        return tuple(map(int, runs["grains"])) if runs["of"] == mark else ()
    except (OSError, ValueError, LookupError, TypeError):
        return ()


def _write(outcome: SurveyOutcome, directory: Path) -> None:
    write_text_atomically(directory / GRAINS, csv_text(COLUMNS, outcome.rows()))
    names = ("x", "y", "z", "diameter")
    places = np.column_stack([outcome.spheres.centres, 2.0 * outcome.spheres.radii])
    rows = (dict(zip(names, row, strict=True)) for row in places.tolist())
    write_text_atomically(directory / SPHERES, csv_text(names, rows))
    write_json(directory / RECORD, outcome.to_dict())


def swept(
    scenes: Sequence[Scene], file: Path, task: str, sweep: Mapping[str, Any], voice: Silent
) -> Rows:
    """Compute scenes of one inertia in a sweep; its rows by identity, with those of earlier calls."""
    same = {"fluid.inertia": [scenes[0].fluid.inertia]}
    means = {"tries": 1, **sweep}  # a run that dies or takes too long is not repeated by itself
    run_sweep(list(scenes), file, same, do=task, voice=voice, **means)
    return _stored(file)


def _stored(file: Path) -> Rows:
    return {row["id"]: row for row in rows_of(file)} if file.is_file() else {}


def _with_loads(
    outcome: SurveyOutcome,
    directory: Path,
    more: int,
    sweep: Mapping[str, Any],
    voice: Silent,
) -> SurveyOutcome:
    request, grains, file = outcome.request, outcome.free, directory / RUNS
    numbers = np.array([grain.number for grain in grains])
    features = np.array([features_of(grain, outcome.surface.median, 1.0) for grain in grains])
    # Runs of an earlier call come first: the place of a run decides its Reynolds number.
    first = numbers[designed(features, request.runs.number)].tolist()
    chosen = list(dict.fromkeys([*outcome.runs, *first]))
    runs, table = _full_runs(outcome, chosen), _stored(file)
    begun = sum(status not in (DONE, FAILED) for status in _statuses(runs, table))
    if more > begun:
        done, left = coefficients_of(runs, table), np.flatnonzero(~np.isin(numbers, chosen))
        wanted = _emulator(outcome, done).most_wanted if len(done) >= FEWEST else designed
        chosen += numbers[left[wanted(features[left], more - begun)]].tolist()
        runs = _full_runs(outcome, chosen)
    if len(chosen) < FEWEST:
        remedy = "enlarge the bed" if len(grains) < FEWEST else f"give {FEWEST} or more"
        why = f"{len(chosen)} grains have a full run, the emulator needs {FEWEST}; {remedy}"
        raise SceneError(f"runs.number: {why}")
    outcome = replace(outcome, runs=tuple(chosen))
    _write(outcome, directory)
    scenes = [scene for run in runs for scene in (run.scene, run.wide) if scene is not None]
    table = swept(scenes, file, "run", sweep, voice)
    done, failed = coefficients_of(runs, table), _statuses(runs, table).count(FAILED)
    if len(done) < FEWEST:
        why = f"{len(done)} runs are finished and {failed} failed, the emulator needs {FEWEST}"
        raise SceneError(f"runs.number: {why}; give more, or --runs {FEWEST - len(done)}")
    voice.begin("thresholds")
    return _with_thresholds(outcome, features, done, failed)


def _with_thresholds(
    outcome: SurveyOutcome, features: Floats, runs: Sequence[LoadCoefficients], failed: int
) -> SurveyOutcome:
    grains, emulator = outcome.free, _emulator(outcome, runs)
    median, flow = outcome.surface.median, outcome.request.flow
    critical = thresholds(grains, median, flow, runs, emulator, outcome.request.runs.seed)
    features[:, -1] = np.log10(runs[0].reynolds)
    known = {run.number for run in runs}
    unknown = [place for place, grain in enumerate(grains) if grain.number not in known]
    to_halve = runs_to_halve(emulator, features, unknown)
    record = EmulatorRecord.of(emulator, runs, failed, to_halve)
    return replace(outcome, thresholds=critical, emulator=record)


def _full_runs(outcome: SurveyOutcome, numbers: Sequence[int]) -> list[FullRun]:
    """Runs of the grains with these numbers that are free."""
    runs, free = [], {grain.number: grain for grain in outcome.free}
    median, galileo = outcome.surface.median, outcome.request.flow.galileo
    for place, number in enumerate(numbers):
        if (grain := free.get(number)) is None:
            continue
        level = (outcome.surface.level - float(grain.centre[2])) / grain.diameter
        own = None if galileo is None else galileo * (grain.diameter / median) ** 1.5
        arguments = grain, level, outcome.request, reynolds_of(place, own)
        with_bars = place < outcome.request.runs.with_error_bars
        wide = scene_of(*arguments, wide=True) if with_bars else None
        runs.append(FullRun(number, scene_of(*arguments, error_bars=with_bars), wide))
    return runs


def _emulator(outcome: SurveyOutcome, runs: Sequence[LoadCoefficients]) -> Emulator:
    free, median = {grain.number: grain for grain in outcome.free}, outcome.surface.median
    features = [features_of(free[run.number], median, run.reynolds) for run in runs]
    return Emulator.of(np.array(features), np.array([run.values for run in runs]))


def _statuses(runs: Sequence[FullRun], table: Rows) -> list[str]:
    identities = [identity_of(run.scene, "run") for run in runs]
    return [table[identity]["status"] for identity in identities if identity in table]

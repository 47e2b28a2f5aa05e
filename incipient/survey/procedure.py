"""Surveys: of a bed, with full runs of some exposed grains and thresholds of all; of one grain in many poses."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import SceneError
from ..files import csv_text, write_results
from ..installed import optional
from ..output.ownership import locked
from ..parallel import Comm
from ..progress import Silent
from ..scene import Scene
from ..scene.file import parse
from ..scene.grains import SolidSection
from ..sweep import run as run_sweep
from ..sweep.cases import Source, identity_of
from ..sweep.store import FAILED
from ..sweep.table import columns
from ..sweep.table import rows as rows_of
from .beds import spheres_of
from .full_runs import FullRuns, coefficients_of, reynolds_of, scene_of
from .outcome import COLUMNS, TOO_FEW, SurveyOutcome, few, percentiles, quality
from .pockets import Surface, exposed, pockets
from .request import Survey
from .thresholds import FEWEST, Emulator, designed, features_of, thresholds

RUNS, GRAINS, SPHERES, RECORD = "runs.sqlite", "grains.csv", "spheres.csv", "survey.json"
POSES, SUMMARY = "poses.csv", "poses.json"
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
        outcome = SurveyOutcome(request, spheres, surface, len(numbers), grains)
        if not outcome.free:
            raise SceneError(
                "bed: no exposed grain is free to move; give more grains or lower grains.visible"
            )
        number = request.runs.number + more
        runs = _full_runs(outcome, number) if number else {}
        _write(outcome, directory)
        if runs:
            outcome = _with_thresholds(outcome, runs, directory / RUNS, sweep, voice)
            _write(outcome, directory)
        return outcome


def _write(outcome: SurveyOutcome, directory: Path) -> None:
    names = ("x", "y", "z", "diameter")
    places = np.column_stack([outcome.spheres.centres, 2.0 * outcome.spheres.radii])
    spheres = csv_text(names, (dict(zip(names, row, strict=True)) for row in places.tolist()))
    files = {GRAINS: csv_text(COLUMNS, outcome.rows()), SPHERES: spheres}
    write_results(directory, files | {RECORD: outcome.to_dict()})


def swept(
    scenes: Sequence[Scene], file: Path, task: str, sweep: Mapping[str, Any], voice: Silent
) -> Rows:
    """Compute scenes of one inertia in a sweep; its rows by identity, with those of earlier calls."""
    same = {"fluid.inertia": [scenes[0].fluid.inertia]}
    # A run that dies or takes too long is not repeated by itself.
    run_sweep(list(scenes), file, same, do=task, voice=voice, tries=1, **sweep)
    return {row["id"]: row for row in rows_of(file)}


def _with_thresholds(
    outcome: SurveyOutcome,
    runs: FullRuns,
    file: Path,
    sweep: Mapping[str, Any],
    voice: Silent,
) -> SurveyOutcome:
    request, grains, median = outcome.request, outcome.free, outcome.surface.median
    scenes = [scene for pair in runs.values() for scene in pair if scene is not None]
    table = swept(scenes, file, "run", sweep, voice)
    done = coefficients_of(runs, table)
    failed = sum(table[identity_of(scene, "run")]["status"] == FAILED for scene, _ in runs.values())
    if len(done) < FEWEST:
        raise SceneError(
            f"runs.number: {len(done)} runs are finished and {failed} failed, "
            f"the emulator needs {FEWEST}; give more"
        )
    voice.begin("thresholds")
    free = {grain.number: grain for grain in grains}
    features = np.array([features_of(free[run.number], median, run.reynolds) for run in done])
    emulator = Emulator.of(features, np.array([run.values for run in done]))
    critical = thresholds(grains, median, request.flow, done, emulator, request.runs.seed)
    return replace(outcome, thresholds=critical, emulator=quality(emulator, done, failed))


def _full_runs(outcome: SurveyOutcome, number: int) -> FullRuns:
    optional("sklearn.gaussian_process", "survey", "scikit-learn")
    request, grains, median = outcome.request, outcome.free, outcome.surface.median
    galileo = request.flow.galileo
    features = np.array([features_of(grain, median, 1.0) for grain in grains])
    chosen = [grains[k] for k in designed(features, number)]
    if len(chosen) < FEWEST:
        remedy = "give the bed more grains" if len(grains) < FEWEST else f"give {FEWEST} or more"
        raise SceneError(
            f"runs.number: {len(chosen)} grains have a full run, the emulator needs {FEWEST}; {remedy}"
        )
    runs = {}
    for place, grain in enumerate(chosen):
        level = (outcome.surface.level - float(grain.centre[2])) / grain.diameter
        own = None if galileo is None else galileo * (grain.diameter / median) ** 1.5
        arguments = grain, level, request, reynolds_of(place, own)
        with_bars = place < request.runs.with_error_bars
        wide = scene_of(*arguments, wide=True) if with_bars else None
        runs[grain.number] = scene_of(*arguments, error_bars=with_bars), wide
    return runs


# -- one grain in many poses -----------------------------------------------------------------------


@dataclass(frozen=True)
class PoseOutcome:
    """Shields numbers by the nominal diameter, ascending, and the numbers of poses without one by reason.

    refused: poses without rest, with the reason of the first; failed: runs
    """

    shields: tuple[float, ...]
    modes: dict[str, int]
    poses: int
    refused: int
    reason: str
    failed: int

    def text(self) -> str:
        known = len(self.shields)
        lines = [
            f"poses               {self.poses}: {known} thresholds, {self.failed} failed; "
            "Shields numbers have the nominal diameter"
        ]
        if self.refused:
            lines.append(f"no resting pose     {self.refused}, the first: {self.reason}")
        if 0 < known <= TOO_FEW:
            lines.append(few(self.shields))
        lines += [
            f"Shields number      {row['percentile']:>3g}% below {row['shields']:.4g}"
            for row in percentiles("shields", np.array(self.shields))
        ]
        lines += [f"begins {mode:<12} {count}" for mode, count in self.modes.items()]
        return "\n".join(lines)


def survey_poses(
    path: Path,
    overrides: Sequence[str],
    orientations: int,
    seeds: int,
    directory: Path,
    comm: Comm,
    sweep: Mapping[str, Any] = {},
    voice: Silent | None = None,
) -> PoseOutcome:
    """Compute the thresholds of a scene's grain in random orientations, on beds of several seeds. Not collective.

    Poses without rest are counted. `sweep`: as of `survey`. Raises IncipientError.
    """
    source, voice = Source.of(path), voice or Silent()

    def posed(*settings: str) -> Scene:
        return parse(Scene, source.text, source.base, (*overrides, *settings), source.name)

    own = posed()
    if not (isinstance(own.body, SolidSection) and own.body.x is not None):
        raise SceneError(
            f"{path}: --orientations and --seeds need a 3-D grain that rests on a bed; give domain.width and body.x"
        )
    scenes, reason, refused, total = [], "", 0, orientations * seeds
    for number, settings in enumerate(_settings(orientations, seeds, own.body.orientation)):
        voice.count("poses", number, total)
        try:
            scenes.append(posed(*settings).model_copy(update={"title": f"pose {number}"}))
        except SceneError as error:
            if "bed.seed" in str(error):
                raise SceneError(f"--seeds: {error}") from None
            reason, refused = reason or str(error), refused + 1
    if not scenes:
        raise SceneError(f"{path}: the grain rests in none of {total} poses: {reason}")
    with locked(directory, comm, make=True):
        stored = swept(scenes, directory / RUNS, "threshold", sweep, voice)
        titles = {identity_of(scene, "threshold"): scene.title for scene in scenes}
        table = [
            {**stored[identity], "source": title}
            for identity, title in titles.items()
            if identity in stored
        ]
        done = [row for row in table if row["status"] == "done"]
        shields = sorted(float(row["shields_nominal"]) for row in done)
        outcome = PoseOutcome(
            shields=tuple(number for number in shields if not math.isnan(number)),
            modes=dict(Counter(row["mode"] for row in done)),
            poses=total,
            refused=refused,
            reason=reason,
            failed=sum(row["status"] == FAILED for row in table),
        )
        write_results(directory, {POSES: csv_text(columns(table), table), SUMMARY: vars(outcome)})
    return outcome


def _settings(
    orientations: int, seeds: int, own: tuple[float, float, float]
) -> list[tuple[str, ...]]:
    drawn = Rotation.random(orientations, random_state=0).as_euler("xyz", degrees=True)
    return [
        (
            f"body.orientation=[{', '.join(f'{angle:.10g}' for angle in angles)}]",
            *((f"bed.seed={seed}",) if seeds > 1 else ()),
        )
        for seed in range(seeds)
        for angles in (own, *drawn[1:].tolist())
    ]

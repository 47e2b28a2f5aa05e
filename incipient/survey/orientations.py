"""The distribution of a grain's thresholds in many orientations, and on beds of many seeds."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scipy.spatial.transform import Rotation

from ..arrays import known_percentiles, percentile
from ..errors import SceneError
from ..files import csv_text, write_json, write_text_atomically
from ..output.ownership import locked
from ..parallel import Comm
from ..progress import Silent
from ..scene import Scene
from ..scene.file import parse
from ..scene.grains import SolidSection
from ..sweep.cases import Source, identity_of
from ..sweep.table import columns
from .outcome import SHARES, TOO_FEW, few
from .procedure import RUNS, swept

POSES, SUMMARY = "poses.csv", "poses.json"


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

    @classmethod
    def of(
        cls, table: Sequence[dict[str, Any]], poses: int, refused: int, reason: str
    ) -> PoseOutcome:
        done = [row for row in table if row["status"] == "done"]
        shields = sorted(float(row["shields_nominal"]) for row in done)
        known = tuple(number for number in shields if not math.isnan(number))
        failed = sum(row["status"] == "failed" for row in table)
        modes = dict(Counter(row["mode"] for row in done))
        return cls(known, modes, poses, refused, reason, failed)

    def text(self) -> str:
        known = len(self.shields)
        lines = [f"poses               {self.poses}: {known} thresholds, {self.failed} failed"]
        if self.refused:
            lines.append(f"no resting pose     {self.refused}, the first: {self.reason}")
        if 0 < known <= TOO_FEW:
            lines.append(few(self.shields))
        for share in known_percentiles(SHARES, known):
            value = float(percentile(self.shields, share))
            lines.append(f"Shields number      {share:>3g}% below {value:.4g}")
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
        need = "a 3-D grain that rests on a bed; give body.x"
        raise SceneError(f"{path}: --orientations and --seeds need {need}")
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
        outcome = PoseOutcome.of(table, total, refused, reason)
        write_text_atomically(directory / POSES, csv_text(columns(table), table))
        write_json(directory / SUMMARY, vars(outcome))
    return outcome


def _settings(
    orientations: int, seeds: int, own: tuple[float, float, float]
) -> list[tuple[str, ...]]:
    drawn = Rotation.random(orientations, random_state=0).as_euler("xyz", degrees=True).tolist()
    turned = [own, *drawn[1:]]
    return [
        (
            f"body.orientation=[{', '.join(f'{angle:.10g}' for angle in angles)}]",
            *((f"bed.seed={seed}",) if seeds > 1 else ()),
        )
        for seed in range(seeds)
        for angles in turned
    ]

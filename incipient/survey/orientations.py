"""One grain in many orientations, and on beds of many seeds: its thresholds as a distribution."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Floats, known_percentiles, percentile
from ..errors import SceneError
from ..files import csv_text, write_json, write_text_atomically
from ..geometry.placement import Placement, Quaternion
from ..output.lock import locked
from ..parallel import Comm, collectively
from ..progress import Silent
from ..scene import Scene
from ..scene.file import parse
from ..scene.solids import SolidSection, orientation_of
from ..sweep import run as run_sweep
from ..sweep.cases import Source, identity_of
from ..sweep.table import columns, rows
from .outcome import SHARES, TOO_FEW, few
from .procedure import RUNS, RunMeans

POSES, SUMMARY = "poses.csv", "poses.json"


@dataclass(frozen=True)
class Poses:
    """Numbers of random orientations and of seeds of the bed, from the first on; `first`: seed of the orientations."""

    orientations: int = 1
    seeds: int = 1
    first: int = 0


@dataclass(frozen=True)
class PoseOutcome:
    """Shields numbers by the nominal diameter of all poses that have one, ascending; and how many have none and why.

    refused: poses at which the grain does not come to rest, with the reason of the first; failed: runs
    """

    shields: tuple[float, ...]
    modes: dict[str, int]
    poses: int
    refused: int
    reason: str
    failed: int

    def text(self) -> str:
        """The outcome in a few lines."""
        lines = [
            f"poses               {self.poses}: {len(self.shields)} thresholds, {self.failed} failed"
        ]
        if self.refused:
            lines.append(f"without a rest      {self.refused}, the first: {self.reason}")
        if 0 < len(self.shields) <= TOO_FEW:
            lines.append(few(self.shields))
        for share in known_percentiles(SHARES, len(self.shields)):
            value = float(percentile(self.shields, share))
            lines.append(f"Shields number      {share:>3g}% below {value:.4g}")
        lines += [f"begins {mode:<12} {count}" for mode, count in self.modes.items()]
        return "\n".join(lines)


def survey_poses(
    path: Path,
    overrides: Sequence[str],
    asked: Poses,
    directory: Path,
    comm: Comm,
    means: RunMeans,
    voice: Silent | None = None,
) -> PoseOutcome:
    """Find the thresholds of a scene's grain in random orientations, on beds of several seeds. Collective.

    Poses in which it does not come to rest are left out and counted. Raises IncipientError on all ranks.
    """
    source, voice = Source.of(path), voice or Silent()
    first = parse(Scene, source.text, source.base, overrides, source.name)
    if not (isinstance(first.body, SolidSection) and first.body.x is not None):
        raise SceneError(
            f"{path}: --orientations and --seeds need a grain in space that rests on a bed; give body.x"
        )
    found, reason, refused, total = [], "", 0, asked.orientations * asked.seeds
    for number, settings in enumerate(_settings(asked, first.body.orientation)):
        voice.count("poses", number, total)
        try:
            one = parse(Scene, source.text, source.base, (*overrides, *settings), source.name)
            found.append(one.model_copy(update={"title": f"pose {number}"}))
        except SceneError as error:
            if "bed.seed" in str(error):
                raise SceneError(f"--seeds: {error}") from None
            reason, refused = reason or str(error), refused + 1
    if not found:
        raise SceneError(f"{path}: the grain rests in none of {total} poses: {reason}")
    with locked(directory, comm, make=True):
        file = directory / RUNS
        kept = {"fluid.inertia": [first.fluid.inertia]}
        run_sweep(found, file, kept, do="threshold", voice=voice, **means.of_sweep())
        by_identity = {row["id"]: row for row in rows(file)}
        own = [(one.title, by_identity.get(identity_of(one, "threshold"))) for one in found]
        table = [row | {"source": title} for title, row in own if row is not None]
        outcome = replace(_outcome(table), poses=total, refused=refused, reason=reason)
        with collectively(comm):
            if comm.rank == 0:
                write_text_atomically(directory / POSES, csv_text(columns(table), table))
                write_json(directory / SUMMARY, vars(outcome))
    return outcome


def _settings(asked: Poses, own: tuple[float, float, float]) -> list[tuple[str, ...]]:
    """Overrides of each pose: the first orientation is the scene's own."""
    random = np.random.default_rng(asked.first)
    turned = [own, *(random_orientation(random) for _ in range(asked.orientations - 1))]
    found = []
    for seed in range(asked.seeds):
        for angles in turned:
            settings = [f"body.orientation=[{', '.join(f'{angle:.10g}' for angle in angles)}]"]
            found.append((*settings, *([f"bed.seed={seed}"] if asked.seeds > 1 else [])))
    return found


def random_orientation(random: np.random.Generator) -> tuple[float, float, float]:
    """Angles about x, y and z [degrees] of a rotation, all rotations being equally likely (Shoemake 1992)."""
    numbers: Floats = random.standard_normal(4)
    w, x, y, z = (numbers / np.linalg.norm(numbers)).tolist()
    turned: Quaternion = (w, x, y, z)
    return orientation_of(Placement((0.0, 0.0, 0.0), quaternion=turned))


def _outcome(table: Sequence[dict[str, Any]]) -> PoseOutcome:
    done = [row for row in table if row["status"] == "done"]
    shields = sorted(float(row["shields_nominal"]) for row in done)
    modes: dict[str, int] = {}
    for row in done:
        modes[row["mode"]] = modes.get(row["mode"], 0) + 1
    known = tuple(one for one in shields if not math.isnan(one))
    return PoseOutcome(known, modes, 0, 0, "", sum(row["status"] == "failed" for row in table))

"""`incipient survey`: thresholds of the grains of a bed."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..errors import SceneError
from ..output.ownership import refuse_foreign
from ..parallel import Comm, collectively
from ..progress import telling
from ..survey.orientations import POSES, SUMMARY, Poses, survey_poses
from ..survey.procedure import FILES, GRAINS, RunMeans, load_request
from ..survey.procedure import survey as find
from .drawing import draw_and_tell
from .options import refuse_old_workers


def survey(options: argparse.Namespace, comm: Comm) -> int:
    """Survey a bed, print what came out, and draw it."""
    directory = options.out or Path("results") / f"{options.bed.stem}_survey"
    refuse_old_workers(options)
    means = _means(options)
    if options.orientations is not None or options.seeds is not None:
        return _poses(options, directory, means, comm)
    asked = load_request(options.bed, options.overrides)
    with collectively(comm):
        if comm.rank == 0:
            named = (getattr(asked.bed, key, None) for key in ("file", "heights", "labels"))
            refuse_foreign(directory, FILES, [options.bed.parent / name for name in named if name])
    with telling(comm.rank) as voice:
        found = find(asked, options.bed.parent, directory, comm, means, voice)
    if comm.rank == 0:
        print(found.text())
        print(f"numbers             {directory / GRAINS}", flush=True)
        draw_and_tell(directory)
    return 0


def _means(options: argparse.Namespace) -> RunMeans:
    for name, least in (("runs", 0), ("orientations", 1), ("seeds", 1)):
        value = getattr(options, name)
        if value is not None and value < least:
            raise SceneError(f"--{name} {value}: is not a number of them; give {least} or more")
    return RunMeans(
        options.runs, options.jobs, options.wall, options.retry, options.scheduler, options.limit
    )


def _poses(options: argparse.Namespace, directory: Path, means: RunMeans, comm: Comm) -> int:
    """Survey one grain in many poses, and print what came out."""
    if options.runs:
        raise SceneError(
            "--runs: is for a bed of grains; leave it out with --orientations and --seeds"
        )
    asked = Poses(options.orientations or 1, options.seeds or 1)
    with collectively(comm):
        if comm.rank == 0:
            refuse_foreign(directory, (POSES, SUMMARY), [options.bed])
    with telling(comm.rank) as voice:
        found = survey_poses(options.bed, options.overrides, asked, directory, comm, means, voice)
    if comm.rank == 0:
        print(found.text())
        print(f"numbers             {directory / POSES}", flush=True)
    return 0

"""`incipient survey`."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from ..errors import refuse_broken
from ..output.ownership import refuse_foreign
from ..parallel import Comm
from ..progress import telling
from ..results.kinds import POSES, SURVEY
from ..scene.file import read
from ..survey.procedure import survey as find
from ..survey.procedure import survey_poses
from ..survey.request import Survey
from .showing import draw_and_tell


def survey(options: argparse.Namespace, comm: Comm) -> int:
    """Survey a bed, or a grain in many poses; print and draw the result."""
    in_poses = options.orientations is not None or options.seeds is not None
    least = {"runs": 0, "orientations": 1, "seeds": 1}
    numbers = {name: getattr(options, name) for name in least}
    refuse_broken(
        (
            comm.size > 1,
            "a survey computes each run on one rank; "
            "start it without mpirun, with --jobs, or with --scheduler on a cluster",
        ),
        *(
            (
                number is not None and number < least[name],
                f"--{name}: is {number}; give {least[name]} or more",
            )
            for name, number in numbers.items()
        ),
        (
            in_poses and options.runs,
            "--runs: applies to a bed of grains; leave it out with --orientations and --seeds",
        ),
    )
    names = ("jobs", "wall", "retry", "scheduler", "limit")
    sweep = {name: getattr(options, name) for name in names}
    directory = options.out or Path("results") / f"{options.bed.stem}_survey"
    if not in_poses:
        request, base = read(Survey, options.bed, options.overrides), options.bed.parent
        named = (getattr(request.bed, key, None) for key in ("file", "heights", "labels"))
        kind, sources = SURVEY, [base / name for name in named if name]
        compute: Callable[..., Any] = partial(
            find, request, base, directory, comm, options.runs, sweep
        )
    else:
        poses = options.orientations or 1, options.seeds or 1
        kind, sources = POSES, [options.bed]
        compute = partial(
            survey_poses, options.bed, options.overrides, *poses, directory, comm, sweep
        )
    refuse_foreign(directory, kind.files, sources)
    with telling(0) as voice:
        result = compute(voice)
    print(result.text())
    print(f"numbers             {directory / kind.tables[0]}", flush=True)
    draw_and_tell(directory)
    return 0

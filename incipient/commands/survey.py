"""`incipient survey`: thresholds of the grains of a bed."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..output.ownership import refuse_foreign
from ..parallel import Comm, collectively
from ..progress import telling
from ..survey.procedure import GRAINS, RECORD, RunMeans, load_request
from ..survey.procedure import survey as find
from ..sweep.live import watching
from .drawing import draw_and_tell


def survey(options: argparse.Namespace, comm: Comm) -> int:
    """Survey a bed, print what came out, and draw it."""
    asked = load_request(options.bed, options.overrides)
    directory = options.out or Path("results") / f"{options.bed.stem}_survey"
    with collectively(comm):
        if comm.rank == 0:
            refuse_foreign(directory, (RECORD,))
    means = RunMeans(options.runs, options.jobs, options.wall, options.retry)
    with telling(comm.rank) as voice, watching(comm) as watcher:
        found = find(asked, options.bed.parent, directory, comm, means, voice, watcher)
    if comm.rank == 0:
        print(found.text())
        print(f"numbers             {directory / GRAINS}", flush=True)
        draw_and_tell(directory)
    return 0

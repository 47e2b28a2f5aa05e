"""`incipient sweep`: many cases in one file."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..errors import ConvergenceError
from ..parallel import Comm, collectively
from ..progress import telling
from ..sweep.axes import parsed
from ..sweep.call import Means, Prepared, computed
from ..sweep.cases import Source
from ..sweep.dry_run import foretold
from ..sweep.live import watching
from ..sweep.procedure import SweepProgress
from ..sweep.request import (
    RefinementOptions,
    Request,
    parsed_limit,
    parsed_seconds,
    requested,
    usual_file,
)


def sweep(options: argparse.Namespace, comm: Comm) -> int:
    """Compute the cases that the file does not hold, and say what came out."""
    wall = float("inf") if options.wall is None else parsed_seconds(options.wall)
    given = options.jobs, options.ranks, options.memory, wall, options.retry
    means = Means(*given, options.executor, options.tries, *parsed_limit(options.limit))
    places, files = means.places(comm), [Path()]
    prepared, lines = Prepared(), ""
    with collectively(comm):
        if comm.rank == 0:
            request = _request(options)
            files = [options.out or usual_file(request)]
            with telling(comm.rank) as voice:
                if options.dry_run:
                    lines = foretold(request, files[0], means, places, voice) + "\n"
                else:
                    prepared = Prepared.of(request, voice)
    if options.dry_run:
        print(lines, end="", flush=True)
        return 0
    with watching(comm) as watcher:
        progress = computed(prepared, files[0], means, watcher, comm)
    if comm.rank == 0:
        _tell(progress, files[0])
    return ConvergenceError.exit_code if progress.failed else 0


def _request(options: argparse.Namespace) -> Request:
    return requested(
        [Source.of(path) for path in options.scenes],
        [parsed(text) for text in options.over],
        options.zip,
        options.cases,
        options.do,
        options.overrides,
        RefinementOptions(options.refine, options.most, options.quantity),
    )


def _tell(progress: SweepProgress, file: Path) -> None:
    failed = f", {progress.failed} failed (again with --retry)" if progress.failed else ""
    done = f"{progress.done} computed{failed}, {progress.known} known before"
    print(f"cases               {progress.total}: {done}")
    print("".join(f"{line}\n" for line in progress.refined), end="")
    print(f"numbers             {file}; incipient table {file}")
    print(f"pictures            incipient show {file}", flush=True)

"""`incipient sweep`: many cases in one file."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from ..errors import ConvergenceError
from ..parallel import Comm
from ..progress import telling
from ..sweep.axes import parsed
from ..sweep.cases import Source
from ..sweep.procedure import LIMIT, Means, SweepProgress, computed_into
from ..sweep.request import Request, parsed_seconds, requested
from ..sweep.store import DONE, FAILED, Store
from .options import refuse_old_workers


def sweep(options: argparse.Namespace, comm: Comm) -> int:
    """Compute the cases that the file does not hold, and print what came out."""
    refuse_old_workers(options)
    wall = float("inf") if options.wall is None else parsed_seconds(options.wall, "wall")
    limit = LIMIT if options.limit is None else parsed_seconds(options.limit, "limit")
    own = options.jobs, options.memory, wall, options.retry, options.scheduler
    means = Means(*own, options.tries, limit)
    request = _request(options)
    usual = Path("results") / f"{request.sources[0].name}_{request.task}.sqlite"
    file = options.out or usual
    if options.dry_run:
        with telling(comm.rank) as voice:
            cases = request.cases(voice)
        _count([case.identity for case in cases], file)
        return 0
    with telling(comm.rank) as voice:
        progress = computed_into(file, request, means, voice)
    _tell(progress, file)
    return ConvergenceError.exit_code if progress.failed else 0


def _count(identities: Sequence[str], file: Path) -> None:
    states = dict[str, str]()
    if file.is_file():
        with Store(file) as store:
            states = store.states()
    known = sum(states.get(one) in (DONE, FAILED) for one in identities)
    counts = f"{known} already in {file}, {len(identities) - known} to compute"
    print(f"cases               {len(identities)}: {counts}")


def _request(options: argparse.Namespace) -> Request:
    return requested(
        [Source.of(path) for path in options.scenes],
        [parsed(text) for text in options.over],
        options.zip,
        options.cases,
        options.do,
        options.overrides,
        options.refine,
        options.most,
        options.quantity,
    )


def _tell(progress: SweepProgress, file: Path) -> None:
    failed = f", {progress.failed} failed (again with --retry)" if progress.failed else ""
    done = f"{progress.done} computed{failed}, {progress.known} known before"
    print(f"cases               {progress.total}: {done}")
    print("".join(f"{line}\n" for line in progress.refined), end="")
    print(f"numbers             {file}; incipient table {file}")
    print(f"pictures            incipient show {file}", flush=True)

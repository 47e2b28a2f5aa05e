"""`incipient sweep`."""

from __future__ import annotations

import argparse

from ..errors import ConvergenceError
from ..parallel import Comm
from ..progress import telling
from ..sweep.procedure import SweepProgress, run

# Options with the names of arguments of `sweep.run`.
SHARED = (
    *("do", "zip", "cases", "jobs", "wall", "retry", "refine", "most", "quantity"),
    *("scheduler", "tries", "limit", "dry_run"),
)


def sweep(options: argparse.Namespace, comm: Comm) -> int:
    """Compute the missing cases of the file, and print a summary."""
    with telling(comm.rank) as voice:
        progress = run(
            options.scenes,
            options.out,
            options.over,
            settings=options.overrides,
            memory_mib=options.memory,
            voice=voice,
            **{name: getattr(options, name) for name in SHARED},
        )
    if options.dry_run:
        left = progress.total - progress.known
        counts = f"{progress.known} already in {progress.file}, {left} to compute"
        print(f"cases               {progress.total}: {counts}")
    else:
        _tell(progress)
    return ConvergenceError.exit_code if progress.failed else 0


def _tell(progress: SweepProgress) -> None:
    failed = f", {progress.failed} failed (repeat them with --retry)" if progress.failed else ""
    done = f"{progress.done} computed{failed}, {progress.known} computed before"
    print(f"cases               {progress.total}: {done}")
    print("".join(f"{line}\n" for line in progress.refined), end="")
    print(f"numbers             {progress.file}; incipient table {progress.file}")
    print(f"pictures            incipient show {progress.file}", flush=True)

"""Progress of a sweep while it runs: a table on a terminal (`live_table`), a line a case elsewhere."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from ..cost.frontier import seconds
from ..parallel import Comm, ranks_there_are
from .cases import SweepCase
from .procedure import SweepProgress, Watcher
from .store import CaseOutcome
from .table import described

log = logging.getLogger("incipient")


class LogLines(Watcher):
    """A line in the log for every finished case."""

    def finished(self, case: SweepCase, outcome: CaseOutcome, progress: SweepProgress) -> None:
        """Say what came out, and the time left."""
        left = "" if progress.left is None else f", {seconds(progress.left)} left"
        counted, found = f"{progress.finished}/{progress.total}", described(case.task, outcome)
        log.info("%s  %s: %s (%.1f s%s)", counted, case.name, found, outcome.wall, left)


@contextmanager
def watching(comm: Comm | None = None) -> Iterator[Watcher]:
    """The right watcher for this rank (default: of all ranks) and this terminal. Not collective."""
    if (comm or ranks_there_are()).rank:
        yield Watcher()
        return
    if not sys.stderr.isatty():
        yield LogLines()
        return
    from .live_table import on_screen

    with on_screen() as table:
        yield table

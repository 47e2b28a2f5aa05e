"""Progress of a sweep while it runs: a table that is redrawn on a terminal, a line a case elsewhere."""

from __future__ import annotations

import logging
import sys
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ..cost.frontier import seconds
from ..parallel import Comm, ranks_there_are
from .cases import SweepCase
from .procedure import SweepProgress, Watcher
from .store import DONE, FAILED, CaseOutcome
from .table import in_words, quantities

log = logging.getLogger("incipient")
LATEST = 8  # finished cases that the table shows


class LogLines(Watcher):
    """A line in the log for every finished case."""

    def finished(self, case: SweepCase, outcome: CaseOutcome, progress: SweepProgress) -> None:
        """Say what came out, and the time left."""
        left = "" if progress.left is None else f", {seconds(progress.left)} left"
        counted = f"{progress.finished}/{progress.total}"
        log.info(
            "%s  %s: %s (%.1f s%s)", counted, name_of(case), described(case, outcome), outcome.wall, left
        )


class LiveTable(Watcher):
    """A table: what runs, what has been finished last, how many are left and for how long."""

    def __init__(self, live: Any):
        self._live, self._latest = live, deque[tuple[str, str, str]](maxlen=LATEST)

    def look(self, progress: SweepProgress) -> None:
        """Draw the table again."""
        from rich.table import Table

        table = Table(title=_headline(progress), title_justify="left", box=None, expand=True)
        for head in ("case", "", "time"):
            table.add_column(head, overflow="fold", ratio=None if head == "time" else 1)
        for row in self._latest:
            table.add_row(*row)
        for case, began in progress.running.values():
            table.add_row(name_of(case), "[dim]running[/dim]", f"{time.monotonic() - began:.0f} s")
        self._live.update(table)

    def finished(self, case: SweepCase, outcome: CaseOutcome, progress: SweepProgress) -> None:
        """Show what came out."""
        from rich.markup import escape

        words, failed = escape(described(case, outcome)), outcome.result is None
        shown = f"[red]failed: {words}[/red]" if failed else words
        self._latest.append((name_of(case), shown, f"{outcome.wall:.1f} s"))
        self.look(progress)


def name_of(case: SweepCase) -> str:
    """A case by what was set in it."""
    return ", ".join(case.settings) or case.source


def described(case: SweepCase, outcome: CaseOutcome) -> str:
    """Outcome of a case, in a few words."""
    row: dict[str, Any] = {"task": case.task, "status": FAILED, "reason": outcome.reason}
    if outcome.result is not None:
        row |= {"status": DONE, **quantities(case.task, outcome.result)}
    return in_words(row)


def _headline(progress: SweepProgress) -> str:
    parts = [f"{progress.finished} of {progress.total} cases", f"{len(progress.running)} running"]
    if progress.failed:
        parts.append(f"{progress.failed} failed")
    if progress.elsewhere:
        parts.append(f"{progress.elsewhere} in another sweep")
    if progress.left is not None:
        parts.append(f"about {seconds(progress.left)} left")
    return ", ".join(parts)


@contextmanager
def watching(comm: Comm | None = None) -> Iterator[Watcher]:
    """The right watcher for this rank (default: of all ranks) and this terminal. Not collective."""
    if (comm or ranks_there_are()).rank:
        yield Watcher()
        return
    if not sys.stderr.isatty():
        yield LogLines()
        return
    from rich.console import Console
    from rich.live import Live as Screen

    with Screen(console=Console(stderr=True), transient=True, refresh_per_second=4) as screen:
        yield LiveTable(screen)

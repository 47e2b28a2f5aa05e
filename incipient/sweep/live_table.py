"""Progress of a sweep as a table that is redrawn on a terminal."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice

from rich.console import Console
from rich.live import Live as Screen
from rich.table import Table
from rich.text import Text

from ..cost.frontier import seconds
from .cases import SweepCase
from .procedure import SweepProgress, Watcher
from .store import CaseOutcome
from .table import described

LATEST = 8  # finished cases that the table shows
RUNNING = 20  # running ones
OFTEN = 0.2  # seconds between drawings


class LiveTable(Watcher):
    """A table: what runs, what has been finished last, how many are left and for how long."""

    def __init__(self, live: Screen):
        self._live, self._latest = live, deque[tuple[Text, Text, str]](maxlen=LATEST)
        self._drawn = -OFTEN

    def look(self, progress: SweepProgress) -> None:
        """Draw the table again, unless that was done just now."""
        if time.monotonic() < self._drawn + OFTEN:
            return
        self._drawn = time.monotonic()
        table = Table(title=_headline(progress), title_justify="left", box=None, expand=True)
        for head in ("case", "", "time"):
            table.add_column(head, overflow="fold", ratio=None if head == "time" else 1)
        for row in self._latest:
            table.add_row(*row)
        for case, began in islice(progress.running.values(), RUNNING):
            took = f"{time.monotonic() - began:.0f} s"
            table.add_row(Text(case.name), Text("running", "dim"), took)
        self._live.update(table)

    def finished(self, case: SweepCase, outcome: CaseOutcome, progress: SweepProgress) -> None:
        """Show what came out."""
        # As `Text`: brackets in a title would be taken for markup.
        words = described(case.task, outcome)
        shown = Text(f"failed: {words}", "red") if outcome.result is None else Text(words)
        self._latest.append((Text(case.name), shown, f"{outcome.wall:.1f} s"))
        self.look(progress)


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
def on_screen() -> Iterator[Watcher]:
    """Show the table on the terminal of the standard error. Not collective."""
    with Screen(console=Console(stderr=True), transient=True, refresh_per_second=4) as screen:
        yield LiveTable(screen)

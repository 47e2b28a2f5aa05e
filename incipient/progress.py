"""Progress of a run on the first rank: a live line on a terminal, otherwise log lines."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

log = logging.getLogger("incipient")


class Silent:
    """No output: for library use, and for ranks other than the first."""

    def say(self, message: str) -> None:
        """Report a message."""

    def begin(self, stage: str) -> None:
        """Report the beginning of a stage."""
        self._show(f"stage: {stage}")

    def iterate(self, share: float, iteration: int, size: float) -> None:
        """Report a Newton update at a fraction of the Reynolds number."""
        self._show(f"flow: Re x {share:.3g}, Newton update {iteration + 1}, {size:.1e}")

    def advance(self, time: float, end: float) -> None:
        """Report the time."""
        self._show(f"flow: t = {time:.6g} of {end:g}", time, end)

    def count(self, what: str, done: int, total: int) -> None:
        """Report the number of completed items."""
        self._show(f"{what}: {done} of {total}", done, total)

    def _show(self, now: str, done: float | None = None, total: float | None = None) -> None:
        """Show the stage under way, and how much of it is done."""


class Reported(Silent):
    """Progress in the log, and on the live line of a terminal, if any; stages and steps at level debug."""

    def __init__(self, bar: Any = None):
        self._bar = bar
        self._task = bar and bar.add_task("starting", total=None)

    def say(self, message: str) -> None:
        if self._bar is None:
            log.info(message)
        elif log.isEnabledFor(logging.INFO):
            self._bar.console.print(message, markup=False, highlight=False)

    def _show(self, now: str, done: float | None = None, total: float | None = None) -> None:
        log.debug(now)
        if self._bar is not None:
            self._bar.update(self._task, description=now, completed=done or 0.0, total=total)


@contextmanager
def telling(rank: int) -> Iterator[Silent]:
    """Reporter of progress for this rank and terminal."""
    if rank != 0:
        yield Silent()
        return
    if not sys.stderr.isatty():
        yield Reported()
        return
    from rich import progress
    from rich.console import Console

    columns = (
        progress.SpinnerColumn(),
        progress.TextColumn("{task.description}", markup=False),
        progress.BarColumn(),
        progress.TimeElapsedColumn(),
        progress.TimeRemainingColumn(),
    )
    with progress.Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        yield Reported(bar)

"""Progress of a run on the first rank: a live line on a terminal, otherwise log lines."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

log = logging.getLogger("incipient")
MANY = 1000  # least number of items whose processing is logged


class Silent:
    """No output: for library use, and for ranks other than the first."""

    def begin(self, stage: str) -> None:
        """Report the beginning of a stage."""

    def say(self, message: str) -> None:
        """Report a message."""

    def iterate(self, share: float, iteration: int, size: float) -> None:
        """Report a Newton update at a fraction of the Reynolds number."""

    def advance(self, time: float, end: float) -> None:
        """Report the time."""

    def count(self, what: str, done: int, total: int) -> None:
        """Report the number of completed items."""


class Logged(Silent):
    """Progress in the log."""

    def begin(self, stage: str) -> None:
        log.debug("stage: %s", stage)

    def say(self, message: str) -> None:
        log.info(message)

    def iterate(self, share: float, iteration: int, size: float) -> None:
        log.debug(
            "at %.4g of the Reynolds number: Newton update %d, relative size %.2e",
            share,
            iteration + 1,
            size,
        )

    def advance(self, time: float, end: float) -> None:
        log.debug("time %.6g of %.6g", time, end)

    def count(self, what: str, done: int, total: int) -> None:
        if not done and total >= MANY:
            log.info("%s: %d", what, total)


class Live(Logged):
    """Live line on a terminal."""

    def __init__(self, bar: Any):
        self._bar = bar
        self._task = bar.add_task("starting", total=None)

    def begin(self, stage: str) -> None:
        super().begin(stage)
        self._bar.reset(self._task, total=None, description=stage)

    def say(self, message: str) -> None:
        if log.isEnabledFor(logging.INFO):
            self._bar.console.print(message, markup=False, highlight=False)

    def iterate(self, share: float, iteration: int, size: float) -> None:
        super().iterate(share, iteration, size)
        self._bar.update(
            self._task,
            description=f"flow: Re x {share:.3g}, Newton update {iteration + 1}, {size:.1e}",
        )

    def advance(self, time: float, end: float) -> None:
        super().advance(time, end)
        self._bar.update(
            self._task, completed=time, total=end, description=f"flow: t = {time:.4g} of {end:g}"
        )

    def count(self, what: str, done: int, total: int) -> None:
        self._bar.update(
            self._task, completed=done, total=total, description=f"{what}: {done} of {total}"
        )


@contextmanager
def telling(rank: int) -> Iterator[Silent]:
    """Reporter of progress for this rank and terminal."""
    if rank != 0:
        yield Silent()
        return
    if not sys.stderr.isatty():
        yield Logged()
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
        yield Live(bar)

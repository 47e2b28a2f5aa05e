"""The procedure of a sweep: which case comes when, within memory and time, and what is written when."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field
from typing import Protocol

from ..errors import Interrupted
from .cases import SweepCase
from .expectation import Expected
from .store import DONE, FAILED, WAITING, CaseOutcome, Store

LOOK = 0.5  # seconds after which the state is looked at again, at the latest


@dataclass(frozen=True)
class Limits:
    """Limits of a sweep: MiB at a time, and seconds of wall time."""

    memory_mib: float = float("inf")
    wall: float = float("inf")


@dataclass
class SweepProgress:
    """State of a sweep.

    total: cases; known: finished before it began; done, failed: by this sweep; elsewhere: at another sweep
    running: cases with the time when they began; spent: seconds that finished ones took; places: at a time
    refined: what a refinement came to, lines for a reader
    """

    total: int
    known: int
    places: int
    done: int = 0
    failed: int = 0
    elsewhere: int = 0
    running: dict[str, tuple[SweepCase, float]] = field(default_factory=dict)
    spent: float = 0.0
    refined: Sequence[str] = ()

    @property
    def finished(self) -> int:
        """Cases that need not be computed any more."""
        return self.known + self.done + self.failed

    @property
    def mean(self) -> float | None:
        """Seconds that a case takes; None before one is done."""
        return self.spent / self.done if self.done else None

    @property
    def left(self) -> float | None:
        """Seconds that are left, by what cases have taken so far."""
        if self.mean is None:
            return None
        return self.mean * (self.total - self.finished - self.elsewhere) / self.places


class Watcher:
    """Observer of a sweep's progress; this one does nothing."""

    def look(self, progress: SweepProgress) -> None:
        """Some time has passed."""

    def finished(self, case: SweepCase, outcome: CaseOutcome, progress: SweepProgress) -> None:
        """A case has been finished."""


class Workers(Protocol):
    """Workers that compute up to `places` cases at a time."""

    places: int

    def submit(self, case: SweepCase) -> Future[CaseOutcome]:
        """Let an idle worker compute a case; called while fewer than `places` are at work."""

    def outcome(self, case: SweepCase, future: Future[CaseOutcome]) -> CaseOutcome:
        """Take the outcome of a finished case; of one whose worker has died, the reason."""

    def close(self, at_once: bool) -> None:
        """End all workers; those at work too if `at_once`."""


class Sweep:
    """One sweep over cases: those that the file knows already are left alone.

    Args:
        expect:  what cases will take.
        further: cases, in the store by then, that what has been found asks for; none: the sweep is at its end.
    """

    def __init__(
        self,
        cases: Sequence[SweepCase],
        store: Store,
        workers: Workers,
        expect: Callable[[Sequence[SweepCase]], Mapping[str, Expected]],
        limits: Limits = Limits(),
        watcher: Watcher | None = None,
        further: Callable[[], Sequence[SweepCase]] = tuple,
    ):
        self._store, self._workers, self._limits = store, workers, limits
        self._expect, self._watcher, self._further = expect, watcher or Watcher(), further
        self._expected: dict[str, Expected] = {}
        self._cases = {case.identity: case for case in cases}
        self._began = time.monotonic()
        self._compiled: set[str] = set()
        self._waiting: list[SweepCase] = []
        self._at_work: dict[Future[CaseOutcome], SweepCase] = {}
        self._progress = SweepProgress(len(self._cases), 0, workers.places)

    def run(self) -> SweepProgress:
        """Compute what waits, and wait for what other sweeps compute.

        Raises:
            Interrupted: the time is up, or the sweep was asked to end; what runs then waits again.
            OutputError: the file cannot be written.
        """
        at_once = True
        try:
            self._sort_out()
            while self._is_at_work() or self._grows():
                self._go_on()
            at_once = False
        except KeyboardInterrupt as interrupt:
            raise Interrupted(self._left("interrupted")) from interrupt
        finally:
            try:
                self._store.give_back()
            finally:
                self._workers.close(at_once)
        return self._progress

    def _is_at_work(self) -> bool:
        return bool(self._waiting or self._progress.running or self._progress.elsewhere)

    def _grows(self) -> bool:
        """Whether what has been found asks for cases that are not known yet; these then wait."""
        while cases := self._further():
            self._cases |= {case.identity: case for case in cases}
            self._progress.total = len(self._cases)
            self._sort_out()
            if self._is_at_work():
                return True
        return False

    def _go_on(self) -> None:
        """Give out what may begin, and take what has been finished."""
        if self._waiting and self._has_idle():
            self._give()
        if not self._progress.running and self._waiting and self._is_late():
            raise Interrupted(self._left("the time is up"))
        self._take()
        if time.monotonic() - self._began > self._limits.wall:
            raise Interrupted(self._left("the time is up"))
        if self._progress.elsewhere and not self._waiting:
            self._store.free_abandoned()
            self._sort_out()
        self._watcher.look(self._progress)

    def _sort_out(self) -> None:
        """Sort out the cases that wait, and those at another sweep."""
        states = self._store.states(list(self._cases))
        self._waiting = [case for name, case in self._cases.items() if states[name] == WAITING]
        progress, finished = self._progress, sum(state in (DONE, FAILED) for state in states.values())
        progress.known = finished - progress.done - progress.failed
        progress.elsewhere = len(states) - finished - len(self._waiting) - len(progress.running)
        new = [case for case in self._waiting if case.identity not in self._expected]
        self._expected |= self._expect(new)

    def _give(self) -> None:
        """Give cases to all who are idle, as far as memory, compiled forms and time allow."""
        for case in list(self._waiting):
            if not self._has_idle() or self._is_late():
                return
            if not self._may_begin(case):
                continue
            self._waiting.remove(case)
            if not self._store.claim(case.identity):
                self._progress.elsewhere += 1
                continue
            reason = self._too_large(case)
            if reason:
                self._finish(case, CaseOutcome(reason=reason))
                continue
            self._progress.running[case.identity] = case, time.monotonic()
            self._at_work[self._workers.submit(case)] = case

    def _may_begin(self, case: SweepCase) -> bool:
        """Whether there is memory for it, and no other case compiles its forms or others it may share just now."""
        running = [other for other, _ in self._progress.running.values()]
        compiling = any(other.forms not in self._compiled for other in running)
        if compiling and case.forms not in self._compiled:
            return False
        taken = sum(self._memory(other) for other in running)
        return not running or taken + self._memory(case) <= self._limits.memory_mib

    def _memory(self, case: SweepCase) -> float:
        return self._expected.get(case.identity, Expected()).memory_mib or 0.0

    def _too_large(self, case: SweepCase) -> str:
        memory = self._memory(case)
        if memory <= self._limits.memory_mib:
            return ""
        return (
            f"needs about {memory:.0f} MiB of memory, and {self._limits.memory_mib:.0f} are free; "
            "free some, or allow it with --memory, and repeat the command with --retry"
        )

    def _is_late(self) -> bool:
        """Whether a case that begins now would not be finished in time."""
        left = self._limits.wall - (time.monotonic() - self._began)
        return left < (self._progress.mean or 0.0)

    def _has_idle(self) -> bool:
        return len(self._at_work) < self._workers.places

    def _take(self) -> None:
        """Take what has been finished, waiting for it for a while."""
        if not self._at_work:
            time.sleep(LOOK)
        for future in wait(self._at_work, LOOK, FIRST_COMPLETED).done:
            case = self._at_work.pop(future)
            outcome = self._workers.outcome(case, future)
            del self._progress.running[case.identity]
            self._finish(case, outcome)

    def _finish(self, case: SweepCase, outcome: CaseOutcome) -> None:
        self._store.finish(case.identity, outcome)
        if outcome.result is None:
            self._progress.failed += 1
        else:
            self._progress.done += 1
            self._progress.spent += outcome.wall
            self._compiled.add(case.forms)
        self._watcher.finished(case, outcome, self._progress)

    def _left(self, why: str) -> str:
        finished = f"{self._progress.finished} of {self._progress.total} cases are finished"
        return f"{why}: {finished} and kept in {self._store.path}; repeat the command to resume"

"""The procedure of a sweep: which case comes when, within memory and time, and what is written when."""

from __future__ import annotations

import logging
import time
import uuid
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Future
from contextlib import suppress
from dataclasses import dataclass, field, replace
from queue import Empty, SimpleQueue
from typing import Protocol

from ..errors import IncipientError, Interrupted, OutputError
from .case_process import Order
from .cases import SweepCase
from .expectation import Expected
from .store import DONE, FAILED, WAITING, CaseOutcome, Store

log = logging.getLogger("incipient")
LOOK = 0.5  # seconds after which the state is looked at again, at the latest
TRIES = 3  # how often a case is begun whose process dies or is ended
FACTOR = 20.0  # times its estimate that a case may take
LEAST = 600.0  # seconds that it may take in any case, as estimates are of good machines
UNKNOWN = 86400.0  # seconds that it may take where nothing is known
LATER = 60.0  # seconds after a case should have been ended by its worker that its future is not waited for any more


@dataclass(frozen=True)
class Limits:
    """Limits of a sweep: MiB at a time, seconds of wall time, and those of each case.

    tries: how often a case is begun whose process dies or is ended
    case: seconds that a case may take; None: `factor` times what is expected of it
    each_mib: that a case may take
    """

    memory_mib: float = float("inf")
    wall: float = float("inf")
    tries: int = TRIES
    case: float | None = None
    factor: float = FACTOR
    each_mib: float = float("inf")

    def of_case(self, expected: float | None, longest: float | None) -> float:
        """Seconds that a case may take, by those expected, and those that the longest one so far has taken."""
        known = [one for one in (expected, longest) if one is not None]
        if self.case is not None or not known:
            return UNKNOWN if self.case is None else self.case
        return max(LEAST, self.factor * max(known))


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
        return self.mean * (self.total - self.finished - self.elsewhere) / max(self.places, 1)


class Watcher:
    """Observer of a sweep's progress; this one does nothing."""

    def look(self, progress: SweepProgress) -> None:
        """Some time has passed."""

    def finished(self, case: SweepCase, outcome: CaseOutcome, progress: SweepProgress) -> None:
        """A case has been finished."""


class Workers(Protocol):
    """Workers of an executor, which compute up to `places` cases at a time."""

    @property
    def places(self) -> int:
        """How many cases can be computed at a time; it may change."""

    def submit(self, order: Order) -> Future[CaseOutcome]:
        """Give out a case."""

    def renew(self) -> None:
        """Go on after all futures have failed together; raises OutputError where that cannot be."""

    def close(self, sweep: str, at_once: bool) -> None:
        """End what has been started for a sweep; cases at work too if `at_once`."""


@dataclass(frozen=True)
class _Attempt:
    """A case that has been given out, and when its future is not waited for any more."""

    case: SweepCase
    until: float


class Sweep:
    """One sweep over cases: those that the file knows already are left alone.

    Args:
        expect:  what cases will take.
        further: cases, in the store by then, that what has been found asks for; none: the sweep is at its end.
        ranks:   of each case.
        clock:   seconds.
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
        ranks: int = 1,
        clock: Callable[[], float] = time.monotonic,
    ):
        self._store, self._workers, self._limits = store, workers, limits
        self._expect, self._watcher, self._further = expect, watcher or Watcher(), further
        self._ranks, self._clock, self._name = ranks, clock, uuid.uuid4().hex
        self._expected: dict[str, Expected] = {}
        self._cases = {case.identity: case for case in cases}
        self._began = self._looked = clock()
        self._compiled: set[str] = set()
        self._longest: dict[str, float] = {}  # seconds, by forms
        self._waiting: dict[str, SweepCase] = {}
        self._tries = Counter[str]()  # of cases that are this sweep's until they are finished
        self._at_work: dict[Future[CaseOutcome], _Attempt] = {}
        self._given_up: dict[
            Future[CaseOutcome], SweepCase
        ] = {}  # late ones, whose workers may never be free again
        self._ended: SimpleQueue[Future[CaseOutcome]] = SimpleQueue()
        self._progress = SweepProgress(len(self._cases), 0, workers.places)

    def run(self) -> SweepProgress:
        """Compute what waits, and wait for what other sweeps compute.

        Raises:
            Interrupted: the time is up, or the sweep was asked to end; what runs then waits again.
            OutputError: the file cannot be written, or there are no workers any more.
        """
        at_once = True
        try:
            self._sort_out()
            while self._is_at_work() or self._grows():
                self._go_on()
            at_once = bool(self._given_up)
            if at_once:  # ranks of an mpirun can only be ended together, this one too
                log.warning(
                    self._left(
                        f"workers of {len(self._given_up)} tries have not come back and are ended"
                    )
                )
        except KeyboardInterrupt as interrupt:
            raise Interrupted(self._left("interrupted")) from interrupt
        finally:
            try:
                self._store.give_back()
            finally:
                for future in self._at_work:
                    future.cancel()
                self._workers.close(self._name, at_once)
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
        if self._waiting and self._idle() > 0:
            self._give()
        if not self._progress.running and self._waiting and self._is_late():
            raise Interrupted(self._left("the time is up"))
        self._take()
        self._give_up()
        if self._clock() - self._began > self._limits.wall:
            raise Interrupted(self._left("the time is up"))
        if self._progress.elsewhere and not self._waiting:
            self._store.free_abandoned()
            self._sort_out()
        self._watcher.look(self._progress)

    def _sort_out(self) -> None:
        """Sort out the cases that wait, and those at another sweep."""
        states = self._store.states(list(self._cases))
        again = {name: case for name, case in self._waiting.items() if name in self._tries}
        waiting = {name: case for name, case in self._cases.items() if states[name] == WAITING}
        self._waiting = waiting | again
        progress, finished = (
            self._progress,
            sum(state in (DONE, FAILED) for state in states.values()),
        )
        progress.known = finished - progress.done - progress.failed
        progress.elsewhere = len(states) - finished - len(self._waiting) - len(progress.running)
        new = [case for name, case in self._waiting.items() if name not in self._expected]
        self._expected |= self._expect(new)

    def _give(self) -> None:
        """Give cases to all who are idle, as far as memory, compiled forms and time allow."""
        chosen = list(self._chosen())
        again = [case.identity for case in chosen if case.identity in self._tries]
        new = [case.identity for case in chosen if case.identity not in self._tries]
        taken = self._store.claim(new, again) if chosen else set()
        too_large: dict[str, CaseOutcome] = {}
        for case in chosen:
            del self._waiting[case.identity]
            if case.identity not in self._tries and case.identity not in taken:
                self._progress.elsewhere += 1
            elif reason := self._too_large(case):
                too_large[case.identity] = CaseOutcome(reason=reason)
            else:
                self._submit(case)
        self._finish(too_large)

    def _chosen(self) -> Iterator[SweepCase]:
        """Cases for those who are idle, in their order, as far as memory and compiled forms allow."""
        running = [other for other, _ in self._progress.running.values()]
        compiling = any(other.forms not in self._compiled for other in running)
        taken, idle = 0.0, self._idle()
        if self._limits.memory_mib < float("inf"):
            taken = sum(map(self._memory, running))
        none = not running
        for case in self._waiting.values():
            if idle <= 0 or self._is_late():
                return
            # No two cases compile the same forms, and a case whose memory does not suffice for both waits.
            is_compiled = case.forms in self._compiled
            if (compiling and not is_compiled) or not (
                none or taken + self._memory(case) <= self._limits.memory_mib
            ):
                continue
            yield case
            none, compiling = False, compiling or not is_compiled
            taken, idle = taken + self._memory(case), idle - 1

    def _submit(self, case: SweepCase) -> None:
        self._tries[case.identity] += 1
        now, expected = self._clock(), self._expected.get(case.identity, Expected()).seconds
        limit = self._limits.of_case(expected, self._longest.get(case.forms))
        order = Order(self._name, case.task, case.text, self._ranks, limit, self._limits.each_mib)
        try:
            future = self._workers.submit(order)
        except BrokenExecutor:
            self._again(case)
            self._workers.renew()
            return
        self._at_work[future] = _Attempt(case, now + 1.1 * limit + LATER)
        self._progress.running[case.identity] = case, now
        future.add_done_callback(self._ended.put)

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
        left = self._limits.wall - (self._clock() - self._began)
        return left < (self._progress.mean or 0.0)

    def _idle(self) -> int:
        """How many cases can be given out."""
        self._progress.places = self._workers.places
        return self._progress.places - len(self._at_work) - len(self._given_up)

    def _take(self) -> None:
        """Take what has been finished, waiting for it for a while."""
        ended = []
        with suppress(Empty):
            ended.append(self._ended.get(timeout=LOOK))
            while True:
                ended.append(self._ended.get_nowait())
        outcomes: dict[str, CaseOutcome] = {}
        are_broken, refusal = False, None
        for future in ended:
            attempt, late = self._at_work.pop(future, None), self._given_up.pop(future, None)
            if attempt is None and late is None:
                continue
            outcome = _outcome(future)
            if isinstance(outcome, IncipientError):
                refusal = outcome
            elif outcome is None:
                are_broken = True
                if attempt is not None:
                    self._tries[attempt.case.identity] -= 1  # that is not its fault
                    self._again(attempt.case)
            elif attempt is not None:
                self._settle(attempt.case, outcome, outcomes)
            elif outcome.result is not None and late is not None and late.identity in self._tries:
                self._drop(late)
                self._settle(late, outcome, outcomes)
        self._finish(outcomes)
        if refusal is not None:
            raise refusal
        if are_broken:
            self._workers.renew()

    def _settle(
        self, case: SweepCase, outcome: CaseOutcome, outcomes: dict[str, CaseOutcome]
    ) -> None:
        """Let a case be finished by its outcome, or be tried again."""
        tries = self._tries[case.identity]
        if not outcome.lost:
            outcomes[case.identity] = outcome
        elif tries < self._limits.tries:
            log.warning("%s: %s; it is tried again", case.name, outcome.reason)
            self._again(case)
        else:
            said = f" (tried {tries} times)" if tries > 1 else ""
            outcomes[case.identity] = replace(outcome, reason=f"{outcome.reason}{said}")

    def _again(self, case: SweepCase) -> None:
        self._progress.running.pop(case.identity, None)
        self._waiting[case.identity] = case

    def _drop(self, case: SweepCase) -> None:
        """Forget the further attempts at a case."""
        self._waiting.pop(case.identity, None)
        for future in [one for one, attempt in self._at_work.items() if attempt.case is case]:
            del self._at_work[future]
            if not future.cancel():
                self._given_up[future] = case

    def _give_up(self) -> None:
        """Wait no more for futures whose workers should have ended their cases long ago: these may have gone."""
        now, outcomes = self._clock(), dict[str, CaseOutcome]()
        if now < self._looked + LOOK:
            return
        self._looked = now
        for future in [one for one, attempt in self._at_work.items() if now > attempt.until]:
            case = self._at_work.pop(future).case
            if not future.cancel():
                self._given_up[future] = case
            began = self._progress.running[case.identity][1]
            reason = f"its worker has not answered for {now - began:.0f} s"
            self._settle(case, CaseOutcome(reason=reason, wall=now - began, lost=True), outcomes)
        self._finish(outcomes)
        if self._given_up and not self._at_work and self._waiting and self._idle() <= 0:
            raise OutputError(self._left("all workers are at cases that do not end"))

    def _finish(self, outcomes: Mapping[str, CaseOutcome]) -> None:
        if outcomes:
            self._store.finish(outcomes)
        for identity, outcome in outcomes.items():
            case = self._cases[identity]
            self._progress.running.pop(identity, None)
            self._tries.pop(identity, None)
            if outcome.result is None:
                self._progress.failed += 1
            else:
                self._progress.done += 1
                self._progress.spent += outcome.wall
                self._compiled.add(case.forms)
                self._longest[case.forms] = max(self._longest.get(case.forms, 0.0), outcome.wall)
            self._watcher.finished(case, outcome, self._progress)

    def _left(self, why: str) -> str:
        finished = f"{self._progress.finished} of {self._progress.total} cases are finished"
        return f"{why}: {finished} and kept in {self._store.path}; repeat the command to resume"


def _outcome(future: Future[CaseOutcome]) -> CaseOutcome | IncipientError | None:
    """The outcome of a future that has ended, of one whose worker failed the reason.

    An error where the worker refuses all cases, None if all futures have failed together.
    """
    try:
        return future.result()
    except (CancelledError, BrokenExecutor):
        return None
    except IncipientError as error:
        return error
    except Exception as error:  # of the executor
        said = " ".join(f"{type(error).__name__}: {error}".split())
        return CaseOutcome(reason=f"its worker failed: {said}", lost=True)

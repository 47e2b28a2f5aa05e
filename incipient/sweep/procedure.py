"""The sweep: Dask's workers compute the cases, and this process writes their results."""

from __future__ import annotations

import asyncio
import multiprocessing
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import CancelledError, Future
from contextlib import AbstractContextManager, ExitStack, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from ..errors import (
    IncipientError,
    Interrupted,
    MissingError,
    OutputError,
    refuse_broken,
    shortened,
)
from ..installed import memory_of_libraries
from ..parallel import ranks_there_are
from ..progress import Silent
from ..scene import Scene
from .cases import Source, SweepCase
from .refinement import SweepRefinement
from .request import parsed_seconds, requested
from .store import DONE, FAILED, Store
from .table import in_words, pockets, rows
from .worker import (
    RELEASE,
    CaseOutcome,
    client_of,
    computed_within,
    exceeded_memory,
    local_client,
    number_of_workers,
    usual_jobs,
)

LOOK = 0.5  # seconds between looks at the time
TRIES = 3  # how often a case is begun whose process dies
LIMIT = 86400.0  # seconds that a case may take
RESTART = 60.0  # seconds in which worker processes of this machine start again


@dataclass(frozen=True)
class Means:
    """Resources of a sweep; see `run`."""

    jobs: int | None = None
    memory_mib: float | None = None
    wall: float = float("inf")
    retry: bool = False
    scheduler: Any = None
    tries: int = TRIES
    limit: float = LIMIT

    def __post_init__(self) -> None:
        least, numbers = memory_of_libraries(), (self.jobs, self.memory_mib, self.tries)
        is_elsewhere, remedy = self.scheduler is not None, "are started by you; give"
        refuse_broken(
            (
                getattr(multiprocessing.current_process(), "_inheriting", False),
                "incipient.sweep.run: worker processes import the script; "
                'put the calls of the script below `if __name__ == "__main__":`',
            ),
            (
                ranks_there_are().size > 1,
                "a sweep computes each case on one rank; "
                "start it without mpirun, with --jobs, or with --scheduler on a cluster",
            ),
            *(
                (
                    value is not None and not value > 0,
                    f"--{name} {value}: is not above zero; give a positive number",
                )
                for name, value in zip(("jobs", "memory", "tries"), numbers, strict=True)
            ),
            (
                self.memory_mib is not None and self.memory_mib < least,
                f"--memory {self.memory_mib}: the libraries of a worker process take {least:.0f} MiB; give more",
            ),
            (
                is_elsewhere and self.jobs,
                f"--jobs: the workers of --scheduler {remedy} --nworkers to its `dask worker` instead",
            ),
            (
                is_elsewhere and self.memory_mib,
                f"--memory: the workers of --scheduler {remedy} --memory-limit to its `dask worker` instead",
            ),
        )


@dataclass
class SweepProgress:
    """Numbers of cases: in all, finished before, computed, failed; `refined`: text on a refinement."""

    file: Path
    total: int = 0
    known: int = 0
    done: int = 0
    failed: int = 0
    refined: Sequence[str] = ()

    @property
    def finished(self) -> int:
        return self.known + self.done + self.failed


def run(
    scenes: Scene | Path | str | list[Any] | tuple[Any, ...],
    file: Path | str | None = None,
    over: Mapping[str, Any] | Sequence[str] = (),
    *,
    do: str | None = None,
    zip: bool = False,
    cases: Path | str | None = None,
    settings: Sequence[str] = (),
    jobs: int | None = None,
    memory_mib: float | None = None,
    wall: str | float | None = None,
    retry: bool = False,
    refine: float | bool | None = None,
    most: int | None = None,
    quantity: str | None = None,
    scheduler: Any = None,
    tries: int = TRIES,
    limit: str | float | None = None,
    dry_run: bool = False,
    voice: Silent | None = None,
) -> SweepProgress:
    """Compute the cases of a sweep that its file does not yet have. Not collective: one rank calls it.

    A script calls it below ``if __name__ == "__main__":``, since worker processes import the script.

    Args:
        scenes: a scene or several, or names of files; of cases to be judged names of files.
        file: the SQLite file of the sweep; default: results/SCENE_TASK.sqlite.
        over: values by key, as a list or as text such as ``"log:0.1:200:17"``; or texts such as
            ``"fluid.reynolds=1,2"``; empty: from the section [sweep].
        do: "run", "threshold", "gust", "entrainment" or "judge".
        zip: values of several keys vary side by side instead of in every combination.
        cases: a CSV file of cases.
        settings: overrides of all cases, such as ``"numerics.mesh_size=2"``.
        jobs: cases at a time; default: one per core.
        memory_mib: memory of each case; default: 4/5 of the free memory over `jobs`.
        wall: seconds, or text such as "8h", after which the sweep ends.
        retry: whether failed cases are computed again.
        refine: add cases where the mode changes or a quantity bends, to this fraction of the range; True: 0.02.
        most: cases in all, including those added.
        quantity: the column for `refine`; default: the Shields or the safety factor.
        scheduler: of Dask: "tcp://HOST:PORT", the name of its .json file, or a cluster object.
        tries: how often a case is begun whose worker process dies.
        limit: seconds, or text such as "2h", that a case may take; default: a day.
        dry_run: only count the cases, without a file.
        voice: is notified of progress.

    Raises:
        IncipientError: earlier results are in the file.
    """
    end = float("inf") if wall is None else parsed_seconds(wall, "wall")
    longest = LIMIT if limit is None else parsed_seconds(limit, "limit")
    means = Means(jobs, memory_mib, end, retry, scheduler, tries, longest)
    request = requested(
        [Source.of(scene) for scene in (scenes if isinstance(scenes, list | tuple) else [scenes])],
        over,
        None if cases is None else Path(cases),
        settings,
        do=do,
        zip=zip or None,
        refine=refine,
        most=most,
        quantity=quantity,
    )
    usual = Path("results") / f"{request.sources[0].name}_{request.section.do}.sqlite"
    path, reporter = usual if file is None else Path(file), voice or Silent()
    resolved = request.cases(reporter)
    if dry_run:
        states = dict[str, str]()
        if path.is_file():
            with Store(path) as store:
                states = store.states()
        known = sum(states.get(case.identity) in (DONE, FAILED) for case in resolved)
        return SweepProgress(path, len(resolved), known)
    refinement = request.refinement(resolved)
    with Store(path, make=True) as store:
        sweep = _Sweep(store, means, reporter)
        try:
            sweep.add(resolved)
            sweep.compute(refinement)
        except KeyboardInterrupt as interrupt:
            raise Interrupted(sweep.left("interrupted")) from interrupt
        keys = store.keys()
    for line in pockets(rows(path), keys):
        reporter.say(line)
    if refinement is not None:
        sweep.progress.refined = refinement.lines()
    return sweep.progress


class _Sweep:
    def __init__(self, store: Store, means: Means, voice: Silent):
        self.progress = SweepProgress(store.path)
        self._store, self._means, self._voice = store, means, voice
        self._began = time.monotonic()
        self._waiting: dict[str, SweepCase] = {}
        self._running: dict[Future[CaseOutcome], tuple[SweepCase, float]] = {}  # since a time
        self._ended: SimpleQueue[Future[CaseOutcome]] = SimpleQueue()
        self._tries = Counter[str]()
        self._client: Any = None
        self._seen = self._began  # when there were workers last

    def add(self, cases: Sequence[SweepCase]) -> None:
        self._store.add(cases, self._means.retry)
        states = self._store.states()
        waiting = {
            case.identity: case for case in cases if states[case.identity] not in (DONE, FAILED)
        }
        self._waiting |= waiting
        self.progress.total += len(cases)
        self.progress.known += len(cases) - len(waiting)

    def compute(self, refinement: SweepRefinement | None) -> None:
        with ExitStack() as stack:
            while self._waiting or self._running or self._grows(refinement):
                if self._client is None:
                    self._client = stack.enter_context(self._connected(refinement is None))
                    self._seen = time.monotonic()
                    if find_spec("bokeh"):
                        self._voice.say(f"dashboard: {self._client.dashboard_link}")
                if time.monotonic() - self._began > self._means.wall:
                    raise Interrupted(self.left("the time limit is reached"))
                self._give()
                with suppress(Empty):
                    ended = [self._ended.get(timeout=LOOK)]
                    ended += [self._ended.get_nowait() for _ in range(self._ended.qsize())]
                    with self._store.transaction():  # workers need not wait for the disk
                        for coming in ended:
                            self._end(coming)
                        self._give()

    def left(self, why: str) -> str:
        return (
            f"{why}: {self.progress.finished} of {self.progress.total} cases are finished "
            f"and kept in {self._store.path}; repeat the command to resume"
        )

    def _grows(self, refinement: SweepRefinement | None) -> bool:
        while refinement is not None and (
            cases := refinement.following(self._store.columns(refinement.identities))
        ):
            self.add(cases)
            if self._waiting:
                return True
        return False

    def _connected(self, is_all: bool) -> AbstractContextManager[Any]:
        if self._means.scheduler is not None:
            return client_of(self._means.scheduler)
        jobs = self._means.jobs or usual_jobs()
        return local_client(
            min(jobs, len(self._waiting)) if is_all else jobs, self._means.memory_mib
        )

    def _give(self) -> None:
        if self._client.status == "closed":
            raise OutputError(self.left("the scheduler does not respond"))
        number, now = number_of_workers(self._client), time.monotonic()
        self._seen = now if number else self._seen
        if self._means.scheduler is None and now > self._seen + RESTART:
            raise OutputError(self.left("worker processes do not start; free memory for them"))
        idle = max(number - len(self._running), 0)
        for identity in list(islice(self._waiting, idle)):
            case = self._waiting.pop(identity)
            order = (self._means.limit, RELEASE, case.task, case.text)
            future = self._client.submit(computed_within, *order, pure=False)
            # A wait with a time limit, as Dask's futures have it, would lose outcomes that take longer to come.
            outcome = self._client.gather(future, asynchronous=True)
            coming = asyncio.run_coroutine_threadsafe(outcome, self._client.loop.asyncio_loop)
            self._running[coming] = case, time.monotonic()
            self._tries[identity] += 1
            coming.add_done_callback(self._ended.put)

    def _end(self, coming: Future[CaseOutcome]) -> None:
        from distributed import KilledWorker
        from distributed.comm import CommClosedError

        case, since = self._running.pop(coming)
        spent = time.monotonic() - since
        try:
            outcome: CaseOutcome | None = coming.result()
        except KilledWorker as error:
            outcome = self._of_death(case, error.last_worker.address, spent)
        except (CancelledError, CommClosedError):
            self._voice.say(f"{case.name}: the connection to the scheduler is lost; waiting for it")
            self._tries[case.identity] -= 1
            self._waiting[case.identity] = case
            return
        except IncipientError:
            raise
        except ModuleNotFoundError as error:
            raise MissingError(
                f"the workers cannot compute cases ({error}); "
                "install incipient where the workers run"
            ) from None
        except Exception as error:
            message = shortened(f"{type(error).__name__}: {error}", 200)
            outcome = CaseOutcome(reason=f"its worker failed: {message}", wall=spent)
        if outcome is not None:
            self._keep(case, outcome)

    def _of_death(self, case: SweepCase, worker: str, spent: float) -> CaseOutcome | None:
        """The outcome of a case whose worker has died; None: it is tried again."""
        limit, tries = self._means.limit, self._tries[case.identity]
        if spent >= limit:
            return CaseOutcome(reason=f"was stopped: it took longer than {limit:.0f} s", wall=spent)
        reason = f"its worker process at {worker} was killed, or a library has crashed"
        if exceeded_memory(self._client, worker):
            reason = "was ended because it exceeded the memory of its worker; give fewer --jobs"
        if tries < self._means.tries:
            self._voice.say(f"{case.name}: {reason}; it is repeated")
            self._waiting[case.identity] = case
            return None
        return CaseOutcome(reason=f"{reason} (tried {tries} times)", wall=spent)

    def _keep(self, case: SweepCase, outcome: CaseOutcome) -> None:
        self._store.finish(case.identity, self._tries[case.identity], outcome)
        progress = self.progress
        progress.done += outcome.result is not None
        progress.failed += outcome.result is None
        status = FAILED if outcome.result is None else DONE
        row = {"task": case.task, "status": status, "reason": outcome.reason, **outcome.columns}
        self._voice.say(
            f"{progress.finished}/{progress.total}  {case.name}: {in_words(row)} ({outcome.wall:.1f} s)"
        )
        self._voice.count("cases", progress.finished, progress.total)

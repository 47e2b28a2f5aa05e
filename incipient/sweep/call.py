"""A sweep from start to end: what the command line and Python call."""

from __future__ import annotations

import logging
import socket
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, cast

from ..errors import SceneError
from ..installed import required
from ..parallel import Alone, Comm, collectively, ranks_there_are
from ..progress import Silent
from ..scene import Scene
from .axes import of_mapping
from .case_refinement import SweepRefinement
from .cases import Source, SweepCase
from .executors import groups, require_cores, workers_of
from .expectation import Foresight, cores, free_memory_mib
from .procedure import FACTOR, TRIES, Limits, Sweep, SweepProgress, Watcher
from .request import RefinementOptions, Request, parsed_limit, parsed_seconds, requested
from .store import Store

log = logging.getLogger("incipient")


@dataclass(frozen=True)
class Means:
    """Resources of a sweep.

    jobs:  cases at a time, None: as many as there are cores for; ranks: of each case
    memory_mib: at a time, with an executor that of each case, None: what is free; wall: seconds
    retry: whether failed cases are computed again
    executor: of `concurrent.futures`, or dask://HOST:PORT; None: processes of this machine, or ranks
    tries, limit, factor: see `procedure.Limits`
    """

    jobs: int | None = None
    ranks: int = 1
    memory_mib: float | None = None
    wall: float = float("inf")
    retry: bool = False
    executor: Executor | str | None = None
    tries: int = TRIES
    limit: float | None = None
    factor: float = FACTOR

    def __post_init__(self) -> None:
        numbers = {
            "jobs": self.jobs,
            "ranks": self.ranks,
            "memory": self.memory_mib,
            "tries": self.tries,
        }
        for name, value in numbers.items():
            if value is not None and not value > 0:
                why = "is not above zero" if value <= 0 else "is not a number"
                raise SceneError(f"--{name} {value}: {why}; give a positive number")

    @property
    def limits(self) -> Limits:
        """Memory and time; the memory of other machines is not known here."""
        infinite = float("inf")
        each = (
            free_memory_mib()
            if self.memory_mib is None and self.executor is None
            else self.memory_mib or infinite
        )
        together = each if self.executor is None else infinite
        return Limits(together, self.wall, self.tries, self.limit, self.factor, each)

    def places(self, comm: Comm) -> int:
        """Number of cases computed at a time; zero: as many as the executor has workers. Raises SceneError."""
        if comm.size > 1:
            if self.executor is not None:
                raise SceneError(
                    "--executor: the ranks of this mpirun compute the cases; start it without mpirun"
                )
            return groups(comm, self.ranks)
        if self.executor is not None:
            return self.jobs or 0
        if self.ranks > cores():
            raise SceneError(
                f"--ranks {self.ranks}: this machine has {cores()} cores for it; give fewer"
            )
        return self.jobs or max(1, cores() // self.ranks)


def run(
    scenes: Scene | Path | str | list[Any] | tuple[Any, ...],
    file: Path | str,
    over: Mapping[str, Any] | None = None,
    *,
    do: str | None = None,
    zip: bool = False,
    cases: Path | str | None = None,
    settings: Sequence[str] = (),
    jobs: int | None = None,
    ranks: int = 1,
    memory_mib: float | None = None,
    wall: str | float | None = None,
    retry: bool = False,
    refine: float | bool | None = None,
    most: int | None = None,
    quantity: str | None = None,
    executor: Executor | str | None = None,
    tries: int = TRIES,
    limit: str | float | None = None,
    watcher: Watcher | None = None,
    comm: Comm | None = None,
) -> SweepProgress:
    """Compute the cases of a sweep that its file does not hold yet. Collective over `comm` (default: all ranks).

    On one rank processes of this machine compute the cases, on several these ranks, of which the first gives them out.
    With an `executor` its workers do, and this process alone gives them out (default of `comm`).

    Args:
        scenes: a scene or several, or names of files; of cases to be judged names of files.
        file: the SQLite file of the sweep.
        over: values by key, as a list or as text such as ``"log:0.1:200:17"``; None: as the section [sweep] says.
        do: "run", "threshold", "gust", "entrainment" or "judge".
        zip: values of several keys go along side by side instead of in every combination.
        cases: a CSV file of cases.
        settings: overrides of all cases, such as ``"numerics.mesh_size=2"``.
        jobs: cases at a time.
        ranks: of each case.
        memory_mib: what cases may take at a time; default: what is free.
        wall: seconds, or text such as "8h", after which the sweep ends.
        retry: whether cases that have failed are computed again.
        refine: cases are added where the mode changes or a quantity bends, to this share of the range; True: 0.02.
        most: cases in all, those added too.
        quantity: the column that is to be straight between cases; default: the Shields or the safety factor.
        executor: any of `concurrent.futures` whose workers can import `incipient`, or "dask://HOST:PORT".
        tries: how often a case is begun whose worker or process dies, or that takes longer than its limit.
        limit: seconds, or text such as "2h", that a case may take, or "30x" its estimate; default: 20 times that.
        watcher: is notified of progress.

    Raises:
        IncipientError: on all ranks; what was computed before it is in the file.
    """
    comm = comm or (ranks_there_are() if executor is None else cast("Comm", Alone()))
    end = parsed_seconds(wall) if isinstance(wall, str) else wall or float("inf")
    if not end > 0:
        raise SceneError(f"--wall {wall}: is not a time; write it as 8h, 30m or 1h30m")
    own, factor = parsed_limit(limit)
    means, prepared = (
        Means(jobs, ranks, memory_mib, end, retry, executor, tries, own, factor),
        Prepared(),
    )
    with collectively(comm):
        if comm.rank == 0:
            table, refined = (
                None if cases is None else Path(cases),
                RefinementOptions(refine, most, quantity),
            )
            several = scenes if isinstance(scenes, list | tuple) else [scenes]
            sources, axes = [Source.of(one) for one in several], of_mapping(over or {})
            prepared = Prepared.of(requested(sources, axes, zip, table, do, settings, refined))
    return computed(prepared, Path(file), means, watcher, comm)


@dataclass(frozen=True)
class Prepared:
    """The cases of a request, the keys that they vary, and what finds cases in between."""

    cases: Sequence[SweepCase] = ()
    keys: Sequence[str] = ()
    refinement: SweepRefinement | None = None

    @classmethod
    def of(cls, request: Request, voice: Silent | None = None) -> Prepared:
        """Prepare the checked cases of a request; raises SceneError."""
        cases, keys = request.cases(voice)
        return cls(cases, keys, request.refinement(cases))


def computed(
    prepared: Prepared, file: Path, means: Means, watcher: Watcher | None, comm: Comm
) -> SweepProgress:
    """Compute cases, which the first rank alone needs to know, into a file. Collective; raises as `run`."""
    places = means.places(comm)
    if comm.size > 1:
        require_cores(comm)
    stores: list[Store] = []
    with collectively(comm):
        if comm.rank == 0:
            stores = [_opened(prepared, file, means)]
    if comm.size > 1 and comm.bcast(any(case.task != "judge" for case in prepared.cases)):
        # PETSc starts on all ranks together, also on the first, which computes no flow: the others would wait for it.
        with collectively(comm), required():
            from .. import compat  # noqa: F401
    limits = means.limits
    if comm.size > 1 and means.memory_mib is None:  # on several machines
        free = dict(comm.allgather((socket.gethostname(), free_memory_mib())))
        limits = replace(limits, memory_mib=sum(free.values()))
    with workers_of(comm, places, means.ranks, means.executor) as workers:
        if workers is None:
            return SweepProgress(0, 0, places)
        with stores[0] as store:
            further, expect = partial(_further, prepared, store, means), Foresight().of
            sweep = Sweep(
                prepared.cases, store, workers, expect, limits, watcher, further, means.ranks
            )
            progress = sweep.run()
    if prepared.refinement is not None:
        progress.refined = prepared.refinement.lines()
    return progress


def _further(prepared: Prepared, store: Store, means: Means) -> list[SweepCase]:
    """The cases that a refinement asks for by what the store holds, put there."""
    if prepared.refinement is None:
        return []
    cases = prepared.refinement.following(store.results)
    _put(store, cases, prepared.keys, means)
    return cases


def _opened(prepared: Prepared, file: Path, means: Means) -> Store:
    store = Store(file, make=True)
    if changed := store.mark_damaged():
        said = "cases were changed or damaged after they were written; those of this sweep are computed again"
        log.warning("%s: %d %s", file, changed, said)
    _put(store, prepared.cases, prepared.keys, means)
    store.free_abandoned()
    return store


def _put(store: Store, cases: Sequence[SweepCase], keys: Sequence[str], means: Means) -> None:
    store.add(cases, keys)
    if means.retry:
        store.free_failed([case.identity for case in cases])

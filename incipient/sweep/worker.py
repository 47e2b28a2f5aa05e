"""Dask's side of a sweep: clients of its workers, and the computation of a case in a worker process."""

from __future__ import annotations

import asyncio
import faulthandler
import json
import logging
import math
import os
import signal
import socket
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from importlib.metadata import version
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

from ..errors import IncipientError, MissingError, OutputError, SceneError, shortened
from ..files import plain
from ..input_files import reading
from ..installed import free_bytes, memory_of_libraries
from ..interrupt import handlers_kept
from ..parallel import (
    ONE_RANK,
    Comm,
    end_with_parent,
    leave_parallel_run,
    start_alone_quickly,
    world,
)
from ..results.kinds import ENTRAINMENT, GUSTS, JUDGEMENT, RUN, THRESHOLD, quantities_of
from ..results.si import SI
from ..results.timing import peak_memory_mib
from ..scene import Scene

START = 10.0  # seconds that a scheduler has to answer
FREE = 0.8  # of the free memory that the cases may take together
# Nothing is stored in workers. Memory that a case holds is ended by the nanny, not written to the disk.
_SETTINGS = {
    "distributed.scheduler.allowed-failures": 0,  # the sweep itself counts tries
    "distributed.scheduler.worker-ttl": None,  # PETSc keeps workers from answering while it solves
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    **{f"distributed.nanny.pre-spawn-environ.{name}": value for name, value in ONE_RANK.items()},
}
RELEASE = version("incipient")
# Kinds of results by task.
KINDS = {
    "run": RUN,
    "judge": JUDGEMENT,
    "threshold": THRESHOLD,
    "gust": GUSTS,
    "entrainment": ENTRAINMENT,
}
_ONE_CASE = threading.Lock()  # gmsh, PETSc and the watchdog have one state a process


# -- clients ---------------------------------------------------------------------------------------


def usual_jobs() -> int:
    """Number of cores, reduced if memory is insufficient for as many workers."""
    cores = len(os.sched_getaffinity(0))
    return max(1, int(min(cores, FREE * free_bytes() / 2**20 / memory_of_libraries())))


@contextmanager
def local_client(jobs: int, memory_mib: float | None) -> Iterator[Any]:
    """Client of new worker processes of this machine, one thread each, which end with the block.

    memory_mib: of each process; None: a fraction of the free memory. Raises OutputError if they do not start.
    """
    import dask
    from distributed import Client, LocalCluster

    leave_parallel_run()
    memory = FREE * free_bytes() / jobs if memory_mib is None else memory_mib * 2**20
    _silence("distributed", "tornado.application")
    with dask.config.set(_SETTINGS), ExitStack() as stack:
        # Keys pressed for this process are not for those that Dask's threads start; the tracker's start ends the mask.
        resource_tracker.ensure_running()
        try:
            with handlers_kept({signal.SIGINT}):
                cluster = LocalCluster(
                    n_workers=jobs,
                    threads_per_worker=1,
                    memory_limit=int(memory) if math.isfinite(memory) else 0,
                    host="127.0.0.1",
                    dashboard_address="127.0.0.1:0",
                    silence_logs=logging.CRITICAL,
                )
                stack.enter_context(cluster)
        except (OSError, RuntimeError, TimeoutError) as error:
            raise OutputError(
                f"no worker process starts: {shortened(error, 200)}; "
                "free memory or give fewer --jobs, and repeat the command to resume"
            ) from error
        yield stack.enter_context(Client(cluster, set_as_default=False))


@contextmanager
def client_of(scheduler: Any) -> Iterator[Any]:
    """Client of a scheduler: its address, its .json file, or a cluster object of Dask. Raises SceneError.

    Workers that still compute at the end of the block are restarted: Dask would continue their cases.
    """
    from distributed import Client

    _silence("tornado.application")
    try:
        target = _address(scheduler) if isinstance(scheduler, str) else scheduler
        if isinstance(target, str):
            with ThreadPoolExecutor(1) as aside:  # a notebook has a loop of its own here
                aside.submit(asyncio.run, _greet(target)).result()
        # A scheduler has ten minutes to come back.
        client = Client(target, timeout=600.0, set_as_default=False)
    except (OSError, ValueError) as error:
        why = shortened(error, 200) or f"{type(error).__name__} after {START:g} s"
        raise SceneError(
            f"{scheduler}: no scheduler answers ({why}); "
            "start `dask scheduler` there, or correct --scheduler, and repeat the command"
        ) from None
    try:
        yield client
    finally:
        with suppress(Exception):  # the scheduler may have gone
            mine = client.futures.keys()
            busy = [worker for worker, keys in client.processing().items() if mine & set(keys)]
            client.restart_workers(busy, timeout=10, raise_for_error=False)
        with suppress(Exception):
            client.close(timeout=5)


def _silence(*loggers: str) -> None:
    for name in loggers:
        logging.getLogger(name).setLevel(logging.CRITICAL)


async def _greet(address: str) -> None:
    """Test the connection: Dask's client waits for ever for a server that does not answer."""
    from distributed.core import connect

    comm = await asyncio.wait_for(connect(address, timeout=START), START)
    await comm.close()


def _address(scheduler: str) -> str:
    if not scheduler.endswith(".json"):
        return scheduler if "://" in scheduler else f"tcp://{scheduler}"
    with reading(Path(scheduler), "give the file of `dask scheduler`", 1):
        return str(json.loads(Path(scheduler).read_text(encoding="utf-8"))["address"])


def number_of_workers(client: Any) -> int:
    """Number of workers; zero while the scheduler does not answer."""
    with suppress(OSError, ValueError, RuntimeError):
        return len(client.nthreads())
    return 0


def exceeded_memory(client: Any, worker: str) -> bool:
    """Whether the nanny has ended a worker because of its memory."""
    with suppress(OSError, ValueError, RuntimeError):
        events = client.get_events("worker-restart-memory")
        return any(event.get("worker") == worker for _, event in events)
    return False


# -- cases -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class CaseOutcome:
    """Result of a case, or the reason for none, and its cost.

    result: JSON text, as in result.json; columns: quantities of the result for the table
    wall, cpu: seconds; peak_mib: largest memory of the process; log: traceback of an internal error
    """

    result: str | None = None
    columns: dict[str, Any] = field(default_factory=dict)
    reason: str = ""
    wall: float = 0.0
    cpu: float = 0.0
    peak_mib: float = 0.0
    versions: dict[str, str] = field(default_factory=dict)
    log: str = ""


def computed_within(limit: float, release: str, task: str, text: str) -> CaseOutcome:
    """Compute a case in this worker process, which ends itself after `limit` seconds.

    Raises MissingError: the version of the program differs from the sweep's.
    """
    if release != RELEASE:
        host = socket.gethostname()
        raise MissingError(
            f"the worker on {host} has incipient {RELEASE}, the sweep {release}; install that there"
        )
    # Warnings of a case are not written into the output of the sweep.
    logging.getLogger("incipient").addHandler(logging.NullHandler())
    with _ONE_CASE, Path(os.devnull).open("w") as nowhere:
        end_with_parent()
        # A thread of C: PETSc does not let Python's threads run while it solves.
        faulthandler.dump_traceback_later(limit, exit=True, file=nowhere)
        try:
            leave_parallel_run()
            start_alone_quickly()
            return computed(task, text)
        finally:
            faulthandler.cancel_dump_traceback_later()


def computed(task: str, text: str) -> CaseOutcome:
    """Compute a case; the message of a user's error becomes its reason."""
    began, processor = time.perf_counter(), _processor_time()
    # The kernel counts the largest memory from here on, not over all earlier cases.
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
    names = ("incipient", "numpy", "scipy") if task == "judge" else ("incipient", "numpy")
    result, reason, log = None, "", ""
    versions = {name: version(name) for name in names}
    try:
        result = plain(_result(task, text))
        versions = result.get("cost", {}).get("versions") or versions
    except IncipientError as error:
        reason = str(error)
    except Exception as error:
        log = traceback.format_exc()
        message = " ".join(f"{type(error).__name__}: {error}".split())
        reason = f"internal error, please report it: {message}"
    return CaseOutcome(
        None if result is None else json.dumps(result),
        {} if result is None else quantities(task, result),
        reason,
        time.perf_counter() - began,
        _processor_time() - processor,
        peak_memory_mib(),
        versions,
        log,
    )


def _result(task: str, text: str) -> dict[str, Any]:
    if task == "judge":
        from ..judging.case import Case, judge_case

        return judge_case(Case.model_validate(json.loads(text)))
    from ..accuracy.run import run_scene
    from ..setup.setup import Setup
    from ..thresholds import critical, entrainment, gusts

    compute: dict[str, Callable[[Scene, Comm], Any]] = {
        "run": run_scene,
        "gust": lambda scene, comm: gusts.GustSearch(scene, comm).of_scene(),
        "threshold": critical.find_threshold,
        "entrainment": lambda scene, comm: entrainment.find_entrainment(Setup(scene), comm),
    }
    result: dict[str, Any] = compute[task](
        Scene.model_validate(json.loads(text)), world()
    ).to_dict()
    return result


def quantities(task: str, result: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers and words of the result of a case, error bars under NAME_low and NAME_high."""
    columns = dict[str, Any]()
    for quantity in (*quantities_of(KINDS[task], result), *SI):
        columns |= quantity.columns(result)
    return columns


def _processor_time() -> float:
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system

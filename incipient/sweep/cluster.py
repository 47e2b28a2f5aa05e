"""Clients of Dask: for a cluster of processes on this machine, or for a running scheduler."""

from __future__ import annotations

import asyncio
import json
import logging
import math
import os
import signal
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

from ..errors import OutputError, shortened
from ..input_files import reading
from ..installed import free_bytes, memory_of_libraries
from ..parallel import ONE_RANK, leave_parallel_run

START = 10.0  # seconds that a scheduler has to answer
PATIENCE = 600.0  # seconds that a scheduler has to come back
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
    with dask.config.set(_SETTINGS):
        # Keys pressed for this process are not for those that Dask's threads start; the tracker's start ends the mask.
        resource_tracker.ensure_running()
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            cluster = LocalCluster(
                n_workers=jobs,
                threads_per_worker=1,
                memory_limit=int(memory) if math.isfinite(memory) else 0,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            )
        except (OSError, RuntimeError, TimeoutError) as error:
            remedy = "free memory or give fewer --jobs, and repeat the command to resume"
            raise OutputError(
                f"no worker process starts: {shortened(error, 200)}; {remedy}"
            ) from error
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        with cluster, Client(cluster, set_as_default=False) as client:
            yield client


@contextmanager
def client_of(scheduler: Any) -> Iterator[Any]:
    """Client of a scheduler: its address, its .json file, or a cluster object of Dask. Raises OutputError.

    Workers that still compute at the end of the block are restarted: Dask would continue their cases.
    """
    from distributed import Client

    _silence("tornado.application")
    try:
        target = _address(scheduler) if isinstance(scheduler, str) else scheduler
        if isinstance(target, str):
            with ThreadPoolExecutor(1) as aside:  # a notebook has a loop of its own here
                aside.submit(asyncio.run, _greet(target)).result()
        client = Client(target, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        why = shortened(error, 200) or f"{type(error).__name__} after {START:g} s"
        remedy = "start `dask scheduler` there, or correct --scheduler, and repeat the command"
        raise OutputError(f"{scheduler}: no scheduler answers ({why}); {remedy}") from None
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
    with reading(Path(scheduler), "give the file of `dask scheduler`", 1, OutputError):
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

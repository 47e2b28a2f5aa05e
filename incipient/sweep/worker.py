"""Computation of cases by a process below a worker (`case_process`), or by a group of ranks by `mpi4py.futures`.

The process computes one case after the other: orders come as lines of JSON on the standard input of the first rank,
outcomes go to its standard output, after a line that says that it is there; what the libraries print goes to the
standard error. It ends when there are no more orders, or none have come for long.
"""

from __future__ import annotations

import json
import logging
import os
import select
import socket
import sys
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from ..errors import IncipientError
from ..files import plain
from ..parallel import Comm, ranks_there_are, start_alone_quickly
from ..results.timing import peak_memory_mib
from ..scene import loads
from .case_process import IDLE, READY, end_with_parent
from .expectation import cores
from .store import CaseOutcome

# The group that this rank leads; mpi4py.futures hands no communicator to its tasks.
_LED: list[Comm] = []


@contextmanager
def leading(group: Comm) -> Iterator[None]:
    """Let this rank compute the cases ordered in the block with a group, whose other ranks `follow`. Collective.

    Args:
        group: with this rank as the first; the null communicator for a rank that computes none.
    """
    if not group:
        yield
        return
    _LED.append(group)
    try:
        yield
    finally:
        _LED.remove(group)
        group.bcast(None)


def follow(group: Comm) -> None:
    """Compute cases with the first rank of a group until it orders no more. Collective."""
    while group and (order := group.bcast(None)) is not None:
        task, text = order
        computed(task, text, group)


def computed_by_group(task: str, text: str) -> CaseOutcome:
    """Compute a case with the group that this rank leads; a defect on several ranks ends them all. Collective."""
    (group,) = _LED
    group.bcast((task, text))
    try:
        return computed(task, text, group)
    except Exception:
        traceback.print_exc()
        group.Abort(1)


def computed(task: str, text: str, comm: Comm) -> CaseOutcome:
    """Compute a case; one that fails with an error for users has its line as the reason. Collective."""
    began, processor = time.perf_counter(), _processor_time()
    # The kernel counts the largest memory from here, or it is that of all cases so far.
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
    names = ("incipient", "numpy", "scipy") if task == "judge" else ("incipient", "numpy")
    result, reason, versions = None, "", {name: version(name) for name in names}
    with _logged() as said:
        said.append(_where(comm))
        try:
            result = plain(_TASKS[task](text, comm))
            versions = result.get("cost", {}).get("versions") or versions
        except IncipientError as error:
            reason = str(error)
        except Exception as error:
            if comm.size > 1:  # the other ranks may wait for this one
                raise
            said.append(traceback.format_exc())
            reason = (
                f"a defect of the program: {' '.join(f'{type(error).__name__}: {error}'.split())}"
            )
    spent, peak = (
        sum(comm.allgather(one)) for one in (_processor_time() - processor, peak_memory_mib())
    )
    text = "\n".join([*said, ""])
    return CaseOutcome(result, reason, time.perf_counter() - began, spent, peak, versions, text)


def _where(comm: Comm) -> str:
    """Machines, process, ranks, threads and cores of this case. Collective."""
    hosts = " ".join(dict.fromkeys(comm.allgather(socket.gethostname())))
    threads = os.environ.get("OMP_NUM_THREADS", "not limited")
    return f"host {hosts}, process {os.getpid()}, ranks {comm.size}, threads {threads}, cores {cores()}"


@contextmanager
def _logged() -> Iterator[list[str]]:
    """Gather what the program logs in the block."""
    said: list[str] = []
    handler, log = logging.Handler(logging.INFO), logging.getLogger("incipient")
    handler.emit = lambda record: said.append(record.getMessage())  # type: ignore[method-assign]
    level = log.level
    log.addHandler(handler)
    log.setLevel(min(logging.INFO, log.getEffectiveLevel()))
    try:
        yield said
    finally:
        log.removeHandler(handler)
        log.setLevel(level)


def _run(text: str, comm: Comm) -> dict[str, Any]:
    from ..accuracy.run import run_scene

    return run_scene(loads(text), comm).to_dict()


def _searched(what: str, text: str, comm: Comm) -> dict[str, Any]:
    from ..critical import gusts, threshold

    if what == "entrainment":
        from ..entrainment.find import find_entrainment
        from ..planning.flow_setup import Setup

        return find_entrainment(Setup(loads(text)), comm).to_dict()
    if what == "gust":
        return gusts.GustSearch(loads(text), comm).of_scene().to_dict()
    return threshold.find_threshold(loads(text), comm).to_dict()


def _judge(text: str, comm: Comm) -> dict[str, Any]:
    from ..simulation.judge_case import Case, judge_case

    return judge_case(Case.model_validate(json.loads(text)))


_TASKS = {"run": _run, "judge": _judge} | {
    one: partial(_searched, one) for one in ("threshold", "gust", "entrainment")
}


def _processor_time() -> float:
    """Processor time [s] of this process and of compilers that it has started."""
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def main() -> None:
    """Compute what is ordered."""
    end_with_parent()
    start_alone_quickly()
    comm = ranks_there_are()
    answers = os.dup(1)
    os.dup2(2, 1)
    with os.fdopen(answers, "w") as stream:
        if comm.rank == 0:
            print(READY, file=stream, end="", flush=True)
        while line := comm.bcast(_order() if comm.rank == 0 else ""):
            task, text = json.loads(line)
            outcome = computed(task, text, comm)
            if comm.rank == 0:
                print(json.dumps(asdict(outcome)), file=stream, flush=True)


def _order() -> str:
    """The next order; empty where there are no more, or none has come for long: the sweep may be at an end."""
    return sys.stdin.readline() if select.select([sys.stdin], [], [], IDLE)[0] else ""

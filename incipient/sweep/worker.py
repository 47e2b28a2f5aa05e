"""The computation of one case in a worker process of Dask."""

from __future__ import annotations

import faulthandler
import json
import logging
import os
import socket
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

from ..effects import known
from ..errors import IncipientError, MissingError
from ..files import plain
from ..parallel import Comm, end_with_parent, leave_parallel_run, start_alone_quickly, world
from ..results.kinds import ENTRAINMENT, GUSTS, THRESHOLD, quantities_of
from ..results.si import SI
from ..results.timing import peak_memory_mib
from ..scene import Scene

RELEASE = version("incipient")
_KINDS = {"threshold": THRESHOLD, "gust": GUSTS, "entrainment": ENTRAINMENT}
_ONE_CASE = threading.Lock()  # gmsh, PETSc and the watchdog have one state a process


@dataclass(frozen=True)
class CaseOutcome:
    """Result of a case, or the reason for none, and its cost.

    result: JSON text, as in result.json; columns: quantities of the result for the table
    wall, cpu: seconds; peak_mib: largest memory of the process
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
    result, reason, versions = None, "", {name: version(name) for name in names}
    with _logged() as lines:
        lines.append(f"host {socket.gethostname()}, process {os.getpid()}")
        try:
            result = plain(_result(task, text))
            versions = result.get("cost", {}).get("versions") or versions
        except IncipientError as error:
            reason = str(error)
        except Exception as error:
            lines.append(traceback.format_exc())
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
        "\n".join([*lines, ""]),
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
    kind, columns = _KINDS.get(task), dict[str, Any]()
    # The verdict first.
    of_run = sorted(
        known.quantities(), key=lambda quantity: not quantity.key.startswith("verdict.")
    )
    for quantity in of_run if kind is None else quantities_of(kind, result):
        columns |= quantity.columns(result)
    for quantity in SI:
        columns |= quantity.columns(result)
    return columns


@contextmanager
def _logged() -> Iterator[list[str]]:
    lines: list[str] = []
    handler, log = logging.Handler(logging.INFO), logging.getLogger("incipient")
    handler.emit = lambda record: lines.append(record.getMessage())  # type: ignore[method-assign]
    level = log.level
    log.addHandler(handler)
    log.setLevel(min(logging.INFO, log.getEffectiveLevel()))
    try:
        yield lines
    finally:
        log.removeHandler(handler)
        log.setLevel(level)


def _processor_time() -> float:
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system

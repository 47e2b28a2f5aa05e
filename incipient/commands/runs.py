"""`incipient run`, `resume`, `threshold`, `gust` and `entrainment`."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import incipient

from ..parallel import Comm, on_first
from ..progress import telling
from ..results.kinds import ENTRAINMENT, GUSTS, THRESHOLD, ResultKind
from ..results.result import Result
from .options import require_left_by
from .showing import tell_of_pictures

log = logging.getLogger("incipient")


def run(options: argparse.Namespace, comm: Comm) -> int:
    """Simulate a scene; print the result and its directory."""
    scene = incipient.load(options.scene, options.overrides, comm)
    directory = options.out or Path("results") / options.scene.stem
    ranks = f"{comm.size} rank" + ("s" if comm.size > 1 else "")
    plan = incipient.make_plan(scene)
    lines = (
        [plan.text()] if options.verbose else [f"  warning: {warning}" for warning in plan.warnings]
    )
    if comm.rank == 0:
        head = f"{scene.title or options.scene.stem} on {ranks}"
        log.info("%s", "\n".join([head, *lines]))
    with telling(comm.rank) as voice:
        result = incipient.run(scene, directory, comm, voice, options.overwrite)
    _tell(result, directory, comm, options.verbose)
    return 0


def resume(options: argparse.Namespace, comm: Comm) -> int:
    """Continue an interrupted run."""
    on_first(comm, require_left_by, options.directory, ("scene.toml",))
    with telling(comm.rank) as voice:
        result = incipient.resume(options.directory, options.overrides, comm, voice)
    _tell(result, options.directory, comm, options.verbose)
    return 0


def threshold(options: argparse.Namespace, comm: Comm) -> int:
    """Search the critical flow of the grain."""
    return _search(options, comm, THRESHOLD, incipient.threshold)


def gust(options: argparse.Namespace, comm: Comm) -> int:
    """Search the weakest gusts that move the grain out of its pocket."""
    return _search(options, comm, GUSTS, incipient.gusts, durations=options.durations)


def entrainment(options: argparse.Namespace, comm: Comm) -> int:
    """Compute the probability of motion in a fluctuating flow."""
    wanted = {
        name: getattr(options, name) for name in ("probabilities", "strengths", "gusts", "data")
    }
    return _search(options, comm, ENTRAINMENT, incipient.entrainment, **wanted)


def _search(
    options: argparse.Namespace,
    comm: Comm,
    kind: ResultKind,
    find: Callable[..., Any],
    **wanted: Any,
) -> int:
    scene = incipient.load(options.scene, options.overrides, comm)
    directory = options.out or Path("results") / f"{options.scene.stem}_{kind.name}"
    with telling(comm.rank) as voice:
        result = find(scene, directory=directory, comm=comm, voice=voice, **wanted)
    if comm.rank == 0:
        print(result.text())
        print(f"numbers             {directory / (kind.tables or (kind.record,))[0]}", flush=True)
    tell_of_pictures(directory, scene.output.pictures, comm)
    return 0


def _tell(result: Result, directory: Path, comm: Comm, details: bool) -> None:
    output, cost = result.scene["output"], result.cost
    if comm.rank == 0:
        print(result.text(details))
        print(f"verdict and numbers {directory / 'result.json'}")
        if output["fields"]:
            print(f"for ParaView        {directory / 'fields.xdmf'}")
        spent = f"{cost['wall_time']['total']:.2f} s, {cost['unknowns']} unknowns"
        print(f"cost                {spent}, {cost['peak_memory_mib']:.0f} MiB", flush=True)
    tell_of_pictures(directory, output["pictures"], comm)

"""`incipient run`, `incipient resume` and `incipient threshold`."""

from __future__ import annotations

import argparse
import logging
from pathlib import Path

import incipient

from ..parallel import Comm
from ..progress import telling
from ..results.result import Result
from .drawing import tell_of_pictures
from .options import require_left_by

log = logging.getLogger("incipient")


def run(options: argparse.Namespace, comm: Comm) -> int:
    """Simulates a scene, says what came out and where it is."""
    scene = incipient.load(options.scene, options.overrides, comm)
    directory = options.out or Path("results") / options.scene.stem
    ranks = f"{comm.size} rank" + ("s" if comm.size > 1 else "")
    plan = incipient.make_plan(scene).text()
    if comm.rank == 0:
        log.info("%s on %s\n%s", scene.title or options.scene.stem, ranks, plan)
    with telling(comm.rank) as voice:
        result = incipient.run(scene, directory, comm, voice, options.overwrite)
    _tell(result, directory, comm, options.verbose)
    return 0


def resume(options: argparse.Namespace, comm: Comm) -> int:
    """Continues a run that was cut short."""
    require_left_by(options.directory, ("scene.toml",), comm)
    with telling(comm.rank) as voice:
        result = incipient.resume(options.directory, options.overrides, comm, voice)
    _tell(result, options.directory, comm, options.verbose)
    return 0


def threshold(options: argparse.Namespace, comm: Comm) -> int:
    """Searches the flow at which the grain begins to move."""
    scene = incipient.load(options.scene, options.overrides, comm)
    directory = options.out or Path("results") / f"{options.scene.stem}_threshold"
    with telling(comm.rank) as voice:
        threshold = incipient.threshold(scene, directory, comm, voice)
    if comm.rank == 0:
        print(threshold.text())
        print(f"numbers             {directory / 'threshold.json'}", flush=True)
    tell_of_pictures(directory, scene.output.pictures, comm)
    return 0


def _tell(result: Result, directory: Path, comm: Comm, details: bool) -> None:
    """Say what came out and where it is; then draw the pictures if the scene wants some."""
    output, cost = result.scene["output"], result.cost
    if comm.rank == 0:
        print(result.text(details))
        print(f"verdict and numbers {directory / 'result.json'}")
        if output["fields"]:
            print(f"for ParaView        {directory / 'fields.xdmf'}")
        spent = f"{cost['wall_time']['total']:.2f} s, {cost['unknowns']} unknowns"
        print(f"cost                {spent}, {cost['peak_memory_mib']:.0f} MiB", flush=True)
    tell_of_pictures(directory, output["pictures"], comm)

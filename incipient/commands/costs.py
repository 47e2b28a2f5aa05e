"""`incipient plan`, `incipient cost` and `incipient calibrate`: what a run takes."""

from __future__ import annotations

import argparse
import json
import logging
from pathlib import Path

import incipient

from ..cost import command as cost_command
from ..output.lock import locked
from ..parallel import Comm, collectively
from .drawing import tell_of_pictures
from .options import alone


def plan(options: argparse.Namespace, comm: Comm) -> int:
    """Says what would be computed, and what it takes."""
    scene = incipient.load(options.scene, options.overrides, comm)
    with collectively(comm):
        if comm.rank == 0:
            found = cost_command.predicted_plan(scene, options.study)
            print(json.dumps(found.to_dict(), indent=2) if options.json else found.text())
    return 0


def cost(options: argparse.Namespace, comm: Comm) -> int:
    """Measures error against time by runs of the scene."""
    alone("cost", comm)
    scene = incipient.load(options.scene, options.overrides, comm)
    directory = options.out or Path("results") / f"{options.scene.stem}_cost"
    lists = {name: getattr(options, name) for name in ("orders", "sizes", "steps", "solvers")}
    spread = cost_command.chosen(scene, options.quick, **lists)
    with locked(directory, comm, make=True):
        found = cost_command.study(scene, directory, spread, logging.getLogger("incipient").info)
    print(cost_command.summary(found, directory), flush=True)
    tell_of_pictures(directory, True, comm)
    return 0


def calibrate(options: argparse.Namespace, comm: Comm) -> int:
    """Measures this machine."""
    alone("calibrate", comm)
    print(cost_command.calibrate(logging.getLogger("incipient").info))
    return 0

"""`incipient plan` and `incipient cost`."""

from __future__ import annotations

import argparse
import json
import logging
from pathlib import Path

import incipient

from ..accuracy.errorbars import coarse_scenes
from ..accuracy.first_mesh import planned
from ..cost.ladder import ladder
from ..cost.measurement import measure
from ..cost.study import run_ladder
from ..errors import SceneError
from ..files import plain
from ..output.ownership import locked
from ..parallel import Comm, collectively
from ..planning.discretisation import order_of
from ..scene import Scene
from .drawing import tell_of_pictures


def plan(options: argparse.Namespace, comm: Comm) -> int:
    """Print the plan of a run with its cost."""
    scene = incipient.load(options.scene, options.overrides, comm)
    with collectively(comm):
        if comm.rank == 0:
            estimate = planned(scene)
            if options.json:
                print(json.dumps(plain(estimate.to_dict()), indent=2))
            else:
                print("\n".join([estimate.text(), *_further_runs(scene)]))
    return 0


def _further_runs(scene: Scene) -> list[str]:
    wanted = scene.numerics.error_bars and scene.numerics.accuracy is None
    if not wanted or scene.body is not None or not scene.has_surface:
        return []
    runs = [(order_of(run), run.time) for run in coarse_scenes(scene)]
    named = ", ".join(f"P{k}-P{k - 1} in steps of {time.step:.3g}" for k, time in runs if time)
    said = f"  error bars take {len(runs)} more runs of the same duration ({named})"
    return [f"{said}; numerics.error_bars = false leaves them out"]


def cost(options: argparse.Namespace, comm: Comm) -> int:
    """Measure error against CPU time in runs of the scene."""
    if comm.size > 1:
        raise SceneError("cost starts processes of its own; call it without mpirun")
    scene = incipient.load(options.scene, options.overrides, comm)
    ending = "_cost" if options.do == "run" else f"_{options.do}_cost"
    directory = options.out or Path("results") / f"{options.scene.stem}{ending}"
    rungs = ladder(scene, options.quick, options.orders, options.sizes, options.steps)
    say = logging.getLogger("incipient").info
    with locked(directory, comm, make=True):
        study = run_ladder(scene, rungs, directory, measure, say, options.do)
    print(study.text())
    print(f"numbers: {directory}/cost.csv, cost.json", flush=True)
    tell_of_pictures(directory, True, comm)
    return 0

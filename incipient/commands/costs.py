"""`incipient plan` and `incipient cost`."""

from __future__ import annotations

import argparse
import json
import logging
from collections.abc import Sequence
from pathlib import Path

import incipient

from ..accuracy.errorbars import coarse_scenes
from ..accuracy.first_mesh import planned
from ..cost.frontier import seconds
from ..cost.ladder import ladder
from ..cost.measurement import measure
from ..cost.study import run_ladder
from ..errors import SceneError
from ..files import plain
from ..output.ownership import locked
from ..parallel import Comm, collectively
from ..planning.flow_setup import order_of
from ..scene import Scene
from .drawing import tell_of_pictures
from .options import alone


def plan(options: argparse.Namespace, comm: Comm) -> int:
    """Print the plan of a run with its cost."""
    scene = incipient.load(options.scene, options.overrides, comm)
    with collectively(comm):
        if comm.rank == 0:
            estimate = planned(scene)
            if options.json:
                print(json.dumps(plain(estimate.to_dict()), indent=2))
            else:
                spent = _spent_before(Path("results") / options.scene.stem)
                print("\n".join([estimate.text(), *spent, *_further_runs(scene)]))
    return 0


def _spent_before(directory: Path) -> list[str]:
    try:
        cost = json.loads((directory / "result.json").read_text(encoding="utf-8"))["cost"]
        taken, ranks = seconds(cost["wall_time"]["total"]), cost["ranks"]
        where = f"{cost['unknowns']} unknowns on {ranks} rank{'s' * (ranks > 1)}"
    except (OSError, ValueError, KeyError, TypeError):
        return []
    return [f"  the run in {directory} took {taken} of wall time for {where}"]


def _further_runs(scene: Scene) -> list[str]:
    wanted = scene.numerics.error_bars and scene.numerics.accuracy is None
    if not wanted or scene.body is not None or not scene.has_surface:
        return []
    runs = [(order_of(run).number, run.time) for run in coarse_scenes(scene)]
    named = ", ".join(f"P{k}-P{k - 1} in steps of {time.step:.3g}" for k, time in runs if time)
    said = f"  error bars take {len(runs)} more runs to the same end ({named})"
    return [f"{said}; numerics.error_bars = false leaves them out"]


def cost(options: argparse.Namespace, comm: Comm) -> int:
    """Measure error against CPU time in runs of the scene."""
    alone("cost", comm)
    scene = incipient.load(options.scene, options.overrides, comm)
    ending = "_cost" if options.do == "run" else f"_{options.do}_cost"
    directory = options.out or Path("results") / f"{options.scene.stem}{ending}"
    exact = _exact(options.exact)
    rungs = ladder(scene, options.quick, options.orders, options.sizes, options.steps)
    say = logging.getLogger("incipient").info
    with locked(directory, comm, make=True):
        study = run_ladder(scene, rungs, directory, measure, say, options.do, exact)
    print(study.text())
    print(f"numbers: {directory}/cost.csv, cost.json", flush=True)
    tell_of_pictures(directory, True, comm)
    return 0


def _exact(settings: Sequence[str]) -> dict[str, float]:
    """Exact values by name, from settings such as force_x=9.4. Raises SceneError."""
    try:
        return {name: float(value) for name, value in (text.split("=") for text in settings)}
    except ValueError as error:
        raise SceneError(f"--exact {' '.join(settings)}: give NAME=VALUE ...") from error

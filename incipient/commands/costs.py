"""`incipient plan` and `incipient cost`."""

from __future__ import annotations

import argparse
import json
import logging
import os
from contextlib import suppress
from pathlib import Path
from typing import Any

import incipient

from ..accuracy.errorbars import coarse_scenes
from ..accuracy.first_mesh import planned
from ..cost.frontier import seconds
from ..errors import SceneError
from ..files import plain
from ..output.ownership import locked
from ..parallel import Comm, collectively
from ..planning.discretisation import order_of
from ..planning.plan import Plan
from ..scene import Scene
from .showing import tell_of_pictures

# Results that a plan reads for its time, and the largest ratio of sizes over which times are scaled.
NEWEST, RANGE = 50, 10.0


def plan(options: argparse.Namespace, comm: Comm) -> int:
    """Print the plan of a run with its cost."""
    scene = incipient.load(options.scene, options.overrides, comm)
    with collectively(comm):
        if comm.rank == 0:
            estimate = planned(scene)
            if options.json:
                print(json.dumps(plain(estimate.to_dict()), indent=2))
            else:
                time = _expected_time(estimate, scene, comm.size)
                print("\n".join([estimate.text(), *time, *_further_runs(scene)]))
    return 0


def _expected_time(plan: Plan, scene: Scene, ranks: int) -> list[str]:
    """The wall time of the last run of the same kind in the results directory, scaled to this one's size, as a line."""
    if plan.estimate is None:
        return []
    own = _work(plain(plan.to_dict()), scene.model_dump(mode="json"))
    runs = list[Path]()
    with suppress(OSError):  # a result is removed meanwhile
        runs = sorted(Path("results").glob("*/result.json"), key=os.path.getmtime)[-NEWEST:]
    for path in reversed(runs):
        with suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
            run = json.loads(path.read_text(encoding="utf-8"))
            kind, size = _work(run["plan"], run["scene"], run["cost"]["unknowns"])
            alike = kind == own[0] and run["cost"]["ranks"] == ranks
            if alike and 1 / RANGE <= own[1] / size <= RANGE:
                time = seconds(run["cost"]["wall_time"]["total"] * own[1] / size)
                return [f"  about {time} of wall time, scaled from {path.parent}"]
    return []


def _work(
    plan: dict[str, Any], scene: dict[str, Any], unknowns: int = 0
) -> tuple[list[Any], float]:
    time, numerics, turbulence = scene["time"], scene["numerics"], scene["turbulence"]
    kind = [plan[key] for key in ("scheme", "order", "convection")]
    kind += [
        plan["solver"]["name"],
        numerics["error_bars"],
        turbulence and turbulence["model"],
        scene["domain"]["width"] is None,
    ]
    steps = time["end"] / time["step"] if time else 1.0
    return kind, steps * (unknowns or plan["estimate"]["unknowns"])


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
    # `plan` needs none of these, which take long to import.
    from ..cost.ladder import ladder
    from ..cost.measurement import measure
    from ..cost.study import run_ladder

    if comm.size > 1:
        raise SceneError("cost starts processes of its own; call it without mpirun")
    scene = incipient.load(options.scene, options.overrides, comm)
    if options.do == "threshold":
        from ..thresholds.critical import refuse_unsuitable

        refuse_unsuitable(scene)
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

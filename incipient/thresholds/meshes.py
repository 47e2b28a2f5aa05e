"""Meshes of the search for a critical flow: refined to an accuracy, or made for the walls.

Boundary layers of faster flows are thinner: turbulent searches repeat on meshes for the last critical flow until wall
cells agree to a tenth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ..accuracy.first_mesh import Attempt
from ..accuracy.goal import Goal
from ..accuracy.search import Estimate
from ..accuracy.searches import DualWeighted
from ..errors import ConvergenceError, SceneError, refuse_broken
from ..parallel import Comm
from ..progress import Silent
from ..results.accuracy import Adaptation
from ..results.errorbars import Loads
from ..scene import Scene
from ..setup.setup import Setup
from ..simulation.build import prepared
from ..simulation.state import Accounts, Recorder, Run
from .outcome import Threshold
from .path import flow_of
from .search import CriticalFlow, CriticalSearch, OwnMesh

MOST_MESHES = 6
OTHER_MESH = "all on the mesh of the scene's flow, whose wall cells are too large for these"


def to_accuracy(
    scene: Scene,
    comm: Comm,
    voice: Silent,
    conclude: Callable[[Run, CriticalSearch, CriticalFlow, Adaptation], Threshold],
) -> Threshold:
    """Find the threshold to an accuracy, concluded on the last mesh. Collective.

    Raises SceneError for an invalid accuracy of thresholds.
    """
    refuse_broken(
        (
            scene.numerics.accuracy == "verdict",
            'numerics.accuracy: "verdict" does not apply to thresholds; give a relative error of the critical flow '
            "such as 0.01",
        ),
        (
            scene.numerics.accuracy_includes == "all",
            'numerics.accuracy_includes: "all" is for runs; leave it out, and see the error bars of the threshold',
        ),
    )
    search = _ThresholdSearch(scene, comm, Recorder(), voice)
    search.outcome = conclude
    result: Threshold = search.result()
    return result


class _ThresholdSearch(DualWeighted):
    outcome: Callable[..., Any]  # of the last mesh
    _critical: CriticalSearch
    _flow: CriticalFlow | None = None

    def solve(self, run: Run) -> Loads:
        self._critical = CriticalSearch(run)
        before, search = self._flow, self._critical
        flow = self._flow = search.near(before) if before else search.from_rest()
        if flow.rocking is not None:
            raise SceneError(
                "numerics.accuracy: the grain rocks before it leaves its pocket, and this has no error bar; "
                "leave it out"
            )
        if flow.is_critical:
            power = flow.path.steepness(flow.factor)
            self.speed = flow.factor
            self.goal = Goal("critical flow", run.scene, run.contacts, power)
        return Loads(self._critical.at_nearest(flow.factor))

    def following(self, attempt: Attempt, run: Run, estimate: Estimate) -> Attempt | None:
        if self._flow is not None and self._flow.is_critical:
            return super().following(attempt, run, estimate)
        self.reason = "there is no critical flow whose error could be made smaller"
        return None

    def concluded(self, run: Run) -> Any:
        return self.outcome(run, self._critical, self._flow, self.adaptation())


def on_its_own_mesh(
    scene: Scene,
    comm: Comm,
    voice: Silent,
    conclude: Callable[[Run, CriticalSearch, CriticalFlow], Threshold],
) -> Threshold:
    """Find the threshold on a mesh for its walls. Collective.

    Raises ConvergenceError if meshes do not converge, or without a critical flow near the previous one.
    """
    accounts, setup, speeds = Accounts(), Setup(scene), [1.0]
    flow: CriticalFlow | None = None
    while True:
        speed, is_own = speeds[-1], flow is not None and not outgrown(setup, *speeds[-2:])
        if len(speeds) > MOST_MESHES and not is_own:
            factors = ", ".join(f"{factor:.4g}" for factor in speeds[1:])
            raise ConvergenceError(
                f"the critical flow does not converge over meshes made for its walls: it is {factors} times the "
                "scene's; use a smaller numerics.mesh_size"
            )
        with prepared(scene, comm, accounts, voice=voice, speed=speed) as run:
            search = CriticalSearch(run)
            if flow is not None and is_own:
                return conclude(run, search, replace(flow, own_mesh=_on_own_mesh(search, flow)))
            voice.say(f"mesh for the walls of flow x {speed:.4g}")
            if flow is None:
                flow = search.from_rest()
            else:
                before, flow = flow, search.near(flow)
                trials, unsolved = before.trials + flow.trials, before.unsolved + flow.unsolved
                flow = replace(flow, trials=trials, unsolved=unsolved)
            if not flow.is_critical:
                fastest = max((trial.factor for trial in flow.trials), default=1.0)
                if fastest > 1.0 and outgrown(setup, 1.0, fastest):
                    flow = replace(flow, reason=f"{flow.reason}; {OTHER_MESH}")
                return conclude(run, search, flow)
        speeds.append(flow.factor)


def _on_own_mesh(search: CriticalSearch, flow: CriticalFlow) -> OwnMesh:
    try:
        load = search.load_at(flow.factor)
    except ConvergenceError as error:
        raise ConvergenceError(
            f"{error}; the critical flow was {flow.factor:.4g} times the scene's"
        ) from error
    if flow.rocking is not None:
        search.rocks(flow.factor)
    return OwnMesh(abs(flow_of(load) - flow_of(flow.load)), search.trials[-1].safety_factor)


def outgrown(setup: Setup, made_for: float, factor: float) -> bool:
    """Whether a mesh made for one flow is unsuitable for another; both are factors of the scene's."""
    ratio = setup.faster(made_for).walls.nearest / setup.faster(factor).walls.nearest
    return max(ratio, 1.0 / ratio) > 1.1

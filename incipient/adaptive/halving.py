"""Flow in time to a given accuracy: mesh and steps are made finer together until two runs differ little enough.

Each run has cells smaller by the square root of two, and steps half as long, compared with the one before, which is
the coarser run of its error bar (`errorbars.by_coarser_run`). The first is a few such levels coarser than the scene
says. The run that is expected to reach the accuracy is recorded; it is repeated finer if it does not.
"""

from __future__ import annotations

from typing import cast

from ..accuracy.errorbars import COARSER_MESH, LONGER_STEP, by_coarser_run, changed, coarser
from ..results.adaptation import Trial
from ..results.errorbars import Loads
from ..results.result import Result
from ..scene import Scene
from ..simulation.recorder import Recorder, Unrecorded
from ..simulation.simulate import simulate
from ..simulation.state import Accounts
from .search import Search, Told

LEVELS_BELOW = 3  # that the first run is coarser than the scene says
FEWEST_STEPS = 8
MOST_RUNS = 6
COST = 4.0  # of a run relative to that before: twice the cells, twice the steps


class Halving(Search):
    """From run to run, each with finer mesh and shorter steps."""

    def result(self) -> Result:
        """Run until the accuracy is reached or cannot be. Collective."""
        scene = first(self.scene)
        while True:
            recorded = self._may_be_last()
            told = self._run(scene, recorded)
            if self.reason:
                return told.result if recorded else self._run(scene, recorded=True, again=True).result
            scene = finer(scene)
            # It is the coarser run of the next one's error bar.
            self.known = {coarser(scene).model_dump_json(): Loads.of(told.result)}
            self.keep_model_terms()

    def _may_be_last(self) -> bool:
        """Whether the next run may reach the accuracy, or none after it is affordable. Collective."""
        if not self.trials or self.trials[-1].estimate is None:
            return bool(self.trials)
        last, order = self.trials[-1], 2 if self.scene.time and self.scene.time.scheme == "bdf2" else 1
        seconds = (COST + COST**2) * last.seconds
        expected = cast(float, last.estimate) / LONGER_STEP**order
        return expected <= self.asked or bool(self.beyond_budget(seconds, COST * last.unknowns))

    def _why_not_another(self) -> str:
        last = self.trials[-1]
        if len(self.trials) >= MOST_RUNS:
            return f"not reached with {MOST_RUNS} runs"
        return self.beyond_budget(COST * last.seconds, LONGER_STEP * last.unknowns)

    def _run(self, scene: Scene, recorded: bool, again: bool = False) -> Told:
        """Run a scene, estimate its error from the run before, and decide whether it is the last. Collective."""
        began = self.elapsed()

        def judge(result: Result) -> None:
            """Compare with the run before, if this one is new and got to its end."""
            if result.status == "complete" and not again:
                self._judge(scene, result, self.elapsed() - began)

        told = Told(self.recorder if recorded else Unrecorded(), scene, self.adaptation_beside, judge)
        quiet = scene if recorded else changed(scene, numerics={"error_bars": False})
        accounts = Accounts(known=self.known, spent=self.spent)
        simulate(quiet, self.comm, cast(Recorder, told), self.voice, accounts=accounts)
        return told

    def _judge(self, scene: Scene, result: Result, seconds: float) -> None:
        estimate, time = None, scene.time
        compared = coarser(scene).model_dump_json() in self.known
        if compared and result.force is not None and result.couple is not None:
            term = by_coarser_run(scene, Loads.of(result), self._known_run)
            estimate = self.goal.error(result.force, result.couple, term.force, term.couple)
        cost = result.cost
        step = time.step if time is not None else None
        self.tell(Trial(result.plan.order, cost["cells"], cost["unknowns"], estimate, seconds, step))
        if estimate is not None and estimate <= self.asked:
            self.conclude(estimate)
        else:
            self.reason = self._why_not_another()

    def _known_run(self, scene: Scene) -> Loads:
        return cast(Loads, self.known[scene.model_dump_json()])


def first(scene: Scene) -> Scene:
    """The scene in time as coarse as the first run: some levels below it, with a few steps at least."""
    assert scene.time is not None
    found, longest = scene, scene.time.end / FEWEST_STEPS
    for _ in range(LEVELS_BELOW):
        if found.time is not None and LONGER_STEP * found.time.step <= longest:
            found = coarser(found)
    return changed(found, numerics={"error_bars": scene.numerics.error_bars})


def finer(scene: Scene) -> Scene:
    """The scene in time on a finer mesh with shorter steps: what `errorbars.coarser` undoes."""
    assert scene.time is not None
    time = {"step": scene.time.step / LONGER_STEP}
    if scene.time.tolerance is not None:
        order = 2 if scene.time.scheme == "bdf2" else 1
        time["tolerance"] = scene.time.tolerance / LONGER_STEP ** (order + 1)
    mesh_size = float(f"{scene.numerics.mesh_size / COARSER_MESH:.12g}")
    return changed(scene, numerics={"mesh_size": mesh_size}, time=time)

"""Flow in time to a given accuracy: what errs more for its cost is made finer, the time step or the mesh.

Each run is compared with one in longer steps, and that with one in elements of a higher order, which tells the errors
of step and mesh apart (`discretisation.by_coarser_runs`). What the next run has of each, and its order, follow by
`balance`: the least work with which the accuracy is expected. The first run is coarse. A run that is expected to
reach the accuracy is recorded; it is repeated finer if it does not.
"""

from __future__ import annotations

from typing import Any, cast

from ..accuracy.coarse_runs import changed, comparisons, order_in_time
from ..accuracy.discretisation import OF_MESH, by_coarser_runs
from ..accuracy.goal import relative
from ..accuracy.kept_runs import KeptRuns
from ..errors import ConvergenceError, IncipientError, Interrupted, MeshError
from ..planning.flow_setup import order_of
from ..results.adaptation import Trial
from ..results.errorbars import Term
from ..results.result import Result
from ..scene import Scene
from ..scene.numerics import OF_SURFACE
from ..simulation.recorder import Recorder
from ..simulation.simulate import simulate
from ..simulation.state import Accounts
from .balance import (
    AIM,
    MOST_RUNS,
    WORK_POWER,
    Powers,
    Refined,
    finer,
    first,
    halved,
    milder,
    refined,
)
from .search import AccuracySearch, Attempt, SearchRecorder

# At least so much more work has a run to be worth it; where a budget does not allow more, as much as it allows.
LEAST_WORK = 4.0


class Balancing(AccuracySearch):
    """Search for the time step, mesh and order of flow in time, run by run."""

    _coarse: KeptRuns  # those that the last run is compared with
    _failed = ""  # why the last run could not be compared
    _of_mesh: Term | None = None  # what the mesh of the last run contributes to its error

    def _first(self) -> Attempt:
        return Attempt(first(self.scene))

    def _tried(self, attempt: Attempt) -> Any:
        scene, recorded = attempt.scene, attempt.recorded
        recorder = self._run(scene, recorded)
        following = None if self.reason else self._following(scene)
        if following is None:
            return (
                recorder.result if recorded else self._run(scene, recorded=True, again=True).result
            )
        recorded = following.enough or self._is_last_affordable(following)
        self._keep(self._of_mesh if following.keeps_mesh(order_of(scene).number) else None)
        return Attempt(finer(scene, following), recorded=recorded)

    def _after_failure(self, attempt: Attempt, error: ConvergenceError | MeshError) -> Any:
        """A finer run, if no flow was found on the mesh in these steps."""
        scene = attempt.scene
        if scene.time is None or isinstance(error, MeshError):
            raise error
        self._keep(None)
        self.report(
            Trial(order_of(scene).number, 0, 0, None, 0.0, scene.time.step, f"failed: {error}")
        )
        if len(self.trials) >= MOST_RUNS:
            raise error
        return Attempt(finer(scene, halved(order_of(scene).number, Powers(order_in_time(scene)))))

    def _keep(self, of_mesh: Term | None) -> None:
        """Drop the estimates for a scene except those that hold for the next one. Not collective."""
        self.known.terms, self.known.loads = {} if of_mesh is None else {OF_MESH: of_mesh}, {}
        self.keep_model_terms()

    def _run(self, scene: Scene, recorded: bool, again: bool = False) -> SearchRecorder:
        """Run a scene and its coarse comparisons, estimate its error, and judge it. Collective."""
        began = self.elapsed()
        if not again:
            self._compare(scene)

        def judge(result: Result) -> None:
            """Report the error of a new run that is complete."""
            if result.status == "complete" and not again:
                self._judge(scene, result, self.elapsed() - began)

        keeping = self.recorder if recorded else Recorder()
        recorder = SearchRecorder(keeping, scene, self.adaptation_beside, judge)
        quiet = scene if recorded else changed(scene, numerics={"error_bars": False})
        accounts = Accounts(known=self.known, spent=self.spent)  # times of each run are its own
        simulate(quiet, self.comm, cast(Recorder, recorder), self.voice, accounts=accounts)
        return recorder

    def _compare(self, scene: Scene) -> None:
        """Make the coarse runs that a scene is compared with, or note why they fail. Collective."""
        self._failed = ""
        loads = self.known.loads
        self._coarse = KeptRuns(
            loads, lambda: "", lambda one: simulate(one, self.comm).loads_at_end()
        )
        longer, beside = comparisons(scene)
        try:
            self._coarse(longer)
            if OF_MESH not in self.known.terms:
                self._coarse(beside)
        except Interrupted:
            raise
        except IncipientError as error:
            self._failed = f"not compared: {error}"

    def _judge(self, scene: Scene, result: Result, seconds: float) -> None:
        estimate = of_step = of_mesh = None
        doubt, cost = "", result.cost
        if not self._failed:
            known = self.known.terms.get(OF_MESH)
            term = by_coarser_runs(scene, result.loads_at_end(), self._coarse, known)
            estimate, of_step, of_mesh = (
                relative(self.goal, result, one) for one in (term, *term.parts)
            )
            doubt = term.doubt
            # What the mesh does to waves is seen the less the longer the steps are, which damp them.
            self._of_mesh = None if scene.accuracy_of in OF_SURFACE else term.parts[-1]
        order, cells, unknowns = result.plan.order, cost["cells"], cost["unknowns"]
        step = scene.time.step if scene.time is not None else None
        self.report(
            Trial(order, cells, unknowns, estimate, seconds, step, self._failed, of_step, of_mesh)
        )
        if estimate is not None and estimate <= self.asked:
            self.conclude(estimate, doubt)

    def _following(self, scene: Scene) -> Refined | None:
        """The refinement of the next run; None, with the reason noted, if there is none. Collective."""
        wanted = refined(scene, self.trials[-1], AIM * self.asked)
        if len(self.trials) >= MOST_RUNS:
            self.reason = f"not reached with {MOST_RUNS} runs"
            return None
        while (beyond := self._beyond(wanted)) and wanted.work > LEAST_WORK:
            wanted = milder(wanted)
        self.reason = beyond
        return None if beyond else wanted

    def _beyond(self, wanted: Refined, further: float = 1.0) -> str:
        """Reason why a run, and one `further` times as costly after it, exceeds the budget, or "". Collective."""
        last, more = self.trials[-1], wanted.work
        seconds = last.seconds * more * further
        return self.beyond_budget(seconds, last.unknowns * wanted.finer**-WORK_POWER)

    def _is_last_affordable(self, wanted: Refined) -> bool:
        """Whether the next run is the last one within the budget. Collective."""
        return len(self.trials) + 1 >= MOST_RUNS or bool(self._beyond(wanted, 1.0 + LEAST_WORK))

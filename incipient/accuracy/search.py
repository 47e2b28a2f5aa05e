"""The search for an accuracy: solve, estimate the error, refine, repeat.

This module has the loop, the record of trials and the budget; `strategies` solve, estimate and refine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ConvergenceError, MeshError
from ..installed import free_bytes
from ..parallel import Comm
from ..planning.expense import MEMORY_GROWTH
from ..planning.flow_setup import order_of
from ..planning.layout import Layout
from ..progress import Silent
from ..results.adaptation import Adaptation, Trial
from ..results.errorbars import Term
from ..results.result import Result
from ..results.timing import peak_memory_mib
from ..scene import Scene
from ..simulation.recorder import Recorder
from ..simulation.state import Accounts, Run
from .coarse_runs import KeptRuns
from .goal import Goal, LoadsOnMesh, Quantity
from .modelling import SHARE, Suited, not_estimated, remedies, suited

if TYPE_CHECKING:
    from .strategies import Strategy

# Outcome of an unfinished search.
UNFINISHED = "the search continues, or was stopped"
LEAST_WORK = 2.0  # work over that of the last run: a budget below it ends the search
MOST_FAILURES = 3


class SearchRecorder:
    """A recorder that adds the adaptation to results and writes the user's scene.

    result: the last result, with the adaptation
    kept:   directory of a result without error bars, None without one
    """

    result: Result
    kept: Path | None = None

    def __init__(
        self, recorder: Recorder, wished: Scene, adaptation: Callable[[Result], Adaptation]
    ):
        self.keeps, self._recorder = recorder.keeps, recorder
        self._wished, self._adaptation = wished, adaptation

    def __getattr__(self, name: str) -> Any:
        return getattr(self._recorder, name)

    def begin(self, scene: Scene, plan: Any, domain: Any) -> None:
        self._recorder.begin(self._wished, plan, domain)

    def provisional(self, result: Result) -> Path | None:
        self.kept = self._recorder.provisional(self._with_search(result))
        return self.kept

    def finish(self, result: Result) -> None:
        self.result = self._with_search(result)
        self._recorder.finish(self.result)

    def _with_search(self, result: Result) -> Result:
        scene = self._wished.model_dump(mode="json")
        return replace(result, scene=scene, adaptation=self._adaptation(result))


@dataclass(frozen=True)
class Attempt:
    """A mesh to try: its scene, and the change of the planned cell sizes.

    unknowns, work: expected; work relative to the last run
    """

    scene: Scene
    sizing: Callable[[Layout], Layout] = lambda layout: layout
    unknowns: float = 0.0
    work: float = 1.0
    note: str = ""


@dataclass(frozen=True)
class Estimate:
    """The relative error of the quantity, None: not known, and its term.

    doubt: why it may be larger; note: why it is not known
    parts: of the time step and of the mesh; shares: data for the refinement
    """

    error: float | None
    term: Term | None = None
    doubt: str = ""
    note: str = ""
    parts: tuple[float | None, float | None] = (None, None)
    shares: Any = None

    @property
    def rank(self) -> float:
        return np.inf if self.error is None else self.error


class Search:
    """The search for a sufficiently fine mesh, attempt by attempt.

    Args:
        recorder: of the last run; it may begin several times.
        strategy: makes the strategy of the search.
    """

    def __init__(
        self,
        scene: Scene,
        comm: Comm,
        recorder: Recorder,
        voice: Silent,
        strategy: Callable[[Search], Strategy],
    ):
        self.scene = self._wished = scene
        self.comm, self.recorder, self.voice = comm, recorder, voice
        self.numerics, self.trials = scene.numerics, list[Trial]()
        self.accounts = Accounts(spent=self.spent)
        self.ledger, self.known = self.accounts.ledger, self.accounts.known
        self.goal: Quantity = Goal.of(scene)
        self.speed = 1.0  # of the flow over the scene's
        self.reason, self.met = "", False
        self.suited: Suited | None = None  # if the accuracy includes errors of gap and domain
        self.best: tuple[Attempt, Estimate] | None = None  # with the least error so far
        self.strategy = strategy(self)

    def result(self) -> Any:
        """Try meshes up to the accuracy or the budget; returns the last result. Collective; raises IncipientError."""
        self._choose_gap_and_domain()
        attempt, failures = self.strategy.first(), 0
        while True:
            began = self.elapsed()
            try:
                with self.strategy.solved(attempt) as (run, on_mesh):
                    estimate = self._estimated(attempt, run, on_mesh, began)
                    following = self.strategy.following(attempt, run, on_mesh, estimate)
                    if following is None and self.best is not None and self.best[0] is attempt:
                        return self.strategy.concluded(run)
            except (ConvergenceError, MeshError) as error:
                failures += 1
                self.report(Trial(order_of(attempt.scene).number, 0, 0, None, 0.0, note=str(error)))
                if self.best is None and failures == MOST_FAILURES:
                    raise
                self.reason, following = f"the next mesh failed: {error}", None
                unknown = self.best is None or self.best[1].error is None
                if unknown and failures < MOST_FAILURES:
                    following = self.strategy.first(failures)
            if following is None:
                break
            attempt = following
        assert self.best is not None
        attempt, estimate = self.best
        if estimate.term is not None:
            self.known.terms["discretisation"] = estimate.term
        with self.strategy.solved(attempt) as (run, _):
            return self.strategy.concluded(run)

    def _estimated(
        self, attempt: Attempt, run: Run, on_mesh: LoadsOnMesh, began: float
    ) -> Estimate:
        with self.ledger.stage("error bars"):
            estimate = self.strategy.estimate(run, on_mesh)
        mesh, time = run.domain.mesh, attempt.scene.time
        cells = int(mesh.topology.index_map(mesh.topology.dim).size_global)
        size = order_of(attempt.scene).number, cells, run.fluid.space.unknowns
        note = ", ".join(filter(None, (attempt.note, estimate.note)))
        how = self.elapsed() - began, None if time is None else time.step, note
        self.report(Trial(*size, estimate.error, *how, *estimate.parts))
        anew = self.numerics.accuracy == "verdict"  # scenes change
        if self.best is None or anew or estimate.rank <= self.best[1].rank:
            self.best = attempt, estimate
        return estimate

    def refined(self, attempt: Attempt, estimate: Estimate, left: float) -> Attempt | None:
        """The attempt expected to leave a fraction of the error, or the least that the budget allows. Collective.

        None, with the reason recorded, without a worthwhile attempt within the budget.
        """
        wanted = self.strategy.refined(attempt, estimate, left)
        while self._beyond_budget(wanted) and wanted.work > LEAST_WORK and left < 1.0 / LEAST_WORK:
            left **= 0.5
            wanted = self.strategy.refined(attempt, estimate, left)
        return self.affordable(wanted)

    def affordable(self, attempt: Attempt) -> Attempt | None:
        """The attempt; None, with the reason recorded, if it exceeds the budget. Collective."""
        self.reason, most = self._beyond_budget(attempt), self.strategy.most
        if not self.reason and len(self.trials) >= most:
            self.reason = f"not reached with {most} meshes"
        return None if self.reason else attempt

    @property
    def allowed(self) -> float:
        """The allowed relative error of the discretisation; none for a verdict."""
        accuracy = self.numerics.accuracy
        if not isinstance(accuracy, float | int):
            return 0.0
        if self.suited is None:
            return accuracy
        left = accuracy - self.suited.error
        return left if left > 0.0 else SHARE * accuracy

    def _choose_gap_and_domain(self) -> None:
        accuracy, includes = self.numerics.accuracy, self.numerics.accuracy_includes
        if includes == "discretisation" or not isinstance(accuracy, float | int):
            return
        with self.ledger.stage("error bars"), self.strategy.coarse_runs() as solve:
            runs = KeptRuns(self.known.loads, self.spent, solve)
            self.suited = suited(self.scene, accuracy, self.goal, runs, self.voice.say)
            self.scene = self.suited.scene
        self.known.terms.update({term.name: term for term in self.suited.terms})

    def conclude(self, estimate: float, doubt: str = "") -> None:
        """End the search with a small enough discretisation error, unless in doubt."""
        accuracy, unmet = self.numerics.accuracy, ""
        if doubt:
            unmet = f"not known to be reached: {doubt}"
        elif self.suited is not None and isinstance(accuracy, float | int):
            if estimate + self.suited.error > accuracy:
                unmet = f"not reached: {self.suited.unmet}"
            elif missing := not_estimated(self.scene):
                unmet = f"not known to be reached: {missing}"
        self.reason, self.met = unmet or "reached", not unmet

    def adaptation(self, result: Result | None = None) -> Adaptation:
        """The record of the search, with remedies for errors that it does not include."""
        accuracy, reached = (
            self.numerics.accuracy,
            None if self.best is None else self.best[1].error,
        )
        assert accuracy is not None
        trials, reason = tuple(self.trials), self.reason or UNFINISHED
        record = Adaptation(accuracy, self.goal.name, reached, self.met, reason, trials)
        if self.suited is not None:
            error = self.suited.error
            whole = None if reached is None or np.isinf(error) else reached + error
            includes = ("discretisation", *(term.name for term in self.suited.terms))
            changes = self.suited.changes(self._wished)
            return replace(record, reached=whole, includes=includes, changes=changes)
        bars = None if result is None else result.error_bars
        if result is None or bars is None or not isinstance(accuracy, float | int):
            return record
        return replace(record, beside=remedies(self.scene, accuracy, self.goal, result, bars))

    def elapsed(self) -> float:
        return float(self.comm.bcast(self.ledger.total(), root=0))

    def spent(self) -> str:
        limit = self.numerics.budget_seconds
        if limit is None or self.elapsed() <= limit:
            return ""
        return f"numerics.budget_seconds = {limit:g} is spent"

    def _beyond_budget(self, attempt: Attempt) -> str:
        numerics, last = self.numerics, self.trials[-1]
        seconds, limit = last.seconds * attempt.work, numerics.budget_seconds
        if limit is not None and self.elapsed() + seconds > limit:
            budget = f"stopped at numerics.budget_seconds = {limit:g}"
            return f"{budget}: the next mesh would take about {seconds:.1f} s"
        now = float(sum(self.comm.allgather(peak_memory_mib())))
        expected = now + max(0.0, _lu_mib(attempt.unknowns) - _lu_mib(last.unknowns))
        needs = f"the next mesh would need about {expected:.0f} MiB"
        if numerics.budget_mib is not None and expected > numerics.budget_mib:
            return f"stopped at numerics.budget_mib = {numerics.budget_mib:g}: {needs}"
        if expected - now > self.comm.bcast(free_bytes() / 2**20, root=0):
            return f"stopped: {needs}, more than there is"
        return ""

    def report(self, trial: Trial) -> None:
        self.trials.append(trial)
        step = "" if trial.step is None else f"step {trial.step:.3g}, "
        error = trial.note if trial.estimate is None else f"estimated error {trial.estimate:.2e}"
        parts = f" ({trial.parts})" if trial.parts else ""
        mesh = f"mesh {len(self.trials)}: P{trial.order}, {trial.unknowns} unknowns"
        self.voice.say(f"{mesh}, {step}{trial.seconds:.1f} s: {error}{parts}")


def _lu_mib(unknowns: float) -> float:
    both = np.array([1.0, 2.0]) * max(unknowns, 2.0)
    return float(MEMORY_GROWTH * np.sum(both * np.log2(both)) / 2**20)

"""Asking for accuracy instead of a mesh: solve, estimate the error, refine where it comes from, and again.

The loop is here, with the record of the meshes tried and the budget. What is refined is a strategy: the cells that the
error of steady flow comes from (`refinement`), all cells alike (`uniform`), time steps and mesh of flow in time as
each errs for its cost (`balancing`), and what the error of a critical flow comes from (`critical.meshes`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..accuracy.goal import Goal, Quantity
from ..accuracy.kept_runs import KeptRuns
from ..errors import ConvergenceError, MeshError
from ..installed import free_bytes
from ..parallel import Comm
from ..planning.expense import MEMORY_GROWTH
from ..planning.layout import Layout
from ..progress import Silent
from ..results.adaptation import Adaptation, Trial
from ..results.result import Result
from ..results.timing import peak_memory_mib
from ..scene import Scene
from ..simulation.beside import InTurn
from ..simulation.recorder import Recorder
from ..simulation.simulate import loads_of
from ..simulation.state import Accounts
from .modelling import SHARE, Suited, not_estimated, remedies, suited

# What a result says of a search that is still on; one that is stopped leaves it so.
UNFINISHED = "the search continues, or was stopped"


class SearchRecorder:
    """A recorder of results with the adaptation in them; the scene that it writes is the user's own.

    result: the last result, with the adaptation
    kept:   where a result without error bars is kept, None if nowhere

    Args:
        adaptation: the search so far, with what a result says beside it.
        judge: is given the result when the run is over, before the adaptation is asked for.
    """

    result: Result
    kept: Path | None = None

    def __init__(
        self,
        recorder: Recorder,
        asked: Scene,
        adaptation: Callable[[Result], Adaptation],
        judge: Callable[[Result], None] = lambda result: None,
    ):
        self.keeps, self._recorder, self._asked = recorder.keeps, recorder, asked
        self._adaptation, self._judge = adaptation, judge

    def __getattr__(self, name: str) -> Any:
        return getattr(self._recorder, name)

    def begin(self, scene: Scene, plan: Any, domain: Any) -> None:
        """Begin the record of a run on its mesh."""
        self._recorder.begin(self._asked, plan, domain)

    def provisional(self, result: Result) -> Path | None:
        """Record a result without error bars; returns where it is kept."""
        self.kept = self._recorder.provisional(self._with_search(result))
        return self.kept

    def finish(self, result: Result) -> None:
        """Judge and record the result of a run that is over."""
        self._judge(result)
        self.result = self._with_search(result)
        self._recorder.finish(self.result)

    def _with_search(self, result: Result) -> Result:
        scene = self._asked.model_dump(mode="json")
        return replace(result, scene=scene, adaptation=self._adaptation(result))


@dataclass(frozen=True)
class Attempt:
    """A mesh to be tried: its scene, and what becomes of the cell sizes laid out.

    expected: unknowns; note: what is changed besides the mesh
    recorded: whether a run in time is handed to the recorder, since no other is expected after it
    """

    scene: Scene
    sizing: Callable[[Layout], Layout] = lambda layout: layout
    expected: float = 0.0
    note: str = ""
    recorded: bool = False


class AccuracySearch(ABC):
    """The search for a mesh that is fine enough: attempt by attempt, each by what the ones before have shown.

    Args:
        recorder: what the last run is handed to; it may begin again.
    """

    def __init__(self, scene: Scene, comm: Comm, recorder: Recorder, voice: Silent):
        self.scene, self.comm, self.recorder, self.voice = scene, comm, recorder, voice
        self.numerics, self.trials = scene.numerics, list[Trial]()
        self.accounts = Accounts(spent=self.spent)
        self.ledger, self.known = self.accounts.ledger, self.accounts.known
        self.goal: Quantity = Goal.of(scene)
        self.speed = 1.0  # of the flow whose loads are looked at, over that of the scene
        self.reason, self.met = "", False
        self.wished = scene
        self.suited: Suited | None = (
            None  # gap and domain chosen, where the accuracy includes their errors
        )
        self._best: Attempt | None = None  # the last one that was solved and estimated
        self.of_result: float | None = None  # its error, where it is not that of the last mesh

    def result(self) -> Any:
        """Try meshes until the accuracy is reached or cannot be; the last result. Collective; raises IncipientError."""
        attempt = self._first()
        while isinstance(attempt, Attempt):
            try:
                self._best, attempt = attempt, self._tried(attempt)
            except (ConvergenceError, MeshError) as error:
                attempt = self._after_failure(attempt, error)
        return attempt

    @abstractmethod
    def _first(self) -> Attempt:
        """The first mesh, a coarse one."""

    @abstractmethod
    def _tried(self, attempt: Attempt) -> Any:
        """Solve, estimate, and either say what to try next or give the result. Collective."""

    @abstractmethod
    def _after_failure(self, attempt: Attempt, error: ConvergenceError | MeshError) -> Any:
        """What to try after an attempt that failed, or the result of an earlier one; else raise. Collective."""

    @property
    def asked(self) -> float:
        """The relative error that the discretisation may have."""
        asked = self.numerics.accuracy
        assert isinstance(asked, float | int)
        if self.suited is None:
            return asked
        return asked - self.suited.error if self.suited.error < asked else SHARE * asked

    def choose_gap_and_domain(self) -> None:
        """Choose gap and domain before any mesh, if the accuracy includes their errors. Collective."""
        asked = self.numerics.accuracy
        if self.numerics.accuracy_includes == "discretisation" or not isinstance(
            asked, float | int
        ):
            return
        with self.ledger.stage("error bars"), self._coarse_runs() as solve:
            runs = KeptRuns(self.known.loads, self.spent, solve)
            self.suited = suited(self.scene, asked, self.goal, runs, self.voice.say)
            self.scene = self.suited.scene
            self._take_over(solve)
        self.keep_model_terms()

    def _coarse_runs(self) -> InTurn:
        """Runs for the errors of gap and domain."""
        return InTurn(self.comm, loads_of)

    def _take_over(self, solve: InTurn) -> None:
        """Take what the coarse runs leave that is of use on. Not collective."""
        del solve

    def kept_runs(self) -> KeptRuns:
        """Coarse runs of this search, each made once, as long as the budget lasts. Not collective."""
        return KeptRuns(self.known.loads, self.spent, lambda scene: loads_of(scene, self.comm))

    def keep_model_terms(self) -> None:
        """Keep the terms of gap and domain for the error bars. Not collective."""
        if self.suited is not None:
            self.known.terms.update({term.name: term for term in self.suited.terms})

    def conclude(self, estimate: float, doubt: str = "") -> None:
        """End the search: the discretisation's error is small enough, unless there is a doubt. Not collective."""
        asked, self.reason, self.met = self.numerics.accuracy, "reached", True
        if doubt:
            self.reason, self.met = f"not known to be reached: {doubt}", False
            return
        if self.suited is None or not isinstance(asked, float | int):
            return
        if estimate + self.suited.error > asked:
            self.reason, self.met = f"not reached: {self.suited.unmet}", False
        elif missing := not_estimated(self.scene):
            self.reason, self.met = f"not known to be reached: {missing}", False

    def adaptation(self) -> Adaptation:
        """The record of the search so far. Not collective."""
        asked, reached = (
            self.numerics.accuracy,
            [t.estimate for t in self.trials if t.estimate is not None],
        )
        assert asked is not None
        last, reason = reached[-1] if reached else None, self.reason or UNFINISHED
        last = last if self.of_result is None else self.of_result
        found = Adaptation(asked, self.goal.name, last, self.met, reason, tuple(self.trials))
        if self.suited is None:
            return found
        whole = None if last is None or np.isinf(self.suited.error) else last + self.suited.error
        includes = ("discretisation", *(term.name for term in self.suited.terms))
        return replace(
            found, reached=whole, includes=includes, changes=self.suited.changes(self.wished)
        )

    def adaptation_beside(self, result: Result) -> Adaptation:
        """The record so far with the remedies for errors that it does not include. Not collective."""
        found, bars = self.adaptation(), result.error_bars
        if bars is None or self.suited is not None or not isinstance(found.asked, float | int):
            return found
        return replace(found, beside=remedies(self.scene, found.asked, self.goal, result, bars))

    def elapsed(self) -> float:
        """Seconds so far, the same on all ranks."""
        return float(self.comm.bcast(self.ledger.total(), root=0))

    def spent(self) -> str:
        """Reason why no further estimate may begin, or "". Collective."""
        limit = self.numerics.budget_seconds
        if limit is None or self.elapsed() <= limit:
            return ""
        return f"numerics.budget_seconds = {limit:g} is spent"

    def beyond_budget(self, seconds: float, unknowns: float) -> str:
        """Reason why a run of this time [s] and size exceeds the budget, or "". Collective."""
        numerics = self.numerics
        if (
            numerics.budget_seconds is not None
            and self.elapsed() + seconds > numerics.budget_seconds
        ):
            budget = f"stopped at numerics.budget_seconds = {numerics.budget_seconds:g}"
            return f"{budget}: the next mesh would take about {seconds:.1f} s"
        now = float(sum(self.comm.allgather(peak_memory_mib())))
        expected = now + max(0.0, _lu_mib(unknowns) - _lu_mib(self.trials[-1].unknowns))
        needs = f"the next mesh would need about {expected:.0f} MiB"
        if numerics.budget_mib is not None and expected > numerics.budget_mib:
            return f"stopped at numerics.budget_mib = {numerics.budget_mib:g}: {needs}"
        if expected - now > self.comm.bcast(free_bytes() / 2**20, root=0):
            return f"stopped: {needs}, more than there is"
        return ""

    def report(self, trial: Trial) -> None:
        """Keep a trial and log it. Not collective."""
        self.trials.append(trial)
        step = "" if trial.step is None else f"step {trial.step:.3g}, "
        error = trial.note if trial.estimate is None else f"estimated error {trial.estimate:.2e}"
        parts = f" ({trial.parts})" if trial.parts else ""
        mesh = f"mesh {len(self.trials)}: P{trial.order}, {trial.unknowns} unknowns"
        self.voice.say(f"{mesh}, {step}{trial.seconds:.1f} s: {error}{parts}")


def _lu_mib(unknowns: float) -> float:
    """Memory [MiB] of the LU factorisations of a flow and of its dual, in elements of one order more."""
    both = np.array([1.0, 2.0]) * max(unknowns, 2.0)
    return float(MEMORY_GROWTH * np.sum(both * np.log2(both)) / 2**20)

"""The search for an accuracy: solve, estimate the error, refine, repeat."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ConvergenceError, MeshError, SceneError
from ..installed import free_bytes
from ..interrupt import told_where_kept
from ..parallel import Comm
from ..planning.discretisation import order_of
from ..planning.meshing import memory
from ..planning.plan import plan_of
from ..progress import Silent
from ..results.accuracy import Adaptation, Trial
from ..results.errorbars import ErrorBars, Loads, Term
from ..results.timing import Ledger, peak_memory_mib
from ..scene import Scene
from ..setup.setup import Setup
from ..simulation.assemble import outcome
from ..simulation.build import prepared
from ..simulation.loads import loads_of_run
from ..simulation.simulate import solved
from ..simulation.state import Accounts, Recorder, Run
from ..simulation.steady import solve_with_turbulence
from .coarse_runs import changed, farther
from .errorbars import error_bars
from .finish import finished
from .first_mesh import Attempt, first_attempt, includes_all
from .goal import Goal, relative
from .terms import DECAY, has_no_far_sides

AIM = 0.6  # fraction of the accuracy aimed at, as a margin
SHARE = 0.5  # of the accuracy, for gap and domain together
SMALLEST_GAP = 1e-4  # of the grain's size
LEAST_WORK = 2.0  # work over that of the last run: a budget below it ends the search
MOST_FAILURES = 3
FOR_VERDICT = 0.2  # fraction left of an infinite error, or of one for a verdict


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
    parts: tuple[float | None, ...] = (None, None)
    shares: Any = None

    @property
    def rank(self) -> float:
        return np.inf if self.error is None else self.error


class Search(ABC):
    """The search for a sufficiently fine mesh: solve, estimate the error, refine.

    The recorder may begin several times.
    """

    most = 12  # meshes
    _recorded: Run | None = None

    def __init__(self, scene: Scene, comm: Comm, recorder: Recorder, voice: Silent):
        self.scene = scene
        self.comm, self.recorder, self.voice = comm, recorder, voice
        self.numerics, self.trials = scene.numerics, list[Trial]()
        accuracy = scene.numerics.accuracy
        self.accuracy = accuracy if isinstance(accuracy, float | int) else 0.0  # 0 for a verdict
        self.includes_all = includes_all(scene.numerics)
        # Relative error of the discretisation; none for a verdict.
        self.allowed = SHARE * self.accuracy if self.includes_all else self.accuracy
        self.accounts = Accounts(spent=self.spent, adaptation=self.adaptation)
        self.ledger, self.terms = self.accounts.ledger, self.accounts.terms
        self.goal = Goal.of(scene)
        self.speed = 1.0  # of the flow over the scene's
        self.reason, self.met = "", False
        # If the accuracy includes errors of gap and domain: bars and their relative error, why it stays too large, and
        # the sum of the errors with gap and domain before.
        self.bars: ErrorBars | None = None
        self.reached: float | None = None
        self._unmet, self._together = "", np.inf
        self.best: tuple[Attempt, Estimate] | None = None  # with the least error so far

    def result(self) -> Any:
        """Try meshes up to the accuracy or the budget; returns the last result. Collective; raises IncipientError."""
        attempt: Attempt | None = self.first()
        failures = 0
        while attempt is not None:
            began = self.elapsed()
            try:
                with self.solved(attempt) as (run, computed):
                    estimate = self._estimated(attempt, run, computed, began)
                    following = self.following(attempt, run, estimate)
                    if following is None and self.best is not None and self.best[0] is attempt:
                        return self.concluded(run)
            except (ConvergenceError, MeshError, SceneError) as error:
                failures += 1
                self.report(Trial(order_of(attempt.scene), 0, 0, None, 0.0, note=str(error)))
                # Later scenes, with more cells or a smaller gap, may contradict a limit of the first.
                of_scene = isinstance(error, SceneError)
                if self.best is None and (of_scene or failures == MOST_FAILURES):
                    raise
                self.reason = f"the next mesh failed: {error}"
                unknown = self.best is None or self.best[1].error is None
                again = unknown and failures < MOST_FAILURES
                following = self.first(failures) if again else None
            attempt = following
        assert self.best is not None
        attempt, estimate = self.best
        if estimate.term is not None:
            self.terms["discretisation"] = estimate.term
        with self.solved(attempt) as (run, _):
            return self.concluded(run)

    def _estimated(self, attempt: Attempt, run: Run, computed: Loads, began: float) -> Estimate:
        with self.ledger.stage("error bars"):
            estimate = self.estimate(run, computed)
        if estimate.term is not None:
            self.terms["discretisation"] = estimate.term
        mesh, time = run.domain.mesh, attempt.scene.time
        trial = Trial(
            order_of(attempt.scene),
            int(mesh.topology.index_map(mesh.topology.dim).size_global),
            run.fluid.space.unknowns,
            estimate.error,
            self.elapsed() - began,
            None if time is None else time.step,
            ", ".join(filter(None, (attempt.note, estimate.note))),
            *estimate.parts,
        )
        self.report(trial)
        # Scenes with other gaps and domains are not compared.
        if self.best is None or self.includes_all or estimate.rank <= self.best[1].rank:
            self.best = attempt, estimate
        return estimate

    def first(self, failures: int = 0) -> Attempt:
        return first_attempt(self.scene, failures)

    @abstractmethod
    def estimate(self, run: Run, computed: Loads) -> Estimate:
        """Error of a solved run."""

    @abstractmethod
    def refined(self, attempt: Attempt, estimate: Estimate, left: float) -> Attempt:
        """An attempt that is expected to leave a fraction `left` of the error."""

    def target(self, estimate: Estimate) -> float:
        return AIM * self.allowed / estimate.rank or FOR_VERDICT

    @contextmanager
    def solved(self, attempt: Attempt) -> Iterator[tuple[Run, Loads]]:
        """The solved run of an attempt and its loads. Raises ConvergenceError, MeshError."""
        scene, comm, voice, accounts = attempt.scene, self.comm, self.voice, self.accounts
        if scene.time is None:
            with prepared(scene, comm, accounts, voice=voice, sizing=attempt.sizing) as run:
                yield run, self.solve(run)
        else:
            # Separate times of each run.
            accounts = replace(accounts, ledger=Ledger(), iterations=Counter())
            with solved(scene, comm, self.recorder, voice, accounts=accounts) as run:
                yield run, loads_of_run(run)

    def solve(self, run: Run) -> Loads:
        solve_with_turbulence(run, run.fluid, run.turbulence)
        return loads_of_run(run)

    def record(self, run: Run) -> None:
        """Record mesh and fields of a steady flow, once; those of an unsteady one are recorded in its steps."""
        if run.scene.time is None and self._recorded is not run:
            self.recorder.begin(run.scene, run.domain)
            self.recorder.fields(run, 0, last=True)
            self._recorded = run

    def provisional(self, run: Run) -> Path | None:
        """Record a run's result without error bars; returns its directory."""
        self.record(run)
        return self.recorder.provisional(outcome(run))

    def concluded(self, run: Run) -> Any:
        self.record(run)
        return finished(run, self.recorder)

    def following(self, attempt: Attempt, run: Run, estimate: Estimate) -> Attempt | None:
        """The next attempt; None, with the reason recorded, if the accuracy is reached or unattainable.

        Gap and domain, if included, change before the mesh; for a verdict the decisive source is reduced.
        """
        if self.includes_all and estimate.error is not None:
            bars, computed = self._all_errors(run)
            if not self.accuracy:
                return self._for_verdict(attempt, estimate, bars)
            self.reached = None if bars.failed else relative(self.goal, computed, bars.total)
            if self.reached is not None and self.reached <= self.accuracy:
                self.conclude(estimate.doubt)
                return None
            scene = self._with_better_model(attempt.scene, computed, bars)
            if scene is not attempt.scene:
                return self._elsewhere(attempt, scene, "for gap and domain")
        if estimate.rank > self.allowed:
            return self.within_budget(attempt, estimate, self.target(estimate))
        self.conclude(estimate.doubt)
        return None

    def _all_errors(self, run: Run) -> tuple[ErrorBars, Loads]:
        """Error bars of a run, which is recorded first: an interrupt of its coarse runs does not lose it."""
        kept, computed = self.provisional(run), loads_of_run(run)
        with told_where_kept(kept, self.comm), self.ledger.stage("error bars"):
            self.bars = error_bars(run, computed)
        return self.bars, computed

    def _for_verdict(self, attempt: Attempt, estimate: Estimate, bars: ErrorBars) -> Attempt | None:
        bar, unknown = bars.safety, _unknown(bars.failed)
        assert bar is not None
        if bar.certain:
            but = f"undecided: certain except for unknown errors, {unknown}"
            self.reason, self.met = but if unknown else "the verdict is certain", not unknown
            return None
        # A range of safety factors about 1 of 1e-4 is not divided further.
        if bar.decisive == "discretisation" and estimate.rank > 1e-4:
            finer = self.within_budget(attempt, estimate, FOR_VERDICT)
            return finer and replace(finer, note="for the verdict")
        term = next((each for each in bars.terms if each.name == bar.decisive), None)
        scene = None if term is None else lessened(attempt.scene, term, FOR_VERDICT)
        if scene is None:
            self.reason = (
                f"undecided: the safety factor is between {bar.low:.6g} and {bar.high:.6g}, "
                f"and the error of the {bar.decisive} cannot be reduced"
            )
            return None
        return self._elsewhere(attempt, scene, f"less error of the {bar.decisive}")

    def _with_better_model(self, scene: Scene, computed: Loads, bars: ErrorBars) -> Scene:
        """The scene with less error of gap and domain; the same where that suffices or cannot be reduced."""
        model = [term for term in bars.terms if term.name != "discretisation"]
        errors = {term.name: relative(self.goal, computed, term) or 0.0 for term in model}
        together = sum(errors.values())
        if together <= SHARE * self.accuracy or self._unmet:
            return scene
        # Sides three times as far leave 0.69 of an influence that falls with the cube root of the distance (Leveque
        # 1928), and a ninth of the expected one: a change must leave at most half.
        slow, self._together = together > 0.5 * self._together, together
        better = scene if slow else less_of_the_model(scene, self.accuracy, model, errors)
        if better is scene:
            causes = [term for term in model if term.name in self.terms]  # not interaction
            largest = max(causes, key=lambda term: errors[term.name])
            self._unmet = irreducible(scene, largest.name, errors[largest.name])
            if slow:
                self.terms[largest.name] = replace(largest, doubt=self._unmet)
        return better

    def _elsewhere(self, attempt: Attempt, scene: Scene, note: str) -> Attempt | None:
        self.terms.clear()
        self.most += bool(self.accuracy)  # then errors fall, or the search ends
        return self.affordable(Attempt(scene, attempt.sizing, 1.2, note=note))

    def within_budget(self, attempt: Attempt, estimate: Estimate, left: float) -> Attempt | None:
        """The attempt expected to leave a fraction of the error, or the least that the budget allows. Collective.

        None, with the reason recorded, without a worthwhile attempt.
        """
        wanted = self.refined(attempt, estimate, left)
        while self._beyond_budget(wanted) and wanted.work > LEAST_WORK and left < 1.0 / LEAST_WORK:
            left **= 0.5
            wanted = self.refined(attempt, estimate, left)
        return self.affordable(wanted)

    def affordable(self, attempt: Attempt) -> Attempt | None:
        """The attempt; None, with the reason recorded, if it exceeds the budget. Collective."""
        self.reason = self._beyond_budget(attempt)
        if not self.reason and len(self.trials) >= self.most:
            self.reason = f"not reached with {self.most} meshes"
        return None if self.reason else attempt

    def conclude(self, doubt: str = "") -> None:
        """Record whether the accuracy is reached; with a `doubt` it is not."""
        if self.bars is not None:
            left_out = self.bars.left_out.items()
            unseen = {name: why for name, why in left_out if why.startswith("not estimated")}
            doubt = doubt or _unknown(self.bars.failed | unseen)
        unmet = f"not known to be reached: {doubt}" if doubt else ""
        if self.reached is not None and self.reached > self.accuracy:
            unmet = f"not reached: {self._unmet or 'all errors together are larger'}"
        self.reason, self.met = unmet or "reached", not unmet

    def adaptation(self) -> Adaptation:
        """Record of the search."""
        accuracy, best = self.numerics.accuracy, self.best
        assert accuracy is not None
        record = Adaptation(
            accuracy,
            self.goal.name,
            best and best[1].error,
            self.met,
            self.reason or "the search continues, or was stopped",
            tuple(self.trials),
        )
        if not self.accuracy or best is None or self.bars is None:
            return record
        return replace(
            record,
            reached=self.reached,
            includes=tuple(term.name for term in self.bars.terms),
            changes=changes_of_the_model(best[0].scene, self.scene),
        )

    def elapsed(self) -> float:
        return float(self.comm.bcast(self.ledger.total(), root=0))

    def spent(self) -> str:
        """Reason to stop if the budget of time is spent, otherwise empty. Collective."""
        limit = self.numerics.budget_seconds
        if limit is None or self.elapsed() <= limit:
            return ""
        return f"numerics.budget_seconds = {limit:g} is spent"

    def _beyond_budget(self, attempt: Attempt) -> str:
        last, numerics = self.trials[-1], self.numerics
        limit, most = numerics.budget_seconds or np.inf, numerics.budget_mib or np.inf
        seconds = last.seconds * attempt.work
        size = attempt.growth * last.unknowns
        more = _memory(attempt.scene, size) - _memory(attempt.scene, last.unknowns)
        expected = float(sum(self.comm.allgather(peak_memory_mib()))) + max(0.0, more)
        needs = f"the next mesh would need about {expected:.0f} MiB"
        reasons = (
            (
                self.elapsed() + seconds > limit,
                f"stopped at numerics.budget_seconds = {limit:g}: the next mesh would take about {seconds:.1f} s",
            ),
            (expected > most, f"stopped at numerics.budget_mib = {most:g}: {needs}"),
            (
                more > self.comm.bcast(free_bytes() / 2**20, root=0),
                f"stopped: {needs}, more than is available",
            ),
        )
        return next((reason for exceeds, reason in reasons if exceeds), "")

    def report(self, trial: Trial) -> None:
        self.trials.append(trial)
        self.voice.say(f"mesh {len(self.trials)}: {' '.join(trial.line().split())}")


def _unknown(reasons: Mapping[str, str]) -> str:
    return "; ".join(f"error of the {name}: {reason}" for name, reason in reasons.items())


def _memory(scene: Scene, unknowns: float) -> float:
    order, solver = order_of(scene), plan_of(Setup(scene)).solver.name
    # The next-higher order has about twice as many unknowns.
    return memory(
        scene.gdim, solver, lambda k: round(unknowns * 2.0 ** (k - order)), order, dual=True
    )


# -- gap and domain, with numerics.accuracy_includes = "all" --------------------------------------------------


def less_of_the_model(
    scene: Scene, accuracy: float, terms: Sequence[Term], errors: Mapping[str, float]
) -> Scene:
    """The scene with gap and domain for errors that add up to half of an accuracy; the same if they cannot."""
    part = SHARE * accuracy / len(errors)
    for term in terms:
        if errors[term.name] > part:
            scene = lessened(scene, term, AIM * part / errors[term.name]) or scene
    return scene


def irreducible(scene: Scene, name: str, error: float) -> str:
    """Why a term of the model stays too large."""
    effective = getattr(scene.flow, "datum", "auto") in ("auto", "effective")
    inertia = "; with inertia the effective height of the bed is not known more accurately"
    remedies = {"datum": inertia if effective else '; flow.datum = "auto" reduces it'}
    return f"the error of the {name}, {error:.1e}, cannot be reduced{remedies.get(name, '')}"


def changes_of_the_model(scene: Scene, before: Scene) -> tuple[str, ...]:
    """Keys of gap and domain that differ, with both values."""
    changes = []
    for section in ("contact", "domain", "surface"):
        now, then = (dict(getattr(each, section) or ()) for each in (scene, before))
        for key in (key for key in then if now[key] != then[key]):
            value, old = (
                ", ".join(f"{x:.4g}" for x in np.ravel(each[key])) for each in (now, then)
            )
            changes.append(f"{section}.{key} = {value} instead of {old}")
    return tuple(changes)


def lessened(scene: Scene, term: Term, relative: float) -> Scene | None:
    """The scene in which a term is expected to fall to a fraction `relative` in one step; None if impossible."""
    relative = max(relative, 1e-3)
    if term.name == "gap" and scene.contact is not None:
        before = scene.contact.gap
        gap = max(before * max(relative ** (1.0 / term.power), 1 / 32), SMALLEST_GAP)
        closer = changed(scene, contact={"gap": float(f"{gap:.2g}")})
        return closer if before > SMALLEST_GAP else None
    # Without a section [contact] the gap stays: a new section would request a verdict.
    if term.name != "domain" or has_no_far_sides(scene):
        return None
    factor = float(np.ceil(10.0 * relative ** (-1.0 / DECAY))) / 10.0
    return farther(scene, min(factor, 3.0))

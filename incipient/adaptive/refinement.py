"""Steady flow to a given accuracy: from mesh to mesh by what each vertex contributes to the error.

The first mesh is as coarse as the geometry allows, in elements of the scene's order. The dual-weighted residual
(`dual`) gives the error of the quantity asked for and what each vertex has to do with it, and from that
follow the sizes of the next mesh's cells (`sizing`). A higher order is chosen where it is expected to need
fewer unknowns (`cheapest_order`).
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial
from typing import Any, cast

import numpy as np

from ..accuracy.coarse_runs import changed, farther
from ..accuracy.discretisation import by_both, by_dual
from ..accuracy.dual import GoalErrors
from ..accuracy.errorbars import error_bars
from ..accuracy.model_terms import has_no_far_sides, is_corrected
from ..errors import ConvergenceError, MeshError
from ..interrupt import told_where_kept
from ..planning.layout import coarse_sizes
from ..planning.order import order_of
from ..results.adaptation import Trial
from ..results.errorbars import ErrorBars, Loads
from ..results.loads import Couples, Forces
from ..results.result import Result
from ..scene import Scene
from ..simulation.build import prepared
from ..simulation.recorder import Recorder
from ..simulation.simulate import finished, hand_over, loads_of
from ..simulation.state import Run
from ..simulation.steady import loads_at
from .modelling import SMALLEST_GAP
from .orders import COARSEST, MOST_MESHES, UNKNOWNS, cheapest_order, coarsest, highest_order, next_order
from .search import AccuracySearch, Attempt, SearchRecorder
from .sizing import Shares, gathered, resized

CANCELLING = 4.0  # most that contributions of the next mesh are trusted to cancel
MOST_FAILURES = 3
SOLVER_SHARE = 1e-3  # of the accuracy: what the iteration may leave
TOLERANCES = (1e-10, 1e-5)
TIME_GROWTH = 1.3  # of the time to solve and estimate with unknowns
FOR_VERDICT = 0.2  # what is left of an error that is to decide a verdict
CLOSER = 0.25  # a gap that is to decide a verdict, relative to before
CRITICAL = 1e-4  # a safety factor known this well and still on both sides of one


class Refinement(AccuracySearch):
    """Search for the mesh of steady flow: cells by the error that each vertex contributes."""

    _failures = 0
    _improved: tuple[float, Loads] | None = None  # speed and improved loads of the mesh before

    def _first(self, part: float = 1.0) -> Attempt:
        factor = part * coarsest(self.scene.gdim, self.scene.fluid.inertia)
        sizing = partial(coarse_sizes, factor, None)
        return Attempt(self._set_up(self.scene, order_of(self.scene).number), sizing)

    def _after_failure(self, attempt: Attempt, error: ConvergenceError | MeshError) -> Any:
        """A finer first mesh; after others the result on the last of them."""
        self._failures += 1
        self.report(Trial(order_of(attempt.scene).number, 0, 0, None, 0.0, note=str(error)))
        if self._best is not None:
            self.reason = f"the next mesh failed: {error}"
            return self._repeated(self._best)
        if self._failures == MOST_FAILURES:
            raise error
        return self._first(0.5**self._failures)

    def _set_up(self, scene: Scene, order: int) -> Scene:
        asked = self.numerics.accuracy
        wanted = SOLVER_SHARE * (asked if isinstance(asked, float | int) else CRITICAL)
        tolerance = float(np.clip(wanted, *TOLERANCES))
        return changed(scene, numerics={"order": order, "tolerance": tolerance})

    def _prepared(self, attempt: Attempt) -> AbstractContextManager[Run]:
        """The run of an attempt, whose costs and estimates are those of the search. Collective."""
        return prepared(attempt.scene, self.comm, self.accounts, voice=self.voice, sizing=attempt.sizing)

    def _tried(self, attempt: Attempt) -> Any:
        """Solve, estimate, and either conclude or say what to try next. Collective."""
        began = self.elapsed()
        with self._prepared(attempt) as run:
            force, couple = self._solved(run)
            with self.ledger.stage("error bars"):
                error, shares = self._estimated(run, force, couple)
            seconds, mesh = self.elapsed() - began, run.domain.mesh
            cells = int(mesh.topology.index_map(mesh.topology.dim).size_global)
            order, unknowns = order_of(attempt.scene).number, run.fluid.space.unknowns
            self.report(Trial(order, cells, unknowns, error, seconds, note=attempt.note))
            if error is None or self.numerics.accuracy != "verdict":
                following = self._within_budget(self._next_mesh(attempt, error, shares))
                return following or self._concluded(run, self._handed_over(run))
            # Coarse runs come next, for the error bars: what has been found outlasts an interrupt.
            recorder = self._handed_over(run)
            with told_where_kept(recorder.kept, self.comm):
                bars = error_bars(run, force, couple, lambda scene: loads_of(scene, self.comm, self.speed))
            following = self._within_budget(self._to_decide(attempt, error, bars, shares))
            return following or self._concluded(run, recorder)

    def _estimated(
        self, run: Run, force: Forces | None, couple: Couples | None
    ) -> tuple[float | None, Shares | None]:
        """The error of the quantity, None where this mesh gives none, and the shares for the next one. Collective."""
        assert run.layout.placement is not None and force is not None and couple is not None
        with GoalErrors(run.fluid, "body", run.layout.placement.centre) as goals:
            # Loads over those of the fluid, which has a speed of its own; both are near, or it is Stokes flow.
            unit = goals.allowance * self.speed * run.fluid.reynolds / run.plan.reynolds
            term = by_dual(goals, unit)
            corrects = self.numerics.error_bars and is_corrected(run.scene)
            if corrects and self._improved is not None and self._improved[0] == self.speed:
                term = by_both(term, goals, unit, self._improved[1])
            self._improved = self.speed, goals.loads(unit / goals.allowance)
            self.known.terms["discretisation"] = term
            error = self.goal.error(force, couple, term.force, term.couple)
            if self.numerics.accuracy != "verdict" and error <= self.asked:
                return error, None  # there is no next mesh
            parts = [goals.shares(unit * goal) for goal in self.goal.goals(force, couple)]
            return error, gathered(run.domain.mesh, parts)

    def _solved(self, run: Run) -> tuple[Forces | None, Couples | None]:
        """Solve for the load whose errors are looked at, with the flow `speed` times that of the scene. Collective."""
        return loads_at(run, self.speed)

    def _handed_over(self, run: Run) -> SearchRecorder:
        """Hands the solution over to the recorder, without error bars. Collective."""
        chosen = ("order", "tolerance", "mesh_size")
        asked = changed(run.scene, numerics={name: getattr(self.numerics, name) for name in chosen})
        recorder = SearchRecorder(self.recorder, asked, self.adaptation_beside)
        hand_over(run, cast(Recorder, recorder))
        return recorder

    def _concluded(self, run: Run, recorder: SearchRecorder) -> Result:
        """Estimate the errors of the solution that has been handed over, and end with it. Collective."""
        finished(run, cast(Recorder, recorder))
        return recorder.result

    def _repeated(self, attempt: Attempt) -> Result:
        """Solve once more on a mesh that was solved on before. Collective."""
        self.known.terms.pop("discretisation", None)
        with self._prepared(attempt) as run:
            self._solved(run)
            return self._concluded(run, self._handed_over(run))

    def _next_mesh(self, attempt: Attempt, error: float | None, shares: Shares | None) -> Attempt | None:
        """The next mesh, or nothing once the accuracy is reached or cannot be."""
        assert error is not None
        if error <= self.asked:
            self.conclude(error, self.known.terms["discretisation"].doubt)
            return None
        assert shares is not None
        if np.isinf(error):  # the safety factor may be infinite: how much finer is enough is not known
            return self._for_verdict(attempt, error, shares)
        orders = self.scene.gdim, self._highest
        higher, left = next_order(order_of(attempt.scene).number, error / self.asked, *orders)
        return self._finer(attempt, higher, 1.0 / left, shares, error)

    @property
    def _highest(self) -> int:
        return highest_order(self.scene.gdim, self.scene.fluid.inertia)

    def _for_verdict(self, attempt: Attempt, error: float, shares: Shares) -> Attempt:
        """A mesh on which the error is expected to be `FOR_VERDICT` times that on this one."""
        before, orders = order_of(attempt.scene).number, (self.scene.gdim, self._highest)
        order = cheapest_order(before, 1.0 / FOR_VERDICT, *orders)
        return self._finer(attempt, order, FOR_VERDICT, shares, error)

    def _finer(self, attempt: Attempt, order: int, relative: float, shares: Shares, error: float) -> Attempt:
        """A mesh on which the error is expected to be `relative` times that in elements of an order on this one."""
        together = self.comm.bcast(float(np.sum(shares.errors)), root=0)
        # As far as contributions cancel, their sum may be larger than the error.
        cancelling = float(np.clip(error / max(together, 1e-300) * CANCELLING, None, 1.0))
        wanted = resized(shares, order, relative * cancelling, self.comm)
        per_vertex, before = UNKNOWNS[self.scene.gdim], order_of(attempt.scene).number
        unknowns = self.trials[-1].unknowns * per_vertex[order] / per_vertex[before] * wanted.more_cells
        sizing = partial(coarse_sizes, COARSEST, wanted.field)
        return Attempt(self._set_up(attempt.scene, order), sizing, unknowns)

    def _within_budget(self, attempt: Attempt | None) -> Attempt | None:
        """The attempt if the budget allows it; else None, with the reason noted."""
        if attempt is None:
            return None
        last = self.trials[-1]
        seconds = last.seconds * max(1.0, attempt.expected / last.unknowns) ** TIME_GROWTH
        self.reason = self.beyond_budget(seconds, attempt.expected)
        if not self.reason and len(self.trials) >= MOST_MESHES:
            self.reason = f"not reached with {MOST_MESHES} meshes"
        return None if self.reason else attempt

    def _to_decide(
        self, attempt: Attempt, error: float, bars: ErrorBars, shares: Shares | None
    ) -> Attempt | None:
        """The next mesh, gap or domain, or nothing once the verdict is decided or cannot be."""
        bar = bars.safety
        assert bar is not None
        if bar.certain and bars.failed:
            why = "; ".join(f"that of the {name}: {reason}" for name, reason in bars.failed.items())
            self.reason = f"undecided: certain but for errors that are not known, {why}"
            return None
        if bar.certain:
            self.reason, self.met = "the verdict is certain", True
            return None
        decisive = bar.decisive
        if decisive == "discretisation" and error > CRITICAL:
            assert shares is not None
            finer = self._for_verdict(attempt, error, shares)
            return replace(finer, note=", ".join(filter(None, (finer.note, "for the verdict"))))
        other = with_less_of(decisive, attempt.scene)
        if other is None:
            between = f"the safety factor is between {bar.low:.6g} and {bar.high:.6g}"
            self.reason = f"undecided: {between}, and the error of the {decisive} cannot be made smaller"
            return None
        for name in ("gap", "domain", "datum"):
            self.known.terms.pop(name, None)
        unknowns = 1.2 * self.trials[-1].unknowns
        return replace(attempt, scene=other[0], expected=unknowns, note=other[1])


def with_less_of(term: str, scene: Scene) -> tuple[Scene, str] | None:
    """The scene with a smaller gap or a larger domain, and a note on it; None if neither is possible."""
    if term == "gap" and scene.contact is not None and scene.contact.gap > SMALLEST_GAP:
        gap = max(CLOSER * scene.contact.gap, SMALLEST_GAP)
        return changed(scene, contact={"gap": gap}), f"gap {gap:.3g} of the grain's size"
    if term == "domain" and not has_no_far_sides(scene):
        larger = farther(scene)
        return larger, f"domain {' x '.join(f'{one:.3g}' for one in larger.domain.extents)}"
    return None

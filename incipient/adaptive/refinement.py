"""Steady flow to a given accuracy: from mesh to mesh by what each vertex contributes to the error.

The first mesh is as coarse as the geometry allows, in elements of the scene's order. The dual-weighted residual
(`dual`) gives the error of the quantity asked for and what each vertex has to do with it, and from that
follow the sizes of the next mesh's cells (`sizing`). A higher order is chosen where it is expected to need
fewer unknowns (`cheapest_order`).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, cast

import numpy as np

from ..accuracy.coarse_runs import changed, farther
from ..accuracy.discretisation import by_both, by_dual
from ..accuracy.dual import GoalErrors
from ..accuracy.errorbars import error_bars, of_interaction
from ..accuracy.model_terms import has_no_far_sides, is_corrected
from ..arrays import Floats
from ..errors import ConvergenceError, MeshError
from ..interrupt import told_where_kept
from ..planning.flow_setup import has_inertia, order_of
from ..planning.layout import coarse_sizes
from ..results.adaptation import Trial
from ..results.errorbars import ErrorBars, Loads, Term
from ..results.loads import Couples, Forces
from ..results.result import Result
from ..scene import Scene
from ..simulation.beside import InTurn
from ..simulation.build import prepared
from ..simulation.loads import loads
from ..simulation.recorder import Recorder
from ..simulation.simulate import finished, hand_over, loads_of
from ..simulation.state import Run
from ..simulation.steady import loads_at
from .modelling import SMALLEST_GAP
from .orders import (
    COARSEST,
    GAIN,
    MOST_MESHES,
    OF_CORRECTED,
    ORDERS,
    UNKNOWNS,
    cheapest_order,
    coarsest,
    highest_order,
    left_for_corrected,
    next_order,
)
from .search import AccuracySearch, Attempt, SearchRecorder
from .sizing import Shares, gathered, resized

CANCELLING = 4.0  # most that contributions of the next mesh are trusted to cancel
MOST_FAILURES = 3
SOLVER_SHARE = 1e-3  # of the accuracy: what the iteration may leave
TOLERANCES = (1e-10, 1e-5)
TIME_GROWTH = 1.3  # of the time to solve and estimate with unknowns
FOR_VERDICT = 0.2  # what is left of an error that is to decide a verdict
CLOSER = 0.25  # a gap that is to decide a verdict, relative to before
# An error, relative to that on the mesh before, up to which a mesh is worth it; how much larger it is tried at once
# where a budget does not allow less.
WORTH, MILDER = 0.5, 1.5
CORRECTED = (
    0.05,
    1.0,
)  # between which the error of corrected loads over that estimated is believed
CRITICAL = 1e-4  # a safety factor known this well and still on both sides of one


@dataclass(frozen=True)
class Kept:
    """An attempt that was solved, its error, infinite where that is not known, and its discretisation's term."""

    attempt: Attempt
    error: float
    term: Term | None


class Refinement(AccuracySearch):
    """Search for the mesh of steady flow: cells by the error that each vertex contributes."""

    _failures = 0
    _improved: tuple[float, Loads] | None = None  # speed and improved loads of the mesh before
    _plain = np.inf  # the error of the quantity on the last mesh without corrections
    _of_corrected = OF_CORRECTED
    _kept: Kept | None = None  # the mesh with the least error so far
    _at_hand: tuple[Run, ExitStack] | None = (
        None  # the run of the first attempt, solved for the coarse runs
    )
    _solved_run: Run | None = None  # it, once it is tried

    def _first(self, part: float = 1.0) -> Attempt:
        factor = part * coarsest(self.scene.gdim, has_inertia(self.scene))
        sizing = partial(coarse_sizes, factor, None)
        return Attempt(self._set_up(self.scene, order_of(self.scene).number), sizing)

    def _after_failure(self, attempt: Attempt, error: ConvergenceError | MeshError) -> Any:
        """A finer first mesh; after others the result on the last of them."""
        self._failures += 1
        self.report(Trial(order_of(attempt.scene).number, 0, 0, None, 0.0, note=str(error)))
        if self._kept is not None:
            self.reason = f"the next mesh failed: {error}"
            return self._repeated(self._kept)
        if self._failures == MOST_FAILURES:
            raise error
        return self._first(0.5**self._failures)

    def _set_up(self, scene: Scene, order: int) -> Scene:
        asked = self.numerics.accuracy
        wanted = SOLVER_SHARE * (asked if isinstance(asked, float | int) else CRITICAL)
        tolerance = float(np.clip(wanted, *TOLERANCES))
        return changed(scene, numerics={"order": order, "tolerance": tolerance})

    @contextmanager
    def _prepared(self, attempt: Attempt) -> Iterator[Run]:
        """The run of an attempt, whose costs and estimates are those of the search. Collective."""
        if self._at_hand is not None:
            (run, held), self._at_hand = self._at_hand, None
            with held:
                self._solved_run = run
                yield run
            self._solved_run = None
            return
        with prepared(
            attempt.scene, self.comm, self.accounts, voice=self.voice, sizing=attempt.sizing
        ) as run:
            yield run

    def choose_gap_and_domain(self) -> None:
        """Choose gap and domain before any mesh, if the accuracy includes their errors. Collective."""
        if self._has_one_order:  # coarse runs then are on the first mesh
            self.scene = self._set_up(self.scene, order_of(self.scene).number)
        super().choose_gap_and_domain()

    def _coarse_runs(self) -> InTurn:
        return InTurn(self.comm, loads_of, self._for_coarse_runs if self._has_one_order else None)

    def _for_coarse_runs(self, coarse: Scene) -> AbstractContextManager[Run]:
        """The run of the first attempt, with the gap and domain of a coarse run. Collective."""
        own = changed(coarse, numerics=self.scene.numerics.model_dump())
        return self._prepared(replace(self._first(), scene=own))

    def _take_over(self, solve: InTurn) -> None:
        self._at_hand = solve.handed_over(self._first().scene)

    @property
    def _has_one_order(self) -> bool:
        """Whether all meshes are of order two, in steady flow in space with inertia."""
        return (
            self._highest == ORDERS[0] and self.scene.time is None and not self.scene.has_wall_layer
        )

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
            self._keep(attempt, error)
            if error is None or self.numerics.accuracy != "verdict":
                following = self._within_budget(self._next_mesh(attempt, error, shares))
                if (
                    following is None
                    and self._kept is not None
                    and self._kept.attempt is not attempt
                ):
                    return self._repeated(self._kept)
                return following or self._concluded(run, self._handed_over(run))
            # Coarse runs come next, for the error bars: what has been found outlasts an interrupt.
            recorder = self._handed_over(run)
            with told_where_kept(recorder.kept, self.comm):
                bars = error_bars(
                    run, force, couple, lambda scene: loads_of(scene, self.comm, self.speed)
                )
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
            term, before = by_dual(goals, unit), self._plain
            self._plain = self.goal.error(force, couple, term.force, term.couple)
            if self._corrects and self._improved is not None and self._improved[0] == self.speed:
                term = by_both(term, goals, unit, self._improved[1])
                agreed = self.goal.error(force, couple, term.force, term.couple) / before
                self._of_corrected = (
                    float(np.clip(agreed, *CORRECTED)) if agreed < np.inf else OF_CORRECTED
                )
            self._improved = self.speed, goals.loads(unit / goals.allowance)
            self.known.terms["discretisation"] = term
            of_force, of_couple = self._with_interaction(term, Loads(force.flow, couple.flow))
            error = self.goal.error(force, couple, of_force, of_couple)
            if self.numerics.accuracy != "verdict" and error <= self.asked:
                return error, None  # there is no next mesh
            parts = [goals.shares(unit * goal) for goal in self.goal.goals(force, couple)]
            return error, gathered(run.domain.mesh, parts)

    @property
    def _corrects(self) -> bool:
        """Whether loads are corrected by their estimated errors."""
        return self.numerics.error_bars and is_corrected(self.scene)

    def _with_interaction(self, term: Term, computed: Loads) -> tuple[Floats, Floats]:
        """Errors (3,) of force and couple by a term, with what its correction and those of gap and domain interact."""
        others = self.suited.terms if self.suited is not None else ()
        between = of_interaction(ErrorBars((*others, term), {}, {}), computed)
        if between is None:
            return term.force, term.couple
        return term.force + between.force, term.couple + between.couple

    def _solved(self, run: Run) -> tuple[Forces | None, Couples | None]:
        """Solve for the load whose errors are looked at, with the flow `speed` times that of the scene. Collective."""
        return loads(run, surface=False) if run is self._solved_run else loads_at(run, self.speed)

    def _keep(self, attempt: Attempt, error: float | None) -> None:
        """Keep an attempt, if no other one had a smaller error of the same; for a verdict scenes change, too."""
        now, before = np.inf if error is None else error, self._kept
        if before is None or now <= before.error or self.numerics.accuracy == "verdict":
            self._kept = Kept(attempt, now, self.known.terms.get("discretisation"))

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

    def _repeated(self, kept: Kept) -> Result:
        """Solve once more on a mesh that was solved on before; its error is known. Collective."""
        self.known.terms.pop("discretisation", None)
        if kept.term is not None:
            self.known.terms["discretisation"] = kept.term
        self.of_result = kept.error if np.isfinite(kept.error) else None
        with self._prepared(kept.attempt) as run:
            self._solved(run)
            return self._concluded(run, self._handed_over(run))

    def _next_mesh(
        self, attempt: Attempt, error: float | None, shares: Shares | None
    ) -> Attempt | None:
        """The next mesh, or nothing once the accuracy is reached or cannot be."""
        assert error is not None
        if error <= self.asked:
            self.conclude(error, self.known.terms["discretisation"].doubt)
            return None
        assert shares is not None
        if np.isinf(
            error
        ):  # the safety factor may be infinite: how much finer is enough is not known
            return self._for_verdict(attempt, error, shares)
        order = order_of(attempt.scene).number
        if self._has_one_order and self._corrects:
            left = left_for_corrected(self._plain / self.asked, self._of_corrected)
            return self._affordable(attempt, order, left, shares, self._plain)
        higher, excess = next_order(order, error / self.asked, self.scene.gdim, self._highest)
        return self._affordable(attempt, higher, 1.0 / excess, shares, error)

    def _affordable(
        self, attempt: Attempt, order: int, relative: float, shares: Shares, error: float
    ) -> Attempt:
        """The mesh with a relative error, or if the budget does not allow that one, with the least that it allows.

        If it allows none that is worth it, the mesh wanted.
        """
        before, wanted = (
            order_of(attempt.scene).number,
            self._finer(attempt, order, relative, shares, error),
        )
        if not self._beyond(wanted):
            return wanted
        for other in range(order, before - 1, -1):
            left = relative * GAIN ** (order - other)
            while left * GAIN ** (other - before) < WORTH:
                left *= MILDER
                found = self._finer(attempt, other, left, shares, error)
                if not self._beyond(found):
                    return found
        return wanted

    @property
    def _highest(self) -> int:
        return highest_order(self.scene.gdim, has_inertia(self.scene))

    def _for_verdict(self, attempt: Attempt, error: float, shares: Shares) -> Attempt:
        """A mesh on which the error is expected to be `FOR_VERDICT` times that on this one."""
        before, orders = order_of(attempt.scene).number, (self.scene.gdim, self._highest)
        order = cheapest_order(before, 1.0 / FOR_VERDICT, *orders)
        return self._finer(attempt, order, FOR_VERDICT, shares, error)

    def _finer(
        self, attempt: Attempt, order: int, relative: float, shares: Shares, error: float
    ) -> Attempt:
        """A mesh on which the error is expected to be `relative` times that in elements of an order on this one."""
        together = self.comm.bcast(float(np.sum(shares.errors)), root=0)
        # As far as contributions cancel, their sum may be larger than the error.
        cancelling = float(np.clip(error / max(together, 1e-300) * CANCELLING, None, 1.0))
        wanted = resized(shares, order, relative * cancelling, self.comm)
        per_vertex, before = UNKNOWNS[self.scene.gdim], order_of(attempt.scene).number
        unknowns = (
            self.trials[-1].unknowns * per_vertex[order] / per_vertex[before] * wanted.more_cells
        )
        sizing = partial(coarse_sizes, COARSEST, wanted.field)
        return Attempt(self._set_up(attempt.scene, order), sizing, unknowns)

    def _within_budget(self, attempt: Attempt | None) -> Attempt | None:
        """The attempt if the budget allows it; else None, with the reason noted."""
        if attempt is None:
            return None
        self.reason = self._beyond(attempt)
        if not self.reason and len(self.trials) >= MOST_MESHES:
            self.reason = f"not reached with {MOST_MESHES} meshes"
        return None if self.reason else attempt

    def _beyond(self, attempt: Attempt) -> str:
        """Reason why an attempt exceeds the budget, or "". Collective."""
        last = self.trials[-1]
        seconds = last.seconds * max(1.0, attempt.expected / last.unknowns) ** TIME_GROWTH
        return self.beyond_budget(seconds, attempt.expected)

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
            self.reason = (
                f"undecided: {between}, and the error of the {decisive} cannot be made smaller"
            )
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

"""Searches by refinement of cells by their contribution, of all cells uniformly, or of cells and time steps."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import IncipientError, Interrupted, MeshError
from ..interrupt import told_where_kept
from ..planning.discretisation import order_of
from ..planning.meshing import coarse_sizes
from ..planning.sizes import coarsest as coarsest_at_walls
from ..results.errorbars import Loads
from ..scene import Scene
from ..scene.sections import MESH_SIZES, OF_WALLS
from ..setup.setup import Setup
from ..simulation.assemble import outcome
from ..simulation.loads import loads_of_run
from ..simulation.simulate import loads_of, solved
from ..simulation.state import Accounts, Run
from ..simulation.steady import loads_at, unit_of
from .coarse_runs import (
    COARSER_MESH,
    changed,
    kept_runs,
    on_coarser_mesh,
    order_in_time,
)
from .dual import GoalErrors, gathered, resized
from .first_mesh import COARSEST, coarsest, first_in_time, first_size, resized_in_time
from .goal import relative
from .search import Attempt, Estimate, Search
from .terms import (
    by_both,
    by_coarser_mesh,
    by_coarser_runs,
    by_dual,
    is_corrected,
    order_in_space,
)

CANCELLING = 4.0  # bound on the assumed cancellation of contributions on the next mesh
TIME_GROWTH = 1.3  # power of the unknowns in the time of solution and estimate (docs/validation/performance.md)
# Fraction left of an estimated error on cells smaller by `dual.COARSER_CELLS`: 1.5^-4.
COMPARED = 0.2
MOST_UNIFORM, MOST_RUNS = 8, 6  # meshes of mean flow, and runs of unsteady flow
# Power of the inverse cell size in the work (`make bench`: 0.8 to 1.7, 2 for uniform cells).
WORK_POWER = 1.5
HALVED = 0.5, 0.5**0.5  # factors on steps and cells for an error of unknown origin
FINEST = 1 / 16, 1 / 4  # least factors in one step: estimates are poor for much finer runs


class DualWeighted(Search):
    """Cells refined by their dual-weighted contributions to the error."""

    _improved: tuple[Any, Loads] | None = None  # of the previous mesh: speed, gap and domain; loads
    _plain = np.inf  # error of the uncorrected quantity on the last mesh

    def first(self, failures: int = 0) -> Attempt:
        factor = 0.5**failures * coarsest(self.scene)
        return Attempt(self.scene, partial(coarse_sizes, factor, None))

    def solve(self, run: Run) -> Loads:
        force, torque = loads_at(run, self.speed)
        return Loads(force.flow, torque.flow)

    def estimate(self, run: Run, computed: Loads) -> Estimate:
        assert run.layout.placement is not None
        with GoalErrors(run.fluid, "body", run.layout.placement.centre) as goals:
            plain = unit_of(run, self.speed)
            unit = goals.allowance * plain
            term = by_dual(goals, unit)
            self._plain = self.goal.error(computed, term.force, term.torque)
            here = self.speed, run.scene.contact, run.scene.domain
            before, self._improved = self._improved, (here, goals.loads(plain))
            if self._corrects and before is not None and before[0] == here:
                term = by_both(term, goals, unit, before[1])
            self.known.terms["discretisation"] = term
            error = self.goal.error(computed, term.force, term.torque)
            if error <= self.allowed:
                return Estimate(error, term, term.doubt)  # no next mesh
            parts = [goals.shares(unit * goal) for goal in self.goal.goals(computed)]
            shares = gathered(run.domain.mesh, parts)
        return Estimate(error, term, term.doubt, shares=shares)

    def target(self, estimate: Estimate) -> float:
        """The fraction of the error to leave.

        In 3-D the error of a corrected load follows from the previous mesh: cells smaller by a fixed factor suffice.
        """
        wanted = super().target(estimate)
        return max(wanted, COMPARED) if self.scene.gdim == 3 and self._corrects else wanted

    def refined(self, attempt: Attempt, estimate: Estimate, left: float) -> Attempt:
        shares = estimate.shares
        together = self.comm.bcast(float(np.sum(shares.errors)), root=0)
        # Contributions may cancel: their sum may exceed the error.
        cancelling = min(self._plain / max(together, 1e-300) * CANCELLING, 1.0)
        field, more = resized(shares, order_of(attempt.scene), cancelling * left, self.comm)
        sizing = partial(coarse_sizes, COARSEST, field)
        unknowns = more * self.trials[-1].unknowns
        return Attempt(attempt.scene, sizing, unknowns, max(1.0, more) ** TIME_GROWTH)

    @property
    def _corrects(self) -> bool:
        return self.numerics.error_bars and is_corrected(self.scene)


class Uniform(Search):
    """Uniform refinement of a steady mean flow, each mesh compared with the two previous ones.

    Flow and turbulence have no dual solution.
    """

    most = MOST_UNIFORM
    _seen: list[tuple[Scene, Loads]]  # by mesh

    def first(self, failures: int = 0) -> Attempt:
        self._seen = []
        return self._on(self.scene, first_size(self.scene, failures))

    def _on(
        self, scene: Scene, mesh_size: float, unknowns: float = 0.0, work: float = 1.0
    ) -> Attempt:
        sized = changed(scene, numerics={"mesh_size": mesh_size})
        note = f"mesh_size {mesh_size:.3g}"
        return Attempt(sized, unknowns=unknowns, work=work, note=note)

    def estimate(self, run: Run, computed: Loads) -> Estimate:
        walls = run.wall_report()
        doubt = "" if walls is None else walls.doubt
        self._seen.append((run.scene, computed))
        coarser = on_coarser_mesh(run.scene)
        if len(self._seen) < 3 or coarser.numerics.mesh_size > coarsest_at_walls(Setup(self.scene)):
            return Estimate(None)
        for scene, there in reversed(self._seen[-3:-1]):
            if (scene.contact, scene.domain) == (coarser.contact, coarser.domain):
                self.known.loads[coarser.model_dump_json()] = there
            coarser = on_coarser_mesh(coarser)
        runs = kept_runs(self.known.loads, self.spent, lambda each: loads_of(each, self.comm))
        term = by_coarser_mesh(run.scene, computed, runs)
        self.known.terms["discretisation"] = term
        error = relative(self.goal, computed, term.with_changes(computed.unsteady))
        if self.goal.name == OF_WALLS and walls is not None and "shear_velocity" in term.others:
            of_walls = term.others["shear_velocity"] / walls.shear_velocities
            error = float(of_walls[walls.leading])
        return Estimate(error, term, doubt)

    def refined(self, attempt: Attempt, estimate: Estimate, left: float) -> Attempt:
        mesh_size = attempt.scene.numerics.mesh_size / COARSER_MESH
        if mesh_size < MESH_SIZES[0]:
            raise MeshError(
                f"numerics.mesh_size would be below {MESH_SIZES[0]:g}: use a larger numerics.accuracy"
            )
        more = COARSER_MESH**attempt.scene.gdim
        unknowns = more * self.trials[-1].unknowns
        return self._on(attempt.scene, mesh_size, unknowns, more**TIME_GROWTH)


class InTime(Search):
    """Time steps and cells of unsteady flow, each refined to half of the error aimed at."""

    most = MOST_RUNS

    def first(self, failures: int = 0) -> Attempt:
        steps, cells = HALVED
        return Attempt(resized_in_time(first_in_time(self.scene), steps**failures, cells**failures))

    @contextmanager
    def solved(self, attempt: Attempt) -> Iterator[tuple[Run, Loads]]:
        # Separate times of each run.
        accounts = Accounts(known=self.known, spent=self.spent, described=self.with_search)
        with solved(attempt.scene, self.comm, self.recorder, self.voice, accounts=accounts) as run:
            yield run, loads_of_run(run)

    def record(self, run: Run) -> Path | None:
        self._recorded = run
        return self.recorder.provisional(outcome(run))

    def estimate(self, run: Run, computed: Loads) -> Estimate:
        runs = kept_runs(self.known.loads, lambda: "", lambda each: loads_of(each, self.comm))
        try:
            with told_where_kept(self.record(run), self.comm):
                term = by_coarser_runs(run.scene, computed, runs)
        except Interrupted:
            raise
        except IncipientError as error:
            return Estimate(None, note=f"not compared: {error}")
        self.known.terms["discretisation"] = term
        whole, of_step, of_mesh = (
            relative(self.goal, computed, each) for each in (term, *term.parts)
        )
        return Estimate(whole, term, term.doubt, parts=(of_step, of_mesh))

    def refined(self, attempt: Attempt, estimate: Estimate, left: float) -> Attempt:
        scene, parts = attempt.scene, np.array(estimate.parts, dtype=float)
        factors = np.array(HALVED)
        if np.isfinite(parts).all():
            orders = order_in_time(scene), order_in_space(order_of(scene))
            wanted = 0.5 * left * parts.sum() / np.maximum(parts, 1e-300)
            factors = np.clip(wanted ** np.divide(1.0, orders), FINEST, 1.0)
        steps, cells = factors.tolist()
        more = cells**-WORK_POWER
        unknowns = self.trials[-1].unknowns * more
        return Attempt(resized_in_time(scene, steps, cells), unknowns=unknowns, work=more / steps)

"""Searches by refinement of cells by their contribution, or of all cells and time steps."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from ..errors import IncipientError, Interrupted, MeshError
from ..interrupt import told_where_kept
from ..planning.discretisation import order_of
from ..planning.meshing import coarse_sizes
from ..results.errorbars import Loads
from ..scene import Scene
from ..scene.sections import MESH_SIZES
from ..simulation.state import Run
from .coarse_runs import (
    COARSER_MESH,
    REMEDY,
    kept_runs,
    on_coarser_mesh,
    order_in_time,
)
from .dual import by_both, by_dual, errors_of_run, gathered, resized
from .errorbars import nearby
from .first_mesh import COARSEST, Attempt, on_all_cells, rescaled
from .goal import relative
from .search import Estimate, Search
from .terms import (
    by_coarser_mesh,
    by_coarser_runs,
    is_corrected,
    order_in_space,
)

TIME_GROWTH = 1.3  # power of the unknowns in the time of solution and estimate (docs/validation/performance.md)
# Fraction left of an estimated error on cells smaller by the factor of `dual.improved_loads`: 1.5^-4.
COMPARED = 0.2


class DualWeighted(Search):
    """Cells refined by their dual-weighted contributions to the error."""

    _improved: tuple[Any, Loads] | None = None  # of the previous mesh: speed, gap and domain; loads
    _plain = np.inf  # error of the uncorrected quantity on the last mesh

    def estimate(self, run: Run, computed: Loads) -> Estimate:
        with errors_of_run(run, self.speed) as goals:
            term = by_dual(goals)
            self._plain = self.goal.error(computed, term.load)
            here = self.speed, run.scene.contact, run.scene.domain
            before, self._improved = self._improved, (here, goals.improved)
            if self._corrects and before is not None and before[0] == here:
                term = by_both(term, goals, before[1])
            error = self.goal.error(computed, term.load)
            if error <= self.allowed:
                return Estimate(error, term, term.doubt)  # no next mesh
            parts = [goals.shares(goals.allowance * goal) for goal in self.goal.goals(computed)]
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
        # Contributions may cancel: their sum may exceed the error, on the next mesh up to four times less so.
        cancelling = min(self._plain / max(together, 1e-300) * 4.0, 1.0)
        field, more = resized(shares, order_of(attempt.scene), cancelling * left, self.comm)
        sizing = partial(coarse_sizes, COARSEST, field)
        return Attempt(attempt.scene, sizing, more, max(1.0, more) ** TIME_GROWTH)

    @property
    def _corrects(self) -> bool:
        return self.numerics.error_bars and is_corrected(self.scene)


class Compared(Search):
    """Cells, in unsteady flow also time steps, refined until coarser runs agree, for flows without a dual solution.

    The coarser runs of a mean flow are its last two meshes.
    """

    most = 8  # runs
    _seen: list[tuple[Scene, Loads]]  # by mesh

    def first(self, failures: int = 0) -> Attempt:
        self._seen = []
        return super().first(failures)

    def estimate(self, run: Run, computed: Loads) -> Estimate:
        scene, walls, steady = run.scene, run.wall_report(), run.scene.time is None
        if steady:
            self._seen.append((scene, computed))
            if len(self._seen) < 3:
                return Estimate(None)
            self._keep_coarser_meshes(scene)
        # Without its comparison nothing is known of an unsteady run.
        spent = self.spent if steady else lambda: ""
        runs = kept_runs(self.accounts.loads, spent, nearby(run, self.speed))
        compare = by_coarser_mesh if steady else by_coarser_runs
        try:
            with told_where_kept(None if steady else self.provisional(run), self.comm):
                term = compare(scene, computed, runs)
        except Interrupted:
            raise
        except IncipientError as why:
            return Estimate(None, note=f"not compared: {REMEDY.split(str(why))[0]}")
        changing = term.with_changes(computed.unsteady)
        error, *parts = (relative(self.goal, computed, each) for each in (changing, *term.parts))
        if walls is not None:
            return Estimate(error, term, walls.doubt)
        return Estimate(error, term, term.doubt, parts=tuple(parts))

    def _keep_coarser_meshes(self, scene: Scene) -> None:
        coarser = on_coarser_mesh(scene)
        for before, there in reversed(self._seen[-3:-1]):
            if (before.contact, before.domain) == (coarser.contact, coarser.domain):
                self.accounts.loads[coarser.model_dump_json()] = there
            coarser = on_coarser_mesh(coarser)

    def refined(self, attempt: Attempt, estimate: Estimate, left: float) -> Attempt:
        scene, parts = attempt.scene, np.array(estimate.parts, dtype=float)
        steady = scene.time is None
        factors = np.array([1.0 if steady else 0.5, 1.0 / COARSER_MESH])
        if parts.size and np.isfinite(parts).all():
            orders = order_in_time(scene), order_in_space(order_of(scene))
            wanted = 0.5 * left * parts.sum() / np.maximum(parts, 1e-300)
            # Estimates are poor for much finer steps and cells.
            factors = np.clip(wanted ** np.divide(1.0, orders), (1 / 16, 1 / 4), 1.0)
        steps, cells = factors.tolist()
        if cells * scene.numerics.mesh_size < MESH_SIZES[0]:
            raise MeshError(
                f"numerics.mesh_size would be below {MESH_SIZES[0]:g}: use a larger numerics.accuracy"
            )
        growth = cells ** -(scene.gdim if steady else 1.5)
        # In unsteady flow the measured power of the cells in the work is 0.8 to 1.7 (`make bench`).
        work = growth**TIME_GROWTH if steady else growth / steps
        return on_all_cells(rescaled(scene, steps, cells), growth, work)

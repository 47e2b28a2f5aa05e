"""Steady mean flow to an accuracy: all cells become smaller alike, until coarser meshes differ by little.

No dual solution of flow, k and epsilon or omega is there to say which cells an error comes from. Each mesh has cells
smaller by the root of two than the one before, and is compared with the two before it
(`discretisation.by_coarser_mesh`), so that no run is made for an estimate alone.
"""

from __future__ import annotations

from typing import Any

from ..accuracy.coarse_runs import COARSER_MESH, changed, on_coarser_mesh
from ..accuracy.discretisation import COARSEST_IN_SPACE, by_coarser_mesh
from ..accuracy.goal import LoadsOnMesh, relative
from ..errors import ConvergenceError, MeshError
from ..planning.flow_setup import Setup, order_of
from ..planning.wall_cells import coarsest
from ..results.errorbars import Loads
from ..results.loads import Couples, Forces
from ..scene import Scene
from ..simulation.loads import loads
from ..simulation.state import Run
from ..simulation.steady import solve_with_parts
from .orders import COARSEST
from .refinement import MOST_FAILURES, Refinement
from .search import Attempt

SMALLEST, LARGEST = 0.01, 100.0  # of numerics.mesh_size
# Meshes on which an error is no longer seen to fall, by so much at the least, before the search ends.
LOOKED_AT, LEAST_FALL = 3, 0.8


class UniformRefinement(Refinement):
    """Search for the mesh of steady flow with wall layers: all cells smaller alike."""

    def __init__(self, *arguments: Any):
        super().__init__(*arguments)
        self._seen: list[
            tuple[Scene, Loads]
        ] = []  # on meshes one after the other, the present one last
        # Why walls are not as the model asks on the present one, and whether they may be so on a finer one.
        self._doubt, self._may_resolve = "", False

    def _first(self, part: float = 1.0) -> Attempt:
        self._seen = []
        most = COARSEST_IN_SPACE if self.scene.resolves_uneven_walls else LARGEST
        return self._on(self.scene, min(part * COARSEST * self.numerics.mesh_size, most))

    def _on(self, scene: Scene, mesh_size: float, expected: float = 0.0) -> Attempt:
        """An attempt with a `numerics.mesh_size`."""
        sized = changed(
            self._set_up(scene, order_of(scene).number), numerics={"mesh_size": mesh_size}
        )
        return Attempt(sized, expected=expected, note=f"mesh_size {mesh_size:.3g}")

    def _solved(self, run: Run) -> tuple[Forces | None, Couples | None]:
        solve_with_parts(run, run.fluid, run.parts)
        return (None, None) if run.probe is None else loads(run, surface=False)

    def _estimated(
        self, run: Run, force: Forces | None, couple: Couples | None
    ) -> tuple[float | None, Any]:
        walls = run.wall_report()
        self._doubt = "" if walls is None or walls.applicable else walls.doubt
        self._may_resolve = walls is not None and walls.by_cells
        found = LoadsOnMesh(force, couple, None, walls)
        size = 1.0 if run.scene.grain is None else run.scene.grain.size
        computed = Loads.at_the_end(force, couple, None, None, walls, size)
        self._seen.append((run.scene, computed))
        coarser = on_coarser_mesh(run.scene)
        if len(self._seen) < 3 or coarser.numerics.mesh_size > coarsest(Setup(self.scene)):
            return None, None
        coarser = run.scene
        for scene, there in reversed(self._seen[-3:-1]):
            coarser = on_coarser_mesh(coarser)
            if (scene.contact, scene.domain) == (coarser.contact, coarser.domain):
                self.known.loads[coarser.model_dump_json()] = there
        term = self.known.terms["discretisation"] = by_coarser_mesh(
            run.scene, computed, self.kept_runs()
        )
        return relative(self.goal, found, term.with_changes(computed.unsteady)), None

    def _keep(self, attempt: Attempt, error: float | None) -> None:
        """Keep an attempt as others do; one whose walls are not as the model asks as if it had no estimate."""
        super()._keep(attempt, None if self._doubt and self._may_resolve else error)

    def _next_mesh(self, attempt: Attempt, error: float | None, shares: Any) -> Attempt | None:
        enough = not self._doubt or not self._may_resolve
        if error is not None and error <= self.asked and enough:
            self.conclude(error, self._doubt)
            return None
        known = [trial.estimate for trial in self.trials if trial.estimate is not None]
        many = error is not None and len(known) > LOOKED_AT
        if many and min(known[-LOOKED_AT:]) > LEAST_FALL * known[-LOOKED_AT - 1]:
            self.reason = (
                f"not reached: on the last {LOOKED_AT} meshes the error has hardly fallen any more"
            )
            return None
        return self._finer(attempt, order_of(attempt.scene).number, 0.0, shares, 0.0)

    def _after_failure(self, attempt: Attempt, error: ConvergenceError | MeshError) -> Any:
        """A finer first mesh as long as none has an estimate: coarse ones may have no flow."""
        kept, first = self._kept, all(trial.estimate is None for trial in self.trials)
        if first and self._failures + 1 < MOST_FAILURES:
            self._kept = None
        found = super()._after_failure(attempt, error)
        self._kept = kept
        return found

    def _finer(
        self, attempt: Attempt, order: int, relative: float, shares: Any, error: float
    ) -> Attempt:
        """The mesh with cells smaller by the root of two, of which there are twice as many at the most."""
        mesh_size = attempt.scene.numerics.mesh_size / COARSER_MESH
        if mesh_size < SMALLEST:
            raise MeshError(
                f"numerics.mesh_size would be below {SMALLEST:g}: enlarge numerics.accuracy"
            )
        more = COARSER_MESH**self.scene.gdim
        return self._on(attempt.scene, mesh_size, more * self.trials[-1].unknowns)

"""Flow in time to a given accuracy: what errs more for its cost is made finer, the time step or the mesh.

Each run is compared with one in longer steps, and that with one in elements of a higher order, which tells the errors
of step and mesh apart (`discretisation.by_coarser_runs`). What the next run has of each, and its order, follow by
`balance`: the least work with which the accuracy is expected. The first run is coarse. A run that is expected to
reach the accuracy is recorded; it is repeated finer if it does not.
"""

from __future__ import annotations

import math
from typing import Any, cast

import numpy as np

from ..accuracy.coarse_runs import HIGHEST_ORDER, LONGEST_STEP, changed, comparisons, order_in_time
from ..accuracy.discretisation import OF_MESH, by_coarser_runs
from ..accuracy.goal import relative
from ..accuracy.kept_runs import KeptRuns
from ..accuracy.waves import is_stream
from ..errors import ConvergenceError, IncipientError, Interrupted, MeshError
from ..planning.cells import FAR_CELL, FAR_CELL_IN_SPACE
from ..planning.open_channel import LEVEL
from ..results.adaptation import Trial
from ..results.errorbars import Loads, Term
from ..results.result import Result
from ..scene import Scene
from ..scene.numerics import OF_SURFACE
from ..simulation.recorder import Recorder, Unrecorded
from ..simulation.simulate import simulate
from ..simulation.state import Accounts
from .balance import WORK_POWER, Parts, Powers, Refined, cheapest, halved, milder
from .search import AccuracySearch, Attempt, Told

# Cells and steps of the first run, relative to those that the scene says.
COARSEST_MESH, LONGEST = 8.0**0.5, 8.0
FEWEST_STEPS = 8
MOST_RUNS = 6
HIGHEST_OF_SURFACE = 3  # order of the velocity beyond which that of the elevation, which is the cells', stays
AIM = 0.7  # of the accuracy, so that the run expected to reach it does
# At least so much more work has a run to be worth it; where a budget does not allow more, as much as it allows.
LEAST_WORK = 4.0


class Balancing(AccuracySearch):
    """From run to run, each with shorter steps, a finer mesh, a higher order, or all of them."""

    _failed = ""  # why the last run could not be compared
    _of_mesh: Term | None = None  # what the mesh of the last run contributes to its error

    def _first(self) -> Attempt:
        return Attempt(first(self.scene))

    def _tried(self, attempt: Attempt) -> Any:
        scene, recorded = attempt.scene, attempt.recorded
        told = self._run(scene, recorded)
        following = None if self.reason else self._following(scene)
        if following is None:
            return told.result if recorded else self._run(scene, recorded=True, again=True).result
        recorded = following.enough or self._is_last_affordable(following)
        self._keep(self._of_mesh if following.keeps_mesh(scene.order) else None)
        return Attempt(finer(scene, following), recorded=recorded)

    def _after_failure(self, attempt: Attempt, error: ConvergenceError | MeshError) -> Any:
        """A finer run, where there was no flow on the mesh in these steps."""
        scene = attempt.scene
        if scene.time is None or isinstance(error, MeshError):
            raise error
        self._keep(None)
        self.tell(Trial(scene.order, 0, 0, None, 0.0, scene.time.step, f"failed: {error}"))
        if len(self.trials) >= MOST_RUNS:
            raise error
        return Attempt(finer(scene, halved(scene.order, Powers(order_in_time(scene)))))

    def _keep(self, of_mesh: Term | None) -> None:
        """Forget what was found about a scene but what the next one shares with it. Not collective."""
        self.known.terms, self.known.loads = {} if of_mesh is None else {OF_MESH: of_mesh}, {}
        self.keep_model_terms()

    # -- one run --------------------------------------------------------------------------------

    def _run(self, scene: Scene, recorded: bool, again: bool = False) -> Told:
        """Run a scene and those it is compared with, estimate its error, and judge it. Collective."""
        began = self.elapsed()
        if not again:
            self._compare(scene)

        def judge(result: Result) -> None:
            """Tell its error, if this run is new and got to its end."""
            if result.status == "complete" and not again:
                self._judge(scene, result, self.elapsed() - began)

        told = Told(self.recorder if recorded else Unrecorded(), scene, self.adaptation_beside, judge)
        quiet = scene if recorded else changed(scene, numerics={"error_bars": False})
        accounts = Accounts(known=self.known, spent=self.spent)  # times of each run are its own
        simulate(quiet, self.comm, cast(Recorder, told), self.voice, accounts=accounts)
        return told

    def _compare(self, scene: Scene) -> None:
        """Run what a scene is compared with, quickly done beside it, or note why that fails. Collective."""
        self._failed = ""
        kept = KeptRuns(self.known.loads, lambda: "", self._loads_of)
        longer, beside = comparisons(scene)
        try:
            kept(longer)
            if OF_MESH not in self.known.terms:
                kept(beside)
        except Interrupted:
            raise
        except IncipientError as error:
            self._failed = f"not compared: {error}"

    def _loads_of(self, scene: Scene) -> Loads:
        return simulate(scene, self.comm).loads_at_end()

    def _judge(self, scene: Scene, result: Result, seconds: float) -> None:
        estimate = of_step = of_mesh = None
        doubt = ""
        cost = result.cost
        if not self._failed:
            term = by_coarser_runs(
                scene, result.loads_at_end(), self._known_run, self.known.terms.get(OF_MESH)
            )
            estimate, of_step, of_mesh = (relative(self.goal, result, one) for one in (term, *term.parts))
            doubt = term.doubt
            # What the mesh does to waves is seen the less the longer the steps are, which damp them.
            self._of_mesh = None if scene.accuracy_of in OF_SURFACE else term.parts[-1]
        order, cells, unknowns = result.plan.order, cost["cells"], cost["unknowns"]
        step = scene.time.step if scene.time is not None else None
        self.tell(Trial(order, cells, unknowns, estimate, seconds, step, self._failed, of_step, of_mesh))
        if estimate is not None and estimate <= self.asked:
            self.conclude(estimate, doubt)

    def _known_run(self, scene: Scene) -> Loads:
        return self.known.loads[scene.model_dump_json()]

    # -- what next ------------------------------------------------------------------------------

    def _following(self, scene: Scene) -> Refined | None:
        """How much finer the next run is, or nothing where there is none, and why. Collective."""
        wanted = refined(scene, self.trials[-1], AIM * self.asked)
        if len(self.trials) >= MOST_RUNS:
            self.reason = f"not reached with {MOST_RUNS} runs"
            return None
        while (beyond := self._beyond(wanted)) and wanted.work > LEAST_WORK:
            wanted = milder(wanted)
        self.reason = beyond
        return None if beyond else wanted

    def _beyond(self, wanted: Refined, further: float = 1.0) -> str:
        """Why a run with so much more work, and one `further` times as dear after it, is not made. Collective."""
        last, more = self.trials[-1], wanted.work
        seconds = last.seconds * more * further
        return self.beyond_budget(seconds, last.unknowns * wanted.finer**-WORK_POWER)

    def _is_last_affordable(self, wanted: Refined) -> bool:
        """Whether after the next run no other is. Collective."""
        return len(self.trials) + 1 >= MOST_RUNS or bool(self._beyond(wanted, 1.0 + LEAST_WORK))


def refined(scene: Scene, trial: Trial, aim: float) -> Refined:
    """How the scene in time is made finer for a relative error, after a trial of it. Not collective."""
    powers = Powers(order_in_time(scene))
    order, of_step, of_mesh = scene.order, trial.of_step, trial.of_mesh
    if of_step is None or of_mesh is None or not math.isfinite(of_step + of_mesh):
        return halved(order, powers)
    # A safety factor may err more than its parts together.
    more = max(1.0, (trial.estimate or 0.0) / (of_step + of_mesh))
    highest = HIGHEST_OF_SURFACE if scene.accuracy_of in OF_SURFACE else HIGHEST_ORDER
    return cheapest(Parts(more * of_step, more * of_mesh), aim, order, powers, highest)


def first(scene: Scene) -> Scene:
    """The scene in time as coarse as the first run: a coarse mesh, and long steps, of which there are a few."""
    assert scene.time is not None
    longer = LONGEST
    while longer > 1.0 and longer * scene.time.step > scene.time.end / FEWEST_STEPS:
        longer /= 2.0
    return _resized(scene, _coarsest(scene), longer)


def _coarsest(scene: Scene) -> float:
    """How much larger the cells of the first run are.

    Where a stream enters below a free surface they are so small that the zone at the inflow, one cell at the least, is
    as long on all meshes, those of one order more included: else its length errs, which the comparison does not tell.
    """
    if not is_stream(scene):
        return COARSEST_MESH
    sizes = FAR_CELL if scene.gdim == 2 else FAR_CELL_IN_SPACE
    suitable = LEVEL / (sizes[min(scene.order + 1, HIGHEST_ORDER)] * scene.numerics.mesh_size)
    return float(np.clip(suitable, 1.0, COARSEST_MESH))


def finer(scene: Scene, wanted: Refined) -> Scene:
    """The scene in time with shorter steps, a finer mesh and another order, as it is wanted."""
    assert scene.time is not None
    shorter = wanted.shorter
    if scene.time.tolerance is None and shorter < 1.0:
        steps = scene.time.end / scene.time.step / shorter
        # Even, and from some number on such that the longer steps of a comparison end where these do.
        multiple = LONGEST_STEP if steps > LONGEST_STEP * FEWEST_STEPS else 2.0
        shorter = scene.time.end / scene.time.step / (multiple * math.ceil(steps / multiple * (1.0 - 1e-9)))
    return changed(_resized(scene, wanted.finer, shorter), numerics={"order": wanted.order})


def _resized(scene: Scene, cells: float, steps: float) -> Scene:
    """The scene with cells and steps so many times as large; where steps adapt, their errors follow."""
    assert scene.time is not None
    time = {"step": steps * scene.time.step}
    if scene.time.tolerance is not None:
        time["tolerance"] = scene.time.tolerance * steps ** (order_in_time(scene) + 1)
    mesh_size = min(float(f"{cells * scene.numerics.mesh_size:.12g}"), 100.0)
    return changed(scene, numerics={"mesh_size": mesh_size}, time=time)

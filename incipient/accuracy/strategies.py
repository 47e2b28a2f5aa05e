"""Refinement strategies: cells by their contribution, all cells uniformly, or cells and time steps."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from typing import Any, cast

import numpy as np

from ..errors import IncipientError, Interrupted, MeshError
from ..interrupt import told_where_kept
from ..planning.flow_setup import Setup, has_inertia, order_of
from ..planning.layout import coarse_sizes
from ..planning.wall_cells import coarsest as coarsest_at_walls
from ..results.errorbars import Loads
from ..scene import Scene
from ..scene.numerics import OF_SURFACE
from ..simulation.assemble import outcome
from ..simulation.beside import InTurn
from ..simulation.build import prepared
from ..simulation.loads import loads
from ..simulation.recorder import Recorder
from ..simulation.simulate import hand_over, loads_of, solved
from ..simulation.state import Accounts, Run
from ..simulation.steady import loads_at, solve_with_parts
from . import next_mesh
from .coarse_runs import COARSER_MESH, KeptRuns, changed, on_coarser_mesh
from .dual import GoalErrors
from .errorbars import coarse_scenes, error_bars, loads_of_run, of_interaction, unit_of
from .finish import finished
from .goal import LoadsOnMesh, relative
from .modelling import lessened
from .next_mesh import AIM, COARSEST, UNKNOWNS, WORK_POWER, coarsest, highest_order, next_order
from .search import Attempt, Estimate, Search, SearchRecorder
from .sizing import gathered, resized
from .terms import (
    COARSEST_IN_SPACE,
    OF_MESH,
    by_both,
    by_coarser_mesh,
    by_coarser_runs,
    by_dual,
    is_corrected,
)

SOLVER_SHARE, TOLERANCES = 1e-3, (1e-10, 1e-5)  # of the accuracy: tolerance of the iteration
CRITICAL = 1e-4  # relative range of safety factors about 1 that ends a search for a verdict
CANCELLING = 4.0  # bound on the assumed cancellation of contributions on the next mesh
TIME_GROWTH = 1.3  # power of the unknowns in the time of solution and estimate (docs/validation/performance.md)
FOR_VERDICT = 0.2  # fraction left of an infinite error, or of one for a verdict
# Fraction left of an estimated error on cells smaller by `finish.COARSER_CELLS`: 1.5^-4.
COMPARED = 0.2
SMALLEST, LARGEST = 0.01, 100.0  # of numerics.mesh_size
# The search ends after so many meshes with a smaller reduction of the error.
LOOKED_AT, LEAST_FALL = 3, 0.8


class Strategy(ABC):
    """Solution, error estimate and refinement in a search. All methods are collective."""

    most = next_mesh.MOST_MESHES

    def __init__(self, search: Search):
        self.search = search

    @abstractmethod
    def first(self, failures: int = 0) -> Attempt:
        """A coarse first mesh, finer after failures."""

    @abstractmethod
    def solved(self, attempt: Attempt) -> AbstractContextManager[tuple[Run, LoadsOnMesh]]:
        """The solved run of an attempt and its loads. Raises ConvergenceError, MeshError."""

    @abstractmethod
    def estimate(self, run: Run, on_mesh: LoadsOnMesh) -> Estimate:
        """Error of a solved run."""

    @abstractmethod
    def refined(self, attempt: Attempt, estimate: Estimate, left: float) -> Attempt:
        """An attempt that is expected to leave a fraction `left` of the error."""

    @abstractmethod
    def concluded(self, run: Run) -> Any:
        """Result of the last run, with its error bars."""

    def following(
        self, attempt: Attempt, run: Run, on_mesh: LoadsOnMesh, estimate: Estimate
    ) -> Attempt | None:
        """The next attempt; None, with the reason recorded, if the accuracy is reached or unattainable."""
        if estimate.rank <= self.search.allowed:
            self.search.conclude(estimate.rank, estimate.doubt)
            return None
        return self.search.refined(attempt, estimate, self.target(estimate))

    def target(self, estimate: Estimate) -> float:
        """The fraction of the error to leave."""
        return AIM * self.search.allowed / estimate.rank or FOR_VERDICT

    @contextmanager
    def coarse_runs(self) -> Iterator[InTurn]:
        """Coarse runs for the errors of gap and domain."""
        with InTurn(self.search.comm, coarse_scenes, loads_of) as solve:
            yield solve


class Steady(Strategy):
    """Steady flow: a run that may be the last is recorded."""

    _recorder: SearchRecorder | None = None

    def set_up(self, scene: Scene, order: int | None = None) -> Scene:
        """The scene in elements of an order, with a tolerance for the accuracy."""
        accuracy = self.search.numerics.accuracy
        wanted = SOLVER_SHARE * (accuracy if isinstance(accuracy, float | int) else CRITICAL)
        order = order or order_of(scene).number
        tolerance = float(np.clip(wanted, *TOLERANCES))
        return changed(scene, numerics={"order": order, "tolerance": tolerance})

    @contextmanager
    def solved(self, attempt: Attempt) -> Iterator[tuple[Run, LoadsOnMesh]]:
        search, sizing = self.search, attempt.sizing
        with prepared(
            attempt.scene, search.comm, search.accounts, voice=search.voice, sizing=sizing
        ) as run:
            yield run, self.solve(run)

    @abstractmethod
    def solve(self, run: Run) -> LoadsOnMesh:
        """Solve; returns the quantities with errors."""

    def handed_over(self, run: Run) -> SearchRecorder:
        """The recorder with the result without error bars."""
        numerics = {
            name: getattr(self.search.numerics, name)
            for name in ("order", "tolerance", "mesh_size")
        }
        wished = changed(run.scene, numerics=numerics)
        recorder = SearchRecorder(self.search.recorder, wished, self.search.adaptation)
        hand_over(run, cast(Recorder, recorder))
        return recorder

    def concluded(self, run: Run) -> Any:
        recorder = self._recorder or self.handed_over(run)
        finished(run, cast(Recorder, recorder))
        return recorder.result

    def following(
        self, attempt: Attempt, run: Run, on_mesh: LoadsOnMesh, estimate: Estimate
    ) -> Attempt | None:
        """See `Strategy`; for a verdict refine the decisive source: mesh, gap or domain."""
        if self.search.numerics.accuracy != "verdict" or estimate.error is None:
            return super().following(attempt, run, on_mesh, estimate)
        search, comm = self.search, self.search.comm
        # Recorded before the coarse runs of the error bars, so that an interrupt does not lose them.
        self._recorder = recorder = self.handed_over(run)
        with told_where_kept(recorder.kept, comm):
            bars = error_bars(
                run, on_mesh.force, on_mesh.torque, lambda scene: loads_of(scene, comm)
            )
        bar = bars.safety
        assert bar is not None
        if bar.certain:
            why = "; ".join(
                f"error of the {name}: {reason}" for name, reason in bars.failed.items()
            )
            search.reason, search.met = "the verdict is certain", not why
            if why:
                search.reason = f"undecided: certain except for unknown errors, {why}"
            return None
        if bar.decisive == "discretisation" and estimate.rank > CRITICAL:
            finer = search.refined(attempt, estimate, FOR_VERDICT)
            return finer and replace(finer, note="for the verdict")
        term = next((each for each in bars.terms if each.name == bar.decisive), None)
        scene = None if term is None else lessened(attempt.scene, term, FOR_VERDICT)
        if scene is None:
            between = f"the safety factor is between {bar.low:.6g} and {bar.high:.6g}"
            why = f"the error of the {bar.decisive} cannot be reduced"
            search.reason = f"undecided: {between}, and {why}"
            return None
        for name in ("gap", "domain", "datum"):
            search.known.terms.pop(name, None)
        note, unknowns = f"less error of the {bar.decisive}", 1.2 * search.trials[-1].unknowns
        return search.affordable(replace(attempt, scene=scene, unknowns=unknowns, note=note))


class DualWeighted(Steady):
    """Cells refined by their dual-weighted contributions to the error, together with the order."""

    # Speed and improved loads of the previous mesh; the solved run of the first attempt, for the coarse runs.
    _improved: tuple[float, Loads] | None = None
    _at_hand: tuple[Run, ExitStack] | None = None
    _plain = np.inf  # error of the uncorrected quantity on the last mesh
    _compared = False  # whether corrected loads of two meshes were compared

    def first(self, failures: int = 0) -> Attempt:
        scene = self.search.scene
        factor = 0.5**failures * coarsest(scene.gdim, has_inertia(scene))
        return Attempt(self.set_up(scene), partial(coarse_sizes, factor, None))

    @contextmanager
    def solved(self, attempt: Attempt) -> Iterator[tuple[Run, LoadsOnMesh]]:
        if self._at_hand is None:
            with super().solved(attempt) as both:
                yield both
            return
        (run, held), self._at_hand = self._at_hand, None
        with held:
            yield run, LoadsOnMesh(*loads(run, surface=False))

    def solve(self, run: Run) -> LoadsOnMesh:
        return LoadsOnMesh(*loads_at(run, self.search.speed))

    def estimate(self, run: Run, on_mesh: LoadsOnMesh) -> Estimate:
        search, force, torque = self.search, on_mesh.force, on_mesh.torque
        assert run.layout.placement is not None and force is not None and torque is not None
        with GoalErrors(run.fluid, "body", run.layout.placement.centre) as goals:
            plain = unit_of(run, search.speed)
            unit = goals.allowance * plain
            term = by_dual(goals, unit)
            self._plain = search.goal.error(force, torque, term.force, term.torque)
            before, self._improved = self._improved, (search.speed, goals.loads(plain))
            self._compared = self._corrects and before is not None and before[0] == search.speed
            if self._compared and before is not None:
                term = by_both(term, goals, unit, before[1])
            search.known.terms["discretisation"] = term
            others = search.suited.terms if search.suited is not None else ()
            between = of_interaction((*others, term), Loads(force.flow, torque.flow))
            whole = (
                term
                if between is None
                else replace(
                    term, force=term.force + between.force, torque=term.torque + between.torque
                )
            )
            error = search.goal.error(force, torque, whole.force, whole.torque)
            if error <= search.allowed:
                return Estimate(error, term, term.doubt)  # no next mesh
            parts = [goals.shares(unit * goal) for goal in search.goal.goals(force, torque)]
            shares = gathered(run.domain.mesh, parts)
        return Estimate(error, term, term.doubt, shares=shares)

    def target(self, estimate: Estimate) -> float:
        """See `Strategy`.

        The error of a corrected load follows from the previous mesh: cells smaller by a fixed factor suffice, unless
        the uncorrected load needs less.
        """
        wanted = super().target(estimate)
        if not (self._has_one_order and self._corrects):
            return wanted
        compared = min(COMPARED, wanted) if self._compared else COMPARED
        return max(AIM * self.search.allowed / self._plain, compared)

    def refined(self, attempt: Attempt, estimate: Estimate, left: float) -> Attempt:
        before, shares, gdim = order_of(attempt.scene).number, estimate.shares, attempt.scene.gdim
        order, excess = next_order(before, 1.0 / left, gdim, self._highest)
        together = self.search.comm.bcast(float(np.sum(shares.errors)), root=0)
        # Contributions may cancel: their sum may exceed the error.
        cancelling = min(self._plain / max(together, 1e-300) * CANCELLING, 1.0)
        field, more = resized(shares, order, cancelling / excess, self.search.comm)
        more *= UNKNOWNS[gdim][order] / UNKNOWNS[gdim][before]
        sizing = partial(coarse_sizes, COARSEST, field)
        unknowns = more * self.search.trials[-1].unknowns
        work = max(1.0, more) ** TIME_GROWTH
        return Attempt(self.set_up(attempt.scene, order), sizing, unknowns, work)

    @property
    def _corrects(self) -> bool:
        return self.search.numerics.error_bars and is_corrected(self.search.scene)

    @property
    def _highest(self) -> int:
        return highest_order(self.search.scene.gdim, has_inertia(self.search.scene))

    @property
    def _has_one_order(self) -> bool:
        return self._highest == next_mesh.ORDERS[0]

    @contextmanager
    def coarse_runs(self) -> Iterator[InTurn]:
        """See `Strategy`; the last one may use the run of the first attempt."""
        prepare = self._for_coarse_runs if self._has_one_order else None
        with InTurn(self.search.comm, coarse_scenes, loads_of, prepare) as solve:
            yield solve
            self._at_hand = solve.handed_over(self.first().scene)

    def _for_coarse_runs(self, coarse: Scene) -> AbstractContextManager[Run]:
        search, first = self.search, self.first()
        own = changed(coarse, numerics=first.scene.numerics.model_dump())
        return prepared(own, search.comm, search.accounts, voice=search.voice, sizing=first.sizing)


class Uniform(Steady):
    """Uniform refinement of a steady mean flow, each mesh compared with the two previous ones.

    There is no dual solution of flow and turbulence.
    """

    def __init__(self, search: Search):
        super().__init__(search)
        self._seen = list[tuple[Scene, Loads]]()  # by mesh

    def first(self, failures: int = 0) -> Attempt:
        self._seen = []
        most = COARSEST_IN_SPACE if self.search.scene.resolves_uneven_walls else LARGEST
        size = 0.5**failures * COARSEST * self.search.numerics.mesh_size
        return self._on(self.search.scene, min(size, most))

    def _on(
        self, scene: Scene, mesh_size: float, unknowns: float = 0.0, work: float = 1.0
    ) -> Attempt:
        sized = changed(self.set_up(scene), numerics={"mesh_size": mesh_size})
        note = f"mesh_size {mesh_size:.3g}"
        return Attempt(sized, unknowns=unknowns, work=work, note=note)

    def solve(self, run: Run) -> LoadsOnMesh:
        solve_with_parts(run, run.fluid, run.parts)
        return _on_mesh(run)

    def estimate(self, run: Run, on_mesh: LoadsOnMesh) -> Estimate:
        search, walls = self.search, on_mesh.turbulence
        doubt = "" if walls is None else walls.doubt
        computed = loads_of_run(run, on_mesh.force, on_mesh.torque)
        self._seen.append((run.scene, computed))
        coarser = on_coarser_mesh(run.scene)
        if len(self._seen) < 3 or coarser.numerics.mesh_size > coarsest_at_walls(
            Setup(search.scene)
        ):
            return Estimate(None)
        for scene, there in reversed(self._seen[-3:-1]):
            if (scene.contact, scene.domain) == (coarser.contact, coarser.domain):
                search.known.loads[coarser.model_dump_json()] = there
            coarser = on_coarser_mesh(coarser)
        runs = KeptRuns(search.known.loads, search.spent, lambda each: loads_of(each, search.comm))
        term = by_coarser_mesh(run.scene, computed, runs)
        search.known.terms["discretisation"] = term
        error = relative(search.goal, on_mesh, term.with_changes(computed.unsteady))
        return Estimate(error, term, doubt)

    def following(
        self, attempt: Attempt, run: Run, on_mesh: LoadsOnMesh, estimate: Estimate
    ) -> Attempt | None:
        known = [trial.estimate for trial in self.search.trials if trial.estimate is not None]
        many = self.search.allowed < estimate.rank < np.inf and len(known) > LOOKED_AT
        if many and min(known[-LOOKED_AT:]) > LEAST_FALL * known[-LOOKED_AT - 1]:
            why = f"the error has hardly decreased on the last {LOOKED_AT} meshes"
            self.search.reason = f"not reached: {why}"
            return None
        return super().following(attempt, run, on_mesh, estimate)

    def refined(self, attempt: Attempt, estimate: Estimate, left: float) -> Attempt:
        mesh_size = attempt.scene.numerics.mesh_size / COARSER_MESH
        if mesh_size < SMALLEST:
            raise MeshError(
                f"numerics.mesh_size would be below {SMALLEST:g}: use a larger numerics.accuracy"
            )
        more = COARSER_MESH**attempt.scene.gdim
        unknowns = more * self.search.trials[-1].unknowns
        return self._on(attempt.scene, mesh_size, unknowns, more**TIME_GROWTH)


class InTime(Strategy):
    """Time steps, cells and order of unsteady flow, refined for the least work (`next_mesh`)."""

    most = next_mesh.MOST_RUNS
    _recorder: SearchRecorder
    _last: Scene | None = None

    def first(self, failures: int = 0) -> Attempt:
        scene = next_mesh.first(self.search.scene)
        for _ in range(failures):
            scene = next_mesh.finer(scene, next_mesh.halved(order_of(scene).number))
        return Attempt(scene)

    @contextmanager
    def solved(self, attempt: Attempt) -> Iterator[tuple[Run, LoadsOnMesh]]:
        search, scene = self.search, attempt.scene
        self._recorder = SearchRecorder(search.recorder, scene, search.adaptation)
        accounts = Accounts(known=search.known, spent=search.spent)  # separate times of each run
        recorder = cast(Recorder, self._recorder)
        with solved(scene, search.comm, recorder, search.voice, accounts=accounts) as run:
            yield run, _on_mesh(run)

    def estimate(self, run: Run, on_mesh: LoadsOnMesh) -> Estimate:
        search, scene, terms = self.search, run.scene, self.search.known.terms
        # Longer steps damp waves, and hide the error of the mesh.
        same = self._last is not None and self._last.numerics == scene.numerics
        if not same or scene.accuracy_of in OF_SURFACE:
            terms.pop(OF_MESH, None)
        self._last = scene
        computed = loads_of_run(run, on_mesh.force, on_mesh.torque)
        runs = KeptRuns(search.known.loads, lambda: "", lambda each: loads_of(each, search.comm))
        try:
            with told_where_kept(self._recorder.provisional(outcome(run)), search.comm):
                term = by_coarser_runs(scene, computed, runs, terms.get(OF_MESH))
        except Interrupted:
            raise
        except IncipientError as error:
            return Estimate(None, note=f"not compared: {error}")
        terms["discretisation"], terms[OF_MESH] = term, term.parts[-1]
        whole, of_step, of_mesh = (
            relative(search.goal, on_mesh, each) for each in (term, *term.parts)
        )
        return Estimate(whole, term, term.doubt, parts=(of_step, of_mesh))

    def refined(self, attempt: Attempt, estimate: Estimate, left: float) -> Attempt:
        last = self.search.trials[-1]
        wanted = next_mesh.refined(attempt.scene, last, left)
        unknowns = last.unknowns * wanted.finer**-WORK_POWER
        return Attempt(next_mesh.finer(attempt.scene, wanted), unknowns=unknowns, work=wanted.work)

    def concluded(self, run: Run) -> Any:
        finished(run, cast(Recorder, self._recorder))
        return self._recorder.result


def _on_mesh(run: Run) -> LoadsOnMesh:
    force, torque = (None, None) if run.probe is None else loads(run, surface=False)
    return LoadsOnMesh(force, torque, run.elevations, run.wall_report())

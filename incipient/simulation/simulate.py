"""Runs a plan: builds the sub-problems that it names, solves, reads the tractions, judges.

One data flow: scene, plan, fluid, tractions, contact, result. What happens outside (files, terminal) is
told through a `Recorder` and a voice; this module writes nothing. Time steps are in `marching`, what the
result is made of in `outcome`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from ..errors import IncipientError, Interrupted, OutputError
from ..installed import required
from ..interrupt import Interruption, told_where_kept
from ..planning import drawing as layouts
from ..planning.effects import EffectName
from ..planning.plan import Estimate, Plan, make_plan
from ..planning.stabilisation import stabilisation_of
from ..progress import Silent
from ..results.cost_of_effects import Corrections
from ..results.timing import Ledger
from ..scene import Scene
from .assemble import loads, outcome, with_estimates
from .recorder import Recorder, Unrecorded

if TYPE_CHECKING:
    from pathlib import Path

    from mpi4py import MPI

    from ..contact import Contacts
    from ..coupled.tractions import TractionProbe
    from ..fluid import FlowModel, Fluid, Transient
    from ..mesh.domain import Domain
    from ..planning.drawing import Layout
    from ..restart.checkpoint import Checkpoint
    from ..results.errorbars import Loads, Term
    from ..results.loads import Couples, Forces
    from ..results.result import Result
    from .moving_grain import Trajectory

# What is left of the way to a flow, going on from a slower one, when no shorter step is tried any more.
SMALLEST_SHARE = 0.02


def simulate(
    scene: Scene,
    comm: MPI.Comm,
    recorder: Recorder | None = None,
    voice: Silent | None = None,
    checkpoint: Checkpoint | None = None,
) -> Result:
    """Run a scene from plan to verdict, from the start or from a checkpoint of it. Collective over `comm`.

    Raises:
        IncipientError: on all ranks; what was computed before it has been handed to the recorder.
    """
    simulation = Simulation(scene, comm, recorder or Unrecorded(), voice or Silent(), checkpoint)
    return simulation.run()


@dataclass
class Simulation:
    """One run of one scene, from the mesh to the result. Every method is collective but those said not to be.

    first_motion: time at which the grain of a flow in time would first have moved
    trajectory:   of a grain that moves; `transient`: the time integration; None before the first step, or without
    sizing:       what an adaptation makes of the cell sizes laid out
    known:        see `errorbars.error_bars`
    spent:        why no estimate shall be begun any more, or nothing
    """

    scene: Scene
    comm: MPI.Comm
    recorder: Recorder
    voice: Silent
    checkpoint: Checkpoint | None = None
    ledger: Ledger = field(default_factory=Ledger)
    iterations: dict[str, int] = field(default_factory=dict)
    first_motion: float | None = None
    trajectory: Trajectory | None = None
    transient: Transient | None = None
    sizing: Callable[[Layout], Layout] = lambda layout: layout
    known: dict[str, Term | Loads] = field(default_factory=dict)
    spent: Callable[[], str] = lambda: ""

    def __post_init__(self) -> None:
        self.interruption = Interruption(self.comm)

    def run(self) -> Result:
        """Plan, mesh, solve, judge."""
        with self.interruption if self.recorder.keeps else nullcontext(), self.prepared():
            self._solved()
            return self.finished()

    @contextmanager
    def prepared(self) -> Iterator[None]:
        """Plan, mesh and build the fluid; free its memory at the end."""
        scene = self.scene
        with self.stage("plan"):
            self.plan = make_plan(scene)
            self.layout = self.sizing(layouts.lay_out(scene, self.plan))
            self.corrections = Corrections(self.ledger, self.plan)
        with self.stage("import"), required():
            from .. import fluid
            from ..mesh import domain
            from ..planning import conditions as boundaries
        with self.stage("mesh"):
            self.contacts = self._contacts()
            self.domain = self._resumed_domain() or domain.build(self.comm, self.layout.drawing, scene.gdim)
        self.recorder.begin(scene, self.plan, self.domain)
        with ExitStack() as stack:
            with self.stage("forms"):
                model = self.model(unsteady=self.plan.has(EffectName.UNSTEADINESS))
                conditions = boundaries.conditions(scene)
                self.fluid: Fluid = fluid.Fluid(self.domain, model, conditions, self.plan.reynolds)
                # Another fluid may have taken its place by then.
                stack.push(lambda *exception: self.fluid.__exit__(*exception))
                self.fluid.watch = self.corrections.made
                self.probe = self._probe()
            yield

    def loads_at(self, factor: float, start: float = 0.0) -> tuple[Forces, Couples]:
        """Solve steadily with the flow faster by a factor at the same viscosity; the loads then.

        In units of the faster flow only the Reynolds number changes, so the mesh, the forms and the last
        solution serve again; forces go back to scene units with the factor squared. `start` is the factor of
        the flow that the state is that of, if it is one to go on from.

        Raises:
            ConvergenceError: the fluid then holds the last flow found on the way, at its Reynolds number.
        """
        self.stabilise(factor)
        self.fluid.reynolds = factor * self.plan.reynolds
        way = {"reached": start / factor, "smallest_step": SMALLEST_SHARE} if start else {}
        self.solve_steadily(self.fluid, **way)
        return loads(self, surface=False, speed=factor)

    def stabilise(self, factor: float) -> None:
        """Go on with a fluid whose convection is stabilised, or not, as that of a run with the faster flow is."""
        from ..fluid import Fluid

        before, model = self.fluid, self.fluid.model
        wanted = stabilisation_of(self.scene, model.inertia, factor).present
        if wanted == model.stabilisation:
            return
        model = replace(model, stabilisation=wanted)
        self.fluid = Fluid(self.domain, model, before.conditions, before.reynolds)
        self.fluid.state.x.array[:] = before.state.x.array
        self.fluid.solver.statistics.add(before.solver.statistics)
        self.fluid.watch = before.watch
        self.probe = self._probe()
        before.destroy()

    def hand_over(self, recorder: Recorder) -> Path | None:
        """Hand a steady flow that has been solved over to a recorder, with all but the error bars; where it is kept."""
        self.recorder = recorder
        recorder.begin(self.scene, self.plan, self.domain)
        self.hand_over_fields(0, last=True)
        return recorder.provisional(outcome(self))

    def finished(self) -> Result:
        """Judge what has been solved, estimate errors, and hand the result over.

        The result is handed over before the errors are estimated, too: that may take as long as the run.

        Raises:
            Interrupted: meanwhile; where the result without them is kept.
        """
        result = outcome(self)
        if self.scene.numerics.error_bars:
            kept = self.recorder.provisional(result)
            with told_where_kept(kept, self.comm):
                result = with_estimates(self, result)
        else:
            result = with_estimates(self, result)
        self.recorder.finish(result)
        return result

    def _solved(self) -> None:
        try:
            if self.scene.time is None:
                self.solve_steadily(self.fluid)
                self.hand_over_fields(0, last=True)
            else:
                from .time_loop import March

                March(self).to_the_end()
        except Interrupted:
            raise
        except IncipientError as error:
            with suppress(OutputError):  # a full disk is told of once, and another failure before it
                self.recorder.finish(outcome(self, "failed", str(error)))
            raise

    # -- parts of a run, for `marching` and `outcome` ---------------------------------------------

    def stage(self, name: str) -> AbstractContextManager[None]:
        """Tell that a stage begins; a context manager that takes its time. Not collective."""
        self.voice.begin(name)
        return self.ledger.stage(name)

    def count(self, **numbers: int) -> None:
        """Add to the numbers of iterations by name. Not collective."""
        for name, number in numbers.items():
            self.iterations[name] = self.iterations.get(name, 0) + number

    def model(self, unsteady: bool, inertia: bool = True) -> FlowModel:
        """What the plan makes of the flow's equations. Not collective."""
        from ..fluid import FlowModel

        convection = self.plan.convection if unsteady else "implicit"
        return FlowModel(
            order=self.plan.order,
            inertia=inertia and self.plan.has(EffectName.INERTIA),
            unsteady=unsteady,
            convection=convection,
            moving_mesh=unsteady and self.plan.has(EffectName.MOVING_MESH),
            energy_stable=unsteady and self.scene.numerics.form == "energy-stable",
            stabilisation=self.plan.stabilisation.present,
        )

    def solve_steadily(self, fluid: Fluid, **way: float) -> None:
        """Find the steady flow of a fluid; `way` may name what `fluid.solve_steady` takes besides.

        Raises:
            ConvergenceError: there is none that could be found.
        """
        from ..fluid import solve_steady

        numerics = self.scene.numerics
        with self.stage("flow"), self.corrections.begun():
            steps = solve_steady(
                fluid,
                numerics.tolerance,
                numerics.max_iterations,
                first_share=self._first_share(fluid),
                watch=self.corrections.heard(self.voice.iterate),
                **way,
            )
            self.corrections.book_steady(steps)
        self.count(continuation=len(steps), newton=sum(step.report.iterations for step in steps))

    def hand_over_fields(self, number: int, last: bool) -> None:
        """Hand the fields after a step of this number over to the recorder if it wants them."""
        if not self.recorder.wants_fields(number, last):
            return
        from ..fluid.vorticity import vorticity

        with self.stage("fields"):
            fields = {"velocity": self.fluid.velocity, "pressure": self.fluid.pressure}
            fields["vorticity"] = vorticity(self.fluid)
            traction = self.probe.field() if self.probe else None
            self.recorder.fields(self.fluid.time, fields, traction)

    def take_over(self, travel: Trajectory) -> None:
        """The fluid is now that on the trajectory's newest mesh. Not collective."""
        self.fluid, self.domain, self.probe = travel.fluid, travel.domain, travel.coupling.probe

    # -- building ---------------------------------------------------------------------------------

    def _contacts(self) -> Contacts | None:
        if not self.plan.has(EffectName.CONTACT):
            return None
        with self.ledger.stage("contact"):
            from ..results.verdict import find_contacts

            return find_contacts(self.scene)

    def _probe(self) -> TractionProbe | None:
        if self.layout.placement is None:
            return None
        from ..coupled.tractions import TractionProbe

        return TractionProbe(self.fluid, "body", self.layout.placement.centre)

    def _first_share(self, fluid: Fluid) -> float:
        """Where the continuation starts: at once, unless the Reynolds number of the whole flow is large."""
        whole = fluid.reynolds * self.scene.reference_velocity * self.scene.domain.height
        return min(1.0, 200.0 / whole) if self.plan.has(EffectName.INERTIA) else 1.0

    def _resumed_domain(self) -> Domain | None:
        """The mesh of the checkpoint, if there is one, and what the sessions before have cost."""
        if self.checkpoint is None:
            return None
        from ..restart import resumption

        resumption.put_back_costs(self.checkpoint.progress, self)
        return resumption.domain_of(self.checkpoint, self.comm)


def estimate(scene: Scene) -> Plan:
    """The plan with its expense, counted by making the mesh on this process. Not collective."""
    plan = make_plan(scene)
    expense: Estimate = layouts.count(layouts.lay_out(scene, plan), plan.order, layouts.has_dual(scene))
    return plan.with_estimate(expense)

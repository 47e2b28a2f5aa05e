"""Time loop of a run: start, steps of flow and coupled parts, remeshing, records, checkpoints, interrupts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import SMALLEST, spatial
from ..body.state import BodyState
from ..errors import ConvergenceError, IncipientError, Interrupted, MeshError, OutputError
from ..fluid import Fluid
from ..fluid.transient import Interface, Past, TimeStep, Transient, of_steps
from ..geometry.placement import Placement
from ..interrupt import Interruption
from ..mesh.domain import build
from ..planning import meshing
from ..planning.conditions import conditions
from ..planning.discretisation import of_steady, with_order
from ..results import of_runs
from ..results.loads import columns_of_load
from ..results.result import Steadied
from ..scene import expression
from ..scene.file import dumps
from ..setup.geometry import initial_state
from ..setup.setup import Setup
from .build import flow_model, fluid_of
from .loads import coefficients, judged, load_on_grain
from .state import Recorder, Run
from .steady import solve_steadily, solve_with_turbulence

if TYPE_CHECKING:
    from ..coupled.coupling import Coupling, Part
    from ..coupled.moving_grain import MovingGrain
    from ..coupled.turbulent_flow import TurbulentFlow
    from ..mesh.motion import MeshMotion
    from ..restart import Checkpoint

NOT_STEADY = 'time.start: the steady flow did not converge; use a smaller numerics.mesh_size, or time.start = "rest"'
STILL = 1e-6  # speed, relative to the flow's, below which errors of adaptive steps are not relative
NOT_BEGUN = "flow: the oscillation does not begin; use a smaller numerics.mesh_size or velocity"


class TimeLoop:
    """Advances a run from its start or checkpoint to its end. Every method is collective.

    transient, coupling: once `set_up`; the latter of flow and moving boundaries, or None.
    """

    transient: Transient
    coupling: Coupling | None = None

    def __init__(
        self,
        run: Run,
        recorder: Recorder,
        interruption: Interruption,
        checkpoint: Checkpoint | None = None,
    ):
        assert run.scene.time is not None
        self._run, self._time, self._recorder = run, run.scene.time, recorder
        self._interruption, self._checkpoint = interruption, checkpoint
        self._recorded: float | None = None  # time of the last recorded step

    def to_the_end(self) -> None:
        """Advance to the end, recording each step.

        Raises Interrupted on request, with a checkpoint, and IncipientError if a step fails; the
        last converged state is stored if the recorder keeps checkpoints.
        """
        try:
            if self._checkpoint is None:
                self._start()
            self.set_up()
            self._march()
        except (Interrupted, OutputError):
            raise
        except IncipientError as error:
            # Without its row in the history the last step is not kept: the earlier checkpoint holds.
            if not self._recorder.keeps or self._run.fluid.time != self._recorded:
                raise
            why = f"{error}; the state at t = {self._recorded:.6g} is saved: incipient resume"
            with suppress(OutputError):
                raise type(error)(f"{why} {quote(str(self._keep()))}") from error
            raise

    def _start(self) -> None:
        run, start = self._run, self._time.start
        if not run.plan.has("unsteadiness"):
            solve_steadily(run, run.fluid)
        elif run.scene.flow.oscillates:
            self._start_within_oscillation()
        elif start != "rest":
            self._start_from(inertia=start == "steady")

    def _kinks(self) -> list[float]:
        """Times at which prescribed accelerations jump."""
        setup, gust = self._run.setup, self._run.setup.base_flow.gust
        of_formulas = setup.times_of(expression.kinks)
        of_gust = np.empty(0) if gust is None else gust.kinks(self._time.step)
        right_after_the_start = [SMALLEST] if self._starts_impulsively() else []
        # Where formulas jump, a state at that time is one before or after the jump, by round-off: none there counts.
        return [*of_formulas, *(1.0 + 1e-8) * of_formulas, *of_gust, *right_after_the_start]

    def _stops(self) -> list[float]:
        """Times at which adaptive steps end: long in a steady flow, they would step over short changes."""
        setup, gust = self._run.setup, self._run.setup.base_flow.gust
        knots = np.empty(0) if gust is None else gust.knots()
        return [*self.transient.kinks, *setup.times_of(expression.landmarks), *knots]

    def _starts_impulsively(self) -> bool:
        """Whether fluid at rest is set in motion within the first step."""
        setup, scene = self._run.setup, self._run.scene
        if self._time.start != "rest" or scene.flow.oscillates:
            return False
        moving = [setup.base_flow.velocity(spatial(scene.domain.grid(9, 9, 9)).T, 0.0)]
        if scene.moves:
            assert scene.body is not None and scene.placement is not None
            grain = initial_state(scene.body, scene.placement, setup.symmetric)
            moving.append(grain.velocities)
        return any(np.any(velocities) for velocities in moving)

    def _start_within_oscillation(self) -> None:
        """Set the state to the oscillating base flow and a disturbance at rest on walls, without an impulse.

        The disturbance is that of one backward difference over 1/w in which the base flow u(0) has its rate u'(0) =
        w u(T/4): the step begins at u(0) - u'(0)/w, and without a grain it ends at u(0).
        """
        run, fluid, flow = self._run, self._run.fluid, self._run.scene.flow
        velocity, at = fluid.velocity, run.setup.base_flow.velocity
        for function, later in ((fluid.state, 0.0), (fluid.history[0], 1.0)):
            velocity.interpolate(lambda x, k=later: at(x, 0.0) - k * at(x, 0.25 * flow.cycle))
            function.x.array[fluid.space.velocity_map] = velocity.x.array
        fluid.discretise_time((flow.frequency, -flow.frequency, 0.0), (1.0, 0.0))
        with run.stage("flow"):
            report = fluid.solve(of_steady(run.scene.numerics.tolerance))
        if not report.converged:
            raise ConvergenceError(NOT_BEGUN)

    def _start_from(self, inertia: bool) -> None:
        run = self._run
        model = flow_model(run.setup, run.plan, unsteady=False, inertia=inertia)
        held = conditions(run.setup, initial=True)
        turbulence = None if run.turbulence is None else run.turbulence.on(run.domain)
        with fluid_of(run.setup, run.domain, model, held, run.plan.reynolds, turbulence) as initial:
            try:
                solve_with_turbulence(run, initial, turbulence)
            except ConvergenceError as error:
                if turbulence is None:
                    raise
                raise ConvergenceError(NOT_STEADY) from error
            run.fluid.state.x.array[:] = initial.state.x.array
            if turbulence is not None and run.turbulence is not None:
                run.turbulence.fields.state.x.array[:] = turbulence.fields.state.x.array

    def set_up(self) -> None:
        """Make moving parts and their coupling with the flow, as at the start or from the checkpoint."""
        run, time, checkpoint = self._run, self._time, self._checkpoint
        if run.plan.has("moving mesh"):
            from ..mesh.motion import MeshMotion

            with run.stage("mesh motion" if run.scene.moves else "free surface"):
                motion = MeshMotion(run.fluid.domain)
                _make_moving(run, motion, checkpoint)
                self.coupling = self._coupled(run.fluid, (run.grain, run.surface), motion)
        tolerance_of = of_steps if run.plan.has("unsteadiness") else of_steady
        self.transient = run.transient = Transient(
            run.fluid,
            order=2 if time.scheme == "bdf2" else 1,
            tolerance=tolerance_of(run.scene.numerics.tolerance),
            accuracy=time.tolerance,
            interface=_interface(self.coupling, run.turbulence),
            kinks=self._kinks(),
            least=STILL * run.scene.reference_velocity,
        )
        if checkpoint is not None:
            self._restore(checkpoint)

    def _march(self) -> None:
        run, time = self._run, self._time
        self._recorded, self._interruption.armed = run.fluid.time, True
        if run.surface is not None:
            run.surface.read()
        for step in self._steps():
            row, is_over = self._row(step), step.time >= time.end * (1 - 1e-9)
            # An event of a moving grain ends the run.
            has_ended = run.grain is not None and run.grain.ends != ""
            is_steady = run.steady is not None and run.steady.reached
            last = is_over or is_steady or has_ended
            self._record(step, row, last, kept=has_ended and not is_over)
            if last:
                break
            if run.surface is not None:
                run.surface.check(step, None if run.grain is None else run.grain.state.placement)
        self._interruption.armed = False

    # -- steps --------------------------------------------------------------------------------

    def _steps(self) -> Iterator[TimeStep]:
        """Steps up to the end; a worn mesh is renewed before a step. Without any in a run resumed at its end."""
        run, time = self._run, self._time
        stops = [] if time.tolerance is None else self._stops()
        steps = self.transient.march(time.end, time.step, time.first_step, stops)
        while True:
            with run.stage("flow", run.corrections.effect_of_step()):
                self._renew_worn_mesh()
                step = next(steps, None)
            if step is None:
                return
            run.accounts.iterations.update(
                steps=1, rejected=step.rejected, newton=step.report.iterations
            )
            yield step

    def _coupled(self, fluid: Fluid, moving: Sequence[Part | None], motion: MeshMotion) -> Coupling:
        from ..coupled.coupling import Coupling

        accepted = self._run.scene.numerics.interface_tolerance
        parts = [part for part in moving if part is not None]
        coupling = Coupling(fluid, parts, motion, None if accepted == "auto" else accepted)
        fluid.move_mesh(coupling.places[0])
        return coupling

    def _restore(self, checkpoint: Checkpoint) -> None:
        from ..restart import put_back_flow, spread_nodes

        fluid, mesh = self._run.fluid, self._run.fluid.domain.mesh
        if self.coupling is not None:
            places = spread_nodes(mesh, checkpoint.motion["places"])
            self.coupling.places = list(np.moveaxis(places, 1, 0).copy())
            # Values stored by node position belong to the mesh of that time.
            fluid.move_mesh(self.coupling.places[0])
        for part in self._run.parts:
            part.resume(checkpoint)
        put_back_flow(checkpoint, self.transient)

    def _state(self) -> Checkpoint:
        """The state between two steps, complete on rank 0."""
        from ..restart import Checkpoint, numbered_nodes, stored_field, stored_mesh

        run, transient, coupling = self._run, self.transient, self.coupling
        fluid, ledger = transient.fluid, run.accounts.ledger
        progress = {
            "number": transient.number,
            "next_length": transient.next_length,
            "error": transient.last_error,
            "first_motion": run.first_motion,
            "iterations": run.accounts.iterations.copy(),
            "linear": dict(fluid.solver.statistics),
            "wall_time": ledger.wall_time.copy(),
            "total": ledger.total(),
        }
        states = np.array([fluid.state.x.array, *(past.state for past in transient.past)])
        stored: dict[str, Any] = {
            name: stored_field(space, states[:, places])
            for name, (space, places) in zip(
                ("velocity", "pressure"), fluid.space.parts, strict=True
            )
        }
        for part in run.parts:
            stored |= part.stored(transient)
        if coupling is not None:
            nodes = numbered_nodes(fluid.domain.mesh)
            places = nodes.joined(np.stack(coupling.places, axis=1))
            stored["motion"] = {"made": nodes.joined(coupling.motion.reference), "places": places}
        return Checkpoint(
            # Later versions may choose another order.
            scene=dumps(with_order(run.scene, run.plan.order)),
            progress=progress,
            mesh=stored_mesh(fluid.domain),
            times=np.array([fluid.time, *(past.time for past in transient.past)]),
            **stored,
        )

    def _renew_worn_mesh(self) -> None:
        grain, coupling = self._run.grain, self.coupling
        if grain is None or coupling is None or (length := grain.last_step()) is None:
            return
        ahead = coupling.quality_ahead(length, self.transient.order)
        if ahead.relative >= self._run.scene.numerics.remesh_below:
            return
        *ahead_of_grain, at_grain = grain.mesh_placements()
        for placement in ahead_of_grain:
            with suppress(MeshError):  # such a mesh may fold as it moves back to the grain
                self._remesh(grain, coupling, placement)
                return
        self._remesh(grain, coupling, at_grain)

    def _remesh(self, grain: MovingGrain, before: Coupling, made_for: Placement) -> None:
        """Remesh around the grain and transfer all fields; the old mesh is freed last."""
        from ..coupled.remeshing import carry_over
        from ..mesh.motion import MeshMotion

        run, transient = self._run, self.transient
        with run.accounts.ledger.stage("remeshing"):
            old, scene, height = run.fluid, run.scene, run.scene.domain.height
            surface, turbulence = run.surface, run.turbulence
            if surface is not None:
                height = surface.drawn_height(height, made_for)
            higher = {"domain": scene.domain.model_copy(update={"height": height})}
            laid_out = meshing.lay_out(Setup(scene.model_copy(update=higher)), run.plan, made_for)
            domain = build(run.comm, laid_out.mesh)
            eddies = None if turbulence is None else turbulence.on(domain)
            fluid = fluid_of(run.setup, domain, old.model, old.conditions, old.reynolds, eddies)
            try:
                motion = MeshMotion(domain)
                # A surface begins on the mesh as made, which the grain then moves.
                above = None if surface is None else surface.on(fluid, motion)
                moved = grain.on(fluid, motion, made_for)
                coupling = self._coupled(fluid, (moved, above), motion)
                now = Past(old.time, old.state.x.array, np.empty(0))
                (_, *past), done = carry_over(before, coupling, moved, [now, *transient.past])
            except IncipientError:
                fluid.destroy()
                raise
            transient.fluid = fluid
            transient.interface = _interface(coupling, eddies) or Interface(fluid)
            known = transient.number, transient.next_length, past, transient.last_error
            transient.resume(*known, new_mesh=fluid.time)
            if eddies is not None and turbulence is not None:
                eddies.carry_over(turbulence)
            grain.remeshings.append(done)
            self.coupling, run.grain, run.surface = coupling, moved, above
            run.turbulence = eddies
            run.take_fluid(fluid)
        projected = f"the projection onto divergence-free velocities changed the velocity by {done['change']:.1e}"
        run.voice.say(f"t = {fluid.time:.6g}: remeshed with {done['cells']} cells; {projected}")

    # -- records --------------------------------------------------------------------------------

    def _record(self, step: TimeStep, row: dict[str, Any], last: bool, kept: bool = False) -> None:
        run = self._run
        self._recorder.step(row, [] if run.grain is None else run.grain.contact_rows(step))
        run.voice.advance(step.time, self._time.end)
        self._recorder.fields(run, step.number, last)
        self._recorded = step.time
        if not self._recorder.keeps:
            return
        every, stop = run.scene.output.checkpoint, self._interruption.asked() and not last
        due = kept or (every > 0 and step.number % every == 0)
        if stop or (due and not last):
            path = self._keep()
        elif due:  # written after the result, which a run resumed from it could not compute
            run.last_checkpoint = self._state()
        if stop:
            raise Interrupted(
                f"interrupted at t = {step.time:.6g}; resume with: incipient resume {quote(str(path))}"
            )

    def _row(self, step: TimeStep) -> dict[str, Any]:
        run = self._run
        row: dict[str, Any] = {
            "time": step.time,
            "step": step.length,
            "newton": step.report.iterations,
            "error": np.nan if step.error is None else step.error,
        }
        if (gust := run.setup.base_flow.gust) is not None:
            row["gust"] = gust.factor(step.time)
        with run.accounts.ledger.stage("fields"):
            if run.surface is not None:
                run.surface.read()
            if self.coupling is not None:
                row |= self.coupling.columns(step.report)
            for part in run.parts:
                row |= part.columns(step)
        if self._time.until_steady is not None:
            run.steady = self._steady(step.length, self._time.until_steady)
            row["change"] = run.steady.change
        row |= {
            quantity.column: quantity.measure(run)
            for quantity in of_runs.QUANTITIES
            if quantity.at_steps and quantity.measure is not None
        }
        return row if run.probe is None or run.grain is not None else row | self._loads(step)

    def _steady(self, length: float, tolerance: float) -> Steadied:
        """Whether the flow is steady: whether its change per unit time is at most `tolerance`.

        The change is the larger of the relative change of the velocities and that of the elevations over the depth,
        root mean squares.
        """
        run, now = self._run, self._run.fluid.state.x.array
        relative = run.fluid.relative(now - self.transient.past[0].state)
        if run.surface is not None:
            relative = max(relative, run.surface.risen() / run.scene.domain.height)
        rate = float(relative / length)
        return Steadied(rate <= tolerance, run.fluid.time, rate, tolerance)

    def _loads(self, step: TimeStep) -> dict[str, Any]:
        run, gdim = self._run, self._run.scene.gdim
        with run.stage("tractions"):
            load = load_on_grain(run)
        dimensionless, verdict = coefficients(run, load), judged(run, load)
        row: dict[str, Any] = {
            **columns_of_load(load, gdim),
            "drag": dimensionless.drag,
            "lift": dimensionless.lift,
            "moment": dimensionless.moment,
            "mode": "",
        }
        if verdict is None:
            return row
        factor = verdict["safety_factor"]
        if verdict["moves"] and run.first_motion is None:
            run.first_motion = step.time
        return row | {
            "mode": verdict["mode"],
            "safety_factor": np.nan if factor is None else factor,
        }

    def _keep(self) -> Path | None:
        with self._run.stage("checkpoint"):
            self.transient.forget()
            return self._recorder.keep(self._state())


def _interface(coupling: Coupling | None, turbulence: TurbulentFlow | None) -> Interface | None:
    return coupling if turbulence is None else turbulence.around(coupling)


def _make_moving(run: Run, motion: MeshMotion, checkpoint: Checkpoint | None) -> None:
    """Make moving grain and free surface of a run, at the start or for the mesh of a checkpoint."""
    scene, parts = run.scene, (run.setup, run.fluid, motion)
    if scene.has_surface:
        from ..coupled.moving_surface import MovingSurface

        run.surface = MovingSurface(*parts)
    if scene.moves:
        assert scene.body is not None
        if scene.body.touches:
            from ..coupled.grain_on_bed import GrainOnBed as Grain
        else:
            from ..coupled.moving_grain import MovingGrain as Grain  # type: ignore[assignment]
        made_for = None if checkpoint is None else checkpoint.body["made_for"]
        state = None if made_for is None else BodyState.unpacked(made_for)
        run.grain = Grain(*parts, state)

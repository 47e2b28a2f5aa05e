"""Time loop of a run: start, steps, records, checkpoints, interrupts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..effects import known
from ..errors import ConvergenceError, IncipientError, Interrupted, OutputError
from ..fluid import Fluid
from ..interrupt import Interruption
from ..planning.conditions import conditions
from ..planning.discretisation import of_steady
from ..planning.effects import EffectName
from ..results.loads import named, named_torque
from ..results.result import Steadied
from .build import flow_model
from .loads import coefficients, judged, loads
from .march import March
from .recorder import Recorder, record_fields
from .state import Run
from .steady import solve_steadily, solve_with_turbulence

if TYPE_CHECKING:
    from ..effects.moving_surface import MovingSurface
    from ..fluid.transient import TimeStep
    from ..restart import Checkpoint


NOT_STEADY = 'time.start: the steady flow did not converge; use a smaller numerics.mesh_size, or time.start = "rest"'
NOT_BEGUN = "flow: the oscillation does not begin; use a smaller numerics.mesh_size or velocity"


class TimeLoop:
    """Advances a run from its start or checkpoint to its end. Every method is collective."""

    def __init__(
        self,
        run: Run,
        recorder: Recorder,
        interruption: Interruption,
        checkpoint: Checkpoint | None,
    ):
        assert run.scene.time is not None
        self._run, self._time, self._recorder = run, run.scene.time, recorder
        self._interruption, self._checkpoint = interruption, checkpoint
        self._recorded = 0.0  # time of the last recorded step

    def to_the_end(self) -> None:
        """Advance to the end, recording each step.

        Raises Interrupted on request, with a checkpoint, and IncipientError if a step fails; the
        last converged state is stored if the recorder keeps checkpoints.
        """
        try:
            self._start()
            self._march()
        except Interrupted:
            raise
        except IncipientError as error:
            explained = self._kept_after(error)
            if explained is error:
                raise
            raise explained from error

    def _start(self) -> None:
        run, start = self._run, self._time.start
        if self._checkpoint is not None:
            return
        if not run.plan.has(EffectName.UNSTEADINESS):
            solve_steadily(run, run.fluid)
        elif run.scene.flow.oscillates:
            self._start_within_oscillation()
        elif start != "rest":
            self._start_from(inertia=start == "steady")

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
        held = conditions(run.setup, held=True, lid=True)
        turbulence = None if run.turbulence is None else run.turbulence.on(run.domain)
        if turbulence is not None:
            model = turbulence.within(model)
        with Fluid(run.domain, model, held, run.plan.reynolds) as initial:
            if turbulence is not None:
                turbulence.joined(initial)
            try:
                solve_with_turbulence(run, initial, turbulence)
            except ConvergenceError as error:
                if turbulence is None:
                    raise
                raise ConvergenceError(NOT_STEADY) from error
            run.fluid.state.x.array[:] = initial.state.x.array
            if turbulence is not None and run.turbulence is not None:
                run.turbulence.fields.state.x.array[:] = turbulence.fields.state.x.array

    def _march(self) -> None:
        run, time = self._run, self._time
        stage = run.stage("mesh motion" if run.scene.moves else "free surface")
        with stage if run.plan.has(EffectName.MOVING_MESH) else nullcontext():
            march, domain = March(run, self._checkpoint), run.domain
        if time.until_steady is not None:
            run.steadiness = Steadiness(
                run.fluid, run.surface, run.scene.domain.height, time.until_steady
            )
        for step in self._timed(march.steps()):
            if run.domain is not domain:
                domain = run.domain
                self._recorder.remeshed(domain)
            row, over = self._row(step), step.time >= time.end * (1 - 1e-9)
            last = over or run.is_steady or march.over
            self._record(step, row, last, kept=march.over and not over)
            if not last:
                march.check(step)

    def _timed(self, steps: Iterator[TimeStep]) -> Iterator[TimeStep]:
        """Count and time the steps; interrupts act between them."""
        run = self._run
        self._recorded, self._interruption.armed = run.fluid.time, True
        if run.surface is not None:
            run.surface.begin()
        while not run.is_steady:
            with run.stage("flow"), run.corrections.step():
                step = next(steps, None)
            if step is None:
                break
            run.accounts.count(steps=1, rejected=step.rejected, newton=step.report.iterations)
            yield step
        self._interruption.armed = False

    def _record(self, step: TimeStep, row: dict[str, Any], last: bool, kept: bool = False) -> None:
        run = self._run
        self._recorder.step(row)
        self._recorder.contacts([] if run.grain is None else run.grain.contact_rows())
        run.voice.advance(step.time, self._time.end)
        record_fields(self._recorder, run, step.number, last)
        self._recorded = step.time
        if not self._recorder.keeps:
            return
        every, stop = run.scene.output.checkpoint, self._interruption.asked() and not last
        due = kept or (every > 0 and step.number % every == 0)
        if stop or (due and not last):
            path = self._keep()
        elif due:  # written after the result, which a run resumed from it could not compute
            assert run.march is not None
            run.last_checkpoint = run.march.checkpoint()
        if stop:
            raise Interrupted(
                f"interrupted at t = {step.time:.6g}; resume with: incipient resume {path}"
            )

    def _row(self, step: TimeStep) -> dict[str, Any]:
        run = self._run
        assert run.march is not None
        row: dict[str, Any] = {
            "time": step.time,
            "step": step.length,
            "newton": step.report.iterations,
        }
        row["error"] = np.nan if step.error is None else step.error
        if (base_flow := run.setup.base_flow).gust is not None:
            row["gust"] = base_flow.factor(step.time)
        for part in run.parts:
            row |= part.columns(step)
        if run.march.coupling is not None:
            row |= run.march.coupling.columns(step.report)
        if run.grain is not None:
            row |= run.grain.energies()
        if run.steadiness is not None:
            row |= run.steadiness.column(step)
        for one in known.quantities(run.plan):
            if one.at_steps and one.measure is not None:
                row[one.column] = one.measure(run)
        return row if run.probe is None or run.grain is not None else row | self._loads(step)

    def _loads(self, step: TimeStep) -> dict[str, Any]:
        run, gdim = self._run, self._run.scene.gdim
        with run.stage("tractions"):
            force, torque = loads(run, surface=False)
        dimensionless = coefficients(run, force, torque)
        row: dict[str, Any] = named("force", force.flow, gdim) | named_torque(
            "torque", torque.flow, gdim
        )
        row |= {
            "drag": dimensionless.drag,
            "lift": dimensionless.lift,
            "moment": dimensionless.moment,
        }
        verdict = judged(run, force, torque)
        row["mode"] = verdict["mode"] if verdict else ""
        if verdict:
            factor = verdict["safety_factor"]
            row["safety_factor"] = np.nan if factor is None else factor
            if verdict["moves"]:
                run.would_move(step.time)
        return row

    def _keep(self) -> Path | None:
        march = self._run.march
        assert march is not None
        with self._run.stage("checkpoint"):
            march.transient.forget()
            return self._recorder.keep(march.checkpoint())

    def _kept_after(self, error: IncipientError) -> IncipientError:
        run = self._run
        # If recording a step failed, the history lacks its row, and the earlier checkpoint is valid.
        if isinstance(error, OutputError) or run.time_stepper is None or not self._recorder.keeps:
            return error
        if run.time_stepper.fluid.time != self._recorded:
            return error
        with suppress(OutputError):
            kept = self._keep()
            return type(error)(
                f"{error}; the state at t = {self._recorded:.6g} is saved: incipient resume {kept}"
            )
        return error


class Steadiness:
    """Rate of change of an unsteady flow. Every method is collective.

    `change` per unit time is the larger of the relative change of the velocities and that of the
    elevations over `depth`, root mean squares; at most `asked` in steady flow.
    """

    def __init__(self, fluid: Fluid, surface: MovingSurface | None, depth: float, asked: float):
        self._fluid, self._surface, self._depth, self._asked = fluid, surface, depth, asked
        self.change = np.inf
        self._before = fluid.state.x.array.copy()

    @property
    def reached(self) -> bool:
        return self.change <= self._asked

    def column(self, step: TimeStep) -> dict[str, float]:
        now = self._fluid.state.x.array
        changed, whole = (self._fluid.squared_velocities(one) for one in (now - self._before, now))
        self._before = now.copy()
        relative = np.sqrt(changed / whole) if whole else 0.0
        if self._surface is not None:
            relative = max(relative, self._surface.change(self._depth))
        self.change = float(relative / step.length)
        return {"change": self.change}

    def result(self) -> Steadied:
        return Steadied(self.reached, self._fluid.time, self.change, self._asked)

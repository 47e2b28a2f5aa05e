"""The way of a run through time: where it starts, each step and what is recorded of it, checkpoints, stopping."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import IncipientError, Interrupted, OutputError
from ..planning.effects import EffectName, moves
from ..results.loads import named, named_couple
from .build import flow_model
from .loads import coefficients, judged, loads
from .recorder import record_fields
from .steady import solve_steadily

if TYPE_CHECKING:
    from pathlib import Path

    from ..fluid import TimeStep
    from ..fluid.transient import Interface
    from ..interrupt import Interruption
    from ..restart.checkpoint import Checkpoint
    from .free_surface import MovingSurface
    from .moving_grain import Trajectory
    from .recorder import Recorder
    from .state import Run


class TimeLoop:
    """Takes a run from its start, or from its checkpoint, to the end of its time. Every method is collective.

    Args:
        run: the run of a scene in time. It gets the time integration, and the trajectory of a moving grain.
        recorder: told of every step.
        interruption: asked between steps whether to stop.
        checkpoint: where to go on from; None: from the start.
    """

    def __init__(
        self, run: Run, recorder: Recorder, interruption: Interruption, checkpoint: Checkpoint | None
    ):
        assert run.scene.time is not None
        self._run, self._time, self._recorder = run, run.scene.time, recorder
        self._interruption, self._checkpoint = interruption, checkpoint
        self._recorded = 0.0  # time of the last step that has been recorded

    def to_the_end(self) -> None:
        """Step by step, each recorded.

        Raises:
            Interrupted: it was asked for; what is needed to go on is kept.
            IncipientError: a step failed; the last good state is kept where the recorder keeps any.
        """
        try:
            self._start()
            if moves(self._run.scene):
                self._travel()
            else:
                self._march()
        except Interrupted:
            raise
        except IncipientError as error:
            told = self._kept_after(error)
            if told is error:
                raise
            raise told from error

    def _start(self) -> None:
        """Put the flow at time zero into the fluid's state: rest, the Stokes flow or the steady flow."""
        run, start = self._run, self._time.start
        if self._checkpoint is not None:
            return
        if not run.plan.has(EffectName.UNSTEADINESS):
            solve_steadily(run, run.fluid)
        elif start != "rest":
            self._start_from(inertia=start == "steady")

    def _start_from(self, inertia: bool) -> None:
        """A steady flow around the grain, which is held, as the fluid's state."""
        from ..fluid import Fluid
        from ..planning.conditions import conditions

        run = self._run
        model = flow_model(run.scene, run.plan, unsteady=False, inertia=inertia)
        held = conditions(run.scene, held=True, lid=True)
        eddies = None if run.turbulence is None else run.turbulence.on(run.domain)
        model = model if eddies is None else eddies.within(model)
        with Fluid(run.domain, model, held, run.plan.reynolds) as initial:
            if eddies is None:
                solve_steadily(run, initial)
            else:
                eddies.begin(run, initial)
            run.fluid.state.x.array[:] = initial.state.x.array

    def _march(self) -> None:
        """March with a grain that is held, or none, below a free surface or not."""
        from ..fluid import QuasiSteady, Transient
        from ..scene.tolerance import of_steady, of_steps

        run, time = self._run, self._time
        order = 2 if time.scheme == "bdf2" else 1
        kind = Transient if run.plan.has(EffectName.UNSTEADINESS) else QuasiSteady
        asked = run.scene.numerics.tolerance
        tolerance = of_steps(asked) if kind is Transient else of_steady(asked)
        surface = self._surface() if run.plan.has(EffectName.FREE_SURFACE) else None
        found, stage = run.turbulence, run.accounts.ledger.stage
        eddies = None if found is None else found.in_time(run.fluid, stage)
        coupling: Interface | None = eddies if surface is None else surface.coupling
        transient = kind(run.fluid, order, tolerance, time.tolerance, coupling)
        run.march_with(transient, surface=surface, eddies=eddies)
        if self._checkpoint is not None:
            from ..restart import resumption

            if surface is not None:
                resumption.put_back_surface(self._checkpoint, surface)
            if eddies is not None:
                resumption.put_back_turbulence(self._checkpoint, eddies)
            resumption.put_back_flow(self._checkpoint, transient)
        if time.until_steady is not None:
            from .steadiness import Steadiness

            run.watch(Steadiness(run.fluid, surface, run.scene.domain.height, time.until_steady))
        for step in self._timed(transient.march(time.end, time.step, time.first_step)):
            row = self._row(step)
            last = run.is_steady or step.time >= time.end * (1 - 1e-9)
            self._record(step, row, last)
            if surface is not None and not last:
                surface.ends(step)

    def _surface(self) -> MovingSurface:
        """The free surface at the start, above a mesh as it was made."""
        from ..mesh.motion import MeshMotion
        from .free_surface import MovingSurface

        run = self._run
        with run.stage("free surface"):
            surface = MovingSurface(run.scene, run.fluid, run.accounts.ledger.stage)
            surface.coupled(MeshMotion(run.domain))
        return surface

    def _travel(self) -> None:
        """March with a grain that moves."""
        run, time = self._run, self._time
        travel, domain = self._trajectory(), run.domain
        run.march_with(travel.transient, travel)
        for step in self._timed(travel.steps()):
            if run.domain is not domain:
                domain = run.domain
                self._recorder.remeshed(domain)
            met, over = travel.coupling.met, step.time >= time.end * (1 - 1e-9)
            self._record(step, travel.row(step), met or over, kept=met and not over)
            if travel.surface is not None and not (met or over):
                travel.surface.ends(step, travel.state.placement)

    def _trajectory(self) -> Trajectory:
        """The grain and its surroundings, at the start or as the checkpoint has them."""
        from .moving_grain import Trajectory

        run = self._run
        parts = (run.scene, run.plan, run.fluid, run.accounts.ledger.stage)
        with run.stage("mesh motion"):
            if self._checkpoint is None:
                return Trajectory(*parts, run.voice, turbulence=run.turbulence)
            from ..restart import resumption

            assert self._checkpoint.body is not None
            state = resumption.state_of_mesh(self._checkpoint.body)
            travel = Trajectory(*parts, run.voice, state, run.turbulence)
            resumption.put_back_body(self._checkpoint, travel)
            return travel

    # -- each step --------------------------------------------------------------------------------

    def _timed(self, steps: Iterator[TimeStep]) -> Iterator[TimeStep]:
        """The steps, each counted and its time taken; from the first on, the run can be stopped between them."""
        run = self._run
        self._recorded, self._interruption.armed = run.fluid.time, True
        run.read_surface()
        while not run.is_steady:
            with run.stage("flow"), run.corrections.begun():
                step = next(steps, None)
                run.corrections.book_step(step.number if step else 0)
            if step is None:
                break
            run.accounts.count(steps=1, rejected=step.rejected, newton=step.report.iterations)
            yield step
        self._interruption.armed = False

    def _record(self, step: TimeStep, row: dict[str, Any], last: bool, kept: bool = False) -> None:
        """Hand a step over to the recorder, with a checkpoint where one is due, and stop if that was asked for.

        `kept` asks for one of the last step: a run that has ended at contact may go on otherwise.
        """
        run = self._run
        run.read_surface()
        self._recorder.step(row)
        run.voice.advance(step.time, self._time.end)
        record_fields(self._recorder, run, step.number, last)
        self._recorded = step.time
        if not self._recorder.keeps:
            return
        every, stop = run.scene.output.checkpoint, self._interruption.asked() and not last
        if stop or kept or (every > 0 and step.number % every == 0):
            path = self._keep()
        if stop:
            raise Interrupted(f"interrupted at t = {step.time:.6g}; to go on: incipient resume {path}")

    def _row(self, step: TimeStep) -> dict[str, Any]:
        """One line of the history of a grain that is held, or of a flow without one."""
        run = self._run
        row: dict[str, Any] = {"time": step.time, "step": step.length, "newton": step.report.iterations}
        row["error"] = np.nan if step.error is None else step.error
        if run.surface is not None:
            row |= run.surface.columns(step)
        if run.turbulence is not None:
            row |= run.turbulence.report(run.fluid).columns()
        if run.steadiness is not None:
            row |= run.steadiness.column(step)
        if run.probe is None:
            return row
        with run.stage("tractions"):
            force, couple = loads(run, surface=False)
        found = coefficients(run.scene, force, couple)
        gdim = run.scene.gdim
        row |= named("force", force.flow, gdim) | named_couple("couple", couple.flow, gdim)
        row |= {"drag": found.drag, "lift": found.lift, "moment": found.moment}
        verdict = judged(run, force, couple)
        row["mode"] = verdict["mode"] if verdict else ""
        if verdict:
            factor = verdict["safety_factor"]
            row["safety_factor"] = np.nan if factor is None else factor
        if verdict and verdict["moves"]:
            run.would_move(step.time)
        return row

    # -- going on later ---------------------------------------------------------------------------

    def _keep(self) -> Path | None:
        from ..restart.resumption import collected

        with self._run.stage("checkpoint"):
            assert self._run.time_stepper is not None
            self._run.time_stepper.forget()
            return self._recorder.keep(collected(self._run))

    def _kept_after(self, error: IncipientError) -> IncipientError:
        """Keep the last good state after a failed step; return the error, which says where that is kept."""
        run = self._run
        # A failure while a step was recorded leaves a history that lacks its row: the checkpoint before it holds.
        if isinstance(error, OutputError) or run.time_stepper is None or not self._recorder.keeps:
            return error
        if run.time_stepper.fluid.time != self._recorded:
            return error
        with suppress(OutputError):
            kept = self._keep()
            return type(error)(f"{error}; t = {self._recorded:.6g} is kept: incipient resume {kept}")
        return error

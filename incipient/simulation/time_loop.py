"""A simulation's way through time: where it starts, each step and what is recorded of it, checkpoints, stopping."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import IncipientError, Interrupted, OutputError
from ..planning.effects import EffectName
from .assemble import coefficients, judged, loads

if TYPE_CHECKING:
    from pathlib import Path

    from ..fluid import TimeStep
    from .moving_grain import Trajectory
    from .simulate import Simulation


class March:
    """Takes a simulation from its start, or from its checkpoint, to the end of its time. Every method is collective.

    Args:
        simulation: of a scene in time, with its fluid made. It gets the time integration, and for a moving grain
            the trajectory and the fluid on the newest mesh.
    """

    def __init__(self, simulation: Simulation):
        assert simulation.scene.time is not None
        self._of, self._time = simulation, simulation.scene.time
        self._recorded = 0.0  # time of the last step that has been recorded

    def to_the_end(self) -> None:
        """Step by step, each recorded.

        Raises:
            Interrupted: it was asked for; what is needed to go on is kept.
            IncipientError: a step failed; the last good state is kept where the recorder keeps any.
        """
        try:
            self._start()
            if self._of.plan.has(EffectName.MOVING_MESH):
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
        simulation, start = self._of, self._time.start
        if simulation.checkpoint is not None:
            return
        if not simulation.plan.has(EffectName.UNSTEADINESS):
            simulation.solve_steadily(simulation.fluid)
        elif start != "rest":
            self._start_from(inertia=start == "steady")

    def _start_from(self, inertia: bool) -> None:
        """A steady flow around the grain, which is held, as the fluid's state."""
        from ..fluid import Fluid
        from ..planning import conditions as boundaries

        simulation = self._of
        model = simulation.model(unsteady=False, inertia=inertia)
        conditions = boundaries.conditions(simulation.scene, held=True)
        with Fluid(simulation.domain, model, conditions, simulation.plan.reynolds) as initial:
            simulation.solve_steadily(initial)
            simulation.fluid.state.x.array[:] = initial.state.x.array

    def _march(self) -> None:
        """March with a grain that is held, or none."""
        from ..fluid import QuasiSteady, Transient

        simulation, time = self._of, self._time
        order = 2 if time.scheme == "bdf2" else 1
        kind = Transient if simulation.plan.has(EffectName.UNSTEADINESS) else QuasiSteady
        tolerance = max(simulation.scene.numerics.tolerance, 1e-9)
        transient = simulation.transient = kind(simulation.fluid, order, tolerance, time.tolerance)
        if simulation.checkpoint is not None:
            from ..restart import resumption

            resumption.put_back_flow(simulation.checkpoint, transient)
        for step in self._timed(transient.march(time.end, time.step)):
            last = step.time >= time.end * (1 - 1e-9)
            self._record(step, self._row(step), last)

    def _travel(self) -> None:
        """March with a grain that moves."""
        simulation, time = self._of, self._time
        travel = simulation.trajectory = self._trajectory()
        simulation.transient = travel.transient
        for step in self._timed(travel.steps()):
            if travel.fluid is not simulation.fluid:
                simulation.take_over(travel)
                simulation.recorder.remeshed(simulation.domain)
            simulation.probe = travel.coupling.probe
            met, over = travel.coupling.met, step.time >= time.end * (1 - 1e-9)
            self._record(step, travel.row(step), met or over, kept=met and not over)

    def _trajectory(self) -> Trajectory:
        """The grain and its surroundings, at the start or as the checkpoint has them."""
        from .moving_grain import Trajectory

        simulation = self._of
        parts = (simulation.scene, simulation.plan, simulation.fluid, simulation.ledger.stage)
        with simulation.stage("mesh motion"):
            if simulation.checkpoint is None:
                return Trajectory(*parts, simulation.voice)
            from ..restart import resumption

            assert simulation.checkpoint.body is not None
            state = resumption.state_of_mesh(simulation.checkpoint.body)
            travel = Trajectory(*parts, simulation.voice, state)
            resumption.put_back_body(simulation.checkpoint, travel)
            return travel

    # -- each step --------------------------------------------------------------------------------

    def _timed(self, steps: Iterator[TimeStep]) -> Iterator[TimeStep]:
        """The steps, each counted and its time taken; from the first on, the run can be stopped between them."""
        simulation = self._of
        self._recorded, simulation.interruption.armed = simulation.fluid.time, True
        while True:
            with simulation.stage("flow"), simulation.corrections.begun():
                step = next(steps, None)
                simulation.corrections.book_step(step.number if step else 0)
            if step is None:
                break
            simulation.count(steps=1, rejected=step.rejected, newton=step.report.iterations)
            yield step
        simulation.interruption.armed = False

    def _record(self, step: TimeStep, row: dict[str, Any], last: bool, kept: bool = False) -> None:
        """Hand a step over to the recorder, with a checkpoint where one is due, and stop if that was asked for.

        `kept` asks for one of the last step: a run that has ended at contact may go on otherwise.
        """
        simulation = self._of
        simulation.recorder.step(row)
        simulation.voice.advance(step.time, self._time.end)
        simulation.hand_over_fields(step.number, last)
        self._recorded = step.time
        if not simulation.recorder.keeps:
            return
        every, stop = simulation.scene.output.checkpoint, simulation.interruption.asked() and not last
        if stop or kept or (every > 0 and step.number % every == 0):
            path = self._keep()
        if stop:
            raise Interrupted(f"interrupted at t = {step.time:.6g}; to go on: incipient resume {path}")

    def _row(self, step: TimeStep) -> dict[str, Any]:
        """One line of the history of a grain that is held, or of a flow without one."""
        simulation = self._of
        row: dict[str, Any] = {"time": step.time, "step": step.length, "newton": step.report.iterations}
        row["error"] = np.nan if step.error is None else step.error
        if simulation.probe is None:
            return row
        with simulation.stage("tractions"):
            force, couple = loads(simulation, surface=False)
        found = coefficients(simulation.scene, force, couple)
        row |= {"force_x": force.flow[0], "force_y": force.flow[1], "couple": couple.flow[2]}
        row |= {"drag": found.drag, "lift": found.lift, "moment": found.moment}
        verdict = judged(simulation, force, couple)
        row["mode"] = verdict["mode"] if verdict else ""
        if verdict and verdict["moves"] and simulation.first_motion is None:
            simulation.first_motion = step.time
        return row

    # -- going on later ---------------------------------------------------------------------------

    def _keep(self) -> Path | None:
        from ..restart.resumption import collected

        with self._of.stage("checkpoint"):
            return self._of.recorder.keep(collected(self._of))

    def _kept_after(self, error: IncipientError) -> IncipientError:
        """After a failed step keep the last good state; the error with where that is."""
        simulation = self._of
        if simulation.trajectory is not None:
            simulation.take_over(simulation.trajectory)
        # A failure while a step was recorded leaves a history that lacks its row: the checkpoint before it holds.
        if isinstance(error, OutputError) or simulation.transient is None or not simulation.recorder.keeps:
            return error
        if simulation.transient.fluid.time != self._recorded:
            return error
        with suppress(OutputError):
            kept = self._keep()
            return type(error)(f"{error}; t = {self._recorded:.6g} is kept: incipient resume {kept}")
        return error

"""Runs a plan: builds the sub-problems that it names, solves, reads the tractions, judges.

One data flow: scene, plan, fluid, tractions, contact, result. What happens outside (files, terminal) is
told through a `Recorder` and a voice; this module writes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from . import layout as layouts
from .attribution import Corrections, cost_of_effects
from .errors import IncipientError, Interrupted, OutputError
from .interrupt import Interruption
from .ledger import Ledger, peak_memory_mib
from .plan import Estimate, Plan, make_plan
from .progress import Silent
from .recorder import Recorder, Unrecorded
from .scene import Scene

if TYPE_CHECKING:
    from pathlib import Path

    from mpi4py import MPI

    from .accuracy.errorbars import ErrorBars, Loads, Term
    from .contact import Contacts
    from .domain import Domain
    from .fluid import Fluid, TimeStep, Transient
    from .layout import Layout
    from .omitted import Omission
    from .restart.checkpoint import Checkpoint
    from .result import Couples, Forces, Result
    from .tractions import TractionProbe
    from .trajectory import Trajectory


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
    """One run of one scene, from the mesh to the result."""

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
    sizing: Callable[[Layout], Layout] = lambda layout: layout  # what an adaptation makes of cell sizes
    known: dict[str, Term | Loads] = field(default_factory=dict)  # see `errorbars.error_bars`
    _recorded: float = 0.0  # time of the last step that has been recorded

    def __post_init__(self) -> None:
        self.interruption = Interruption(self.comm)

    def run(self) -> Result:
        """Plan, mesh, solve, judge. Collective."""
        with self.interruption if self.recorder.keeps else nullcontext(), self.prepared():
            return self._solved()

    @contextmanager
    def prepared(self) -> Iterator[None]:
        """Plan, mesh and build the fluid; free its memory at the end. Collective."""
        scene = self.scene
        with self._stage("plan"):
            self.plan = make_plan(scene)
            self.layout = self.sizing(layouts.lay_out(scene, self.plan))
            self.corrections = Corrections(self.ledger, self.plan)
        with self._stage("import"):
            from . import boundaries, domain, fluid
        with self._stage("mesh"):
            self.contacts = self._contacts()
            self.domain = self._resumed_domain() or domain.build(self.comm, self.layout.drawing, scene.gdim)
        self.recorder.begin(scene, self.plan, self.domain)
        with self._stage("forms"):
            model = self._model(unsteady=self.plan.has("unsteadiness"))
            conditions = boundaries.conditions(scene)
            self.fluid: Fluid = fluid.Fluid(self.domain, model, conditions, self.plan.reynolds)
            self.fluid.watch = self.corrections.made
            self.probe = self._probe()
        with ExitStack() as stack:
            # Another fluid may have taken its place by then.
            stack.push(lambda *exception: self.fluid.__exit__(*exception))
            yield

    def loads_at(self, factor: float) -> tuple[Forces, Couples]:
        """Solve steadily with the flow faster by a factor at the same viscosity; the loads then. Collective.

        In units of the faster flow only the Reynolds number changes, so the mesh, the forms and the last
        solution serve again; forces go back to scene units with the factor squared.
        """
        self.fluid.reynolds = factor * self.plan.reynolds
        self._solve_steadily(self.fluid)
        return self._loads(surface=False, speed=factor)

    def conclude(self, recorder: Recorder) -> Result:
        """Hand a steady flow that has been solved over to a recorder; its result. Collective."""
        self.recorder = recorder
        recorder.begin(self.scene, self.plan, self.domain)
        self._hand_over_fields(0, last=True)
        return self._finished()

    def _finished(self) -> Result:
        result = self._result()
        self.recorder.finish(result)
        return result

    def _solved(self) -> Result:
        try:
            if self.scene.time is None:
                self._solve_steadily(self.fluid)
                self._hand_over_fields(0, last=True)
            elif self.plan.has("moving mesh"):
                self._travel()
            else:
                self._march()
        except Interrupted:
            raise
        except IncipientError as error:
            told = self._kept_after(error)
            with suppress(OutputError):  # a full disk is told of once, and another failure before it
                self.recorder.finish(self._result("failed", str(told)))
            if told is error:
                raise
            raise told from error
        return self._finished()

    def _stage(self, name: str) -> Any:
        self.voice.begin(name)
        return self.ledger.stage(name)

    def _model(self, unsteady: bool, inertia: bool = True) -> Any:
        from .fluid import FlowModel

        convection = self.plan.convection if unsteady else "implicit"
        return FlowModel(
            order=self.plan.order,
            inertia=inertia and self.plan.has("inertia"),
            unsteady=unsteady,
            convection=convection,
            moving_mesh=unsteady and self.plan.has("moving mesh"),
            energy_stable=unsteady and self.scene.numerics.form == "energy-stable",
            stabilisation=self.plan.stabilisation.present,
        )

    def _contacts(self) -> Contacts | None:
        if not self.plan.has("contact"):
            return None
        with self.ledger.stage("contact"):
            from .judgement import find_contacts

            return find_contacts(self.scene)

    def _probe(self) -> TractionProbe | None:
        if self.layout.placement is None:
            return None
        from .tractions import TractionProbe

        return TractionProbe(self.fluid, "body", self.layout.placement.centre)

    # -- solution -------------------------------------------------------------------------------

    def _solve_steadily(self, fluid: Fluid) -> None:
        from .fluid import solve_steady

        numerics = self.scene.numerics
        with self._stage("flow"), self.corrections.begun():
            steps = solve_steady(
                fluid,
                numerics.tolerance,
                numerics.max_iterations,
                first_share=self._first_share(),
                watch=self.corrections.heard(self.voice.iterate),
            )
            self.corrections.book_steady(steps)
        newton = sum(step.report.iterations for step in steps)
        for name, number in (("continuation", len(steps)), ("newton", newton)):
            self.iterations[name] = self.iterations.get(name, 0) + number

    def _first_share(self) -> float:
        """Where the continuation starts: at once, unless the Reynolds number of the whole flow is large."""
        whole = self.plan.reynolds * self.scene.reference_velocity * self.scene.domain.height
        return min(1.0, 200.0 / whole) if self.plan.has("inertia") else 1.0

    def _march(self) -> None:
        from .fluid import QuasiSteady, Transient

        time, numerics = self.scene.time, self.scene.numerics
        assert time is not None
        self._start()
        order = 2 if time.scheme == "bdf2" else 1
        kind = Transient if self.plan.has("unsteadiness") else QuasiSteady
        transient = kind(self.fluid, order, max(numerics.tolerance, 1e-9), time.tolerance)
        if self.checkpoint is not None:
            from .restart import resumption

            resumption.put_back_flow(self.checkpoint, transient)
        self.transient = transient
        for step in self._timed(transient.march(time.end, time.step)):
            last = step.time >= time.end * (1 - 1e-9)
            self._record(step, self._row(step), last)

    def _travel(self) -> None:
        """March with a grain that moves."""
        from .restart import resumption
        from .trajectory import Trajectory

        time = self.scene.time
        assert time is not None
        self._start()
        kept = self.checkpoint.body if self.checkpoint else None
        with self._stage("mesh motion"):
            state = resumption.state_of_mesh(kept) if kept else None
            travel = Trajectory(self.scene, self.plan, self.fluid, self.ledger.stage, self.voice, state)
            if self.checkpoint is not None:
                resumption.put_back_body(self.checkpoint, travel)
        self.trajectory, self.transient = travel, travel.transient
        for step in self._timed(travel.steps()):
            if travel.fluid is not self.fluid:
                self._take_over(travel)
                self.recorder.remeshed(self.domain)
            self.probe = travel.coupling.probe
            last = travel.coupling.met or step.time >= time.end * (1 - 1e-9)
            self._record(step, travel.row(step), last)

    def _take_over(self, travel: Trajectory) -> None:
        """The fluid is now that on the trajectory's newest mesh."""
        self.fluid, self.domain, self.probe = travel.fluid, travel.domain, travel.coupling.probe

    def _timed(self, steps: Iterator[TimeStep]) -> Iterator[TimeStep]:
        """The steps, each counted and its time taken; from the first on, the run can be stopped between them."""
        self._recorded, self.interruption.armed = self.fluid.time, True
        while True:
            with self._stage("flow"), self.corrections.begun():
                step = next(steps, None)
                self.corrections.book_step(step.number if step else 0)
            if step is None:
                break
            self._count(step)
            yield step
        self.interruption.armed = False

    def _record(self, step: TimeStep, row: dict[str, Any], last: bool) -> None:
        """Hand a step over to the recorder, with a checkpoint where one is due, and stop if that was asked for."""
        self.recorder.step(row)
        if self.scene.time is not None:
            self.voice.advance(step.time, self.scene.time.end)
        self._hand_over_fields(step.number, last)
        self._recorded = step.time
        if not self.recorder.keeps:
            return
        every, stop = self.scene.output.checkpoint, self.interruption.asked() and not last
        if stop or (every > 0 and step.number % every == 0):
            kept = self._keep()
        if stop:
            raise Interrupted(f"interrupted at t = {step.time:.6g}; to go on: incipient resume {kept}")

    def _start(self) -> None:
        """Put the flow at time zero into the fluid's state: rest, the Stokes flow or the steady flow."""
        from . import boundaries
        from .fluid import Fluid

        start = self.scene.time.start if self.scene.time else "rest"
        if self.checkpoint is not None:
            return
        if not self.plan.has("unsteadiness"):
            self._solve_steadily(self.fluid)
            return
        if start == "rest":
            return
        model = self._model(unsteady=False, inertia=start == "steady")
        conditions = boundaries.conditions(self.scene, held=True)
        with Fluid(self.domain, model, conditions, self.plan.reynolds) as initial:
            self._solve_steadily(initial)
            self.fluid.state.x.array[:] = initial.state.x.array

    def _count(self, step: TimeStep) -> None:
        for name, number in (("steps", 1), ("rejected", step.rejected), ("newton", step.report.iterations)):
            self.iterations[name] = self.iterations.get(name, 0) + number

    def _row(self, step: TimeStep) -> dict[str, Any]:
        """One line of the history."""
        row: dict[str, Any] = {"time": step.time, "step": step.length, "newton": step.report.iterations}
        row["error"] = np.nan if step.error is None else step.error
        if self.probe is None:
            return row
        with self._stage("tractions"):
            force, couple = self._loads(surface=False)
        coefficients = self._coefficients(force, couple)
        row |= {"force_x": force.flow[0], "force_y": force.flow[1], "couple": couple.flow[2]}
        row |= {"drag": coefficients.drag, "lift": coefficients.lift, "moment": coefficients.moment}
        verdict = self._judged(force, couple)
        row["mode"] = verdict["mode"] if verdict else ""
        if verdict and verdict["moves"] and self.first_motion is None:
            self.first_motion = step.time
        return row

    def _hand_over_fields(self, number: int, last: bool) -> None:
        if not self.recorder.wants_fields(number, last):
            return
        from .fluid.vorticity import vorticity

        with self._stage("fields"):
            fields = {"velocity": self.fluid.velocity, "pressure": self.fluid.pressure}
            fields["vorticity"] = vorticity(self.fluid)
            traction = self.probe.field() if self.probe else None
            self.recorder.fields(self.fluid.time, fields, traction)

    # -- going on later -------------------------------------------------------------------------

    def _resumed_domain(self) -> Domain | None:
        """The mesh of the checkpoint, if there is one, and what the sessions before have cost."""
        if self.checkpoint is None:
            return None
        from .restart import resumption

        resumption.put_back_costs(self.checkpoint.progress, self)
        return resumption.domain_of(self.checkpoint, self.comm)

    def _keep(self) -> Path | None:
        from .restart.resumption import collected

        with self._stage("checkpoint"):
            return self.recorder.keep(collected(self))

    def _kept_after(self, error: IncipientError) -> IncipientError:
        """After a failed step keep the last good state; the error with where that is."""
        if self.trajectory is not None:
            self._take_over(self.trajectory)
        # A failure while a step was recorded leaves a history that lacks its row: the checkpoint before it holds.
        if isinstance(error, OutputError) or self.transient is None or not self.recorder.keeps:
            return error
        if self.transient.fluid.time != self._recorded:
            return error
        with suppress(OutputError):
            kept = self._keep()
            return type(error)(f"{error}; t = {self._recorded:.6g} is kept: incipient resume {kept}")
        return error

    # -- results --------------------------------------------------------------------------------

    def _loads(self, surface: bool, speed: float = 1.0) -> tuple[Forces, Couples]:
        """Forces and couples on the grain for speeds in units of `speed`; the surface integral where asked for."""
        from .result import Couples, Forces

        assert self.probe is not None and self.scene.grain is not None
        flow = self.probe.resultant()
        check = self.probe.surface_resultant() if surface else flow
        volume, gravity = self.scene.grain.volume, np.append(self.scene.gravity_vector, 0.0)
        mass = self.scene.mass or 0.0
        unit = speed**2
        force = Forces(unit * flow.force, unit * check.force, -volume * gravity, mass * gravity)
        return force, Couples(unit * flow.couple, unit * check.couple, flow.about)

    def _coefficients(self, force: Forces, couple: Couples) -> Any:
        from .result import Coefficients

        assert self.scene.grain is not None
        velocity, length = self.scene.reference_velocity, self.scene.grain.size
        unit = 0.5 * velocity**2 * length
        drag, lift = force.flow[:2] / unit
        return Coefficients(drag, lift, couple.flow[2] / (unit * length), velocity, length)

    def _judged(self, force: Forces, couple: Couples) -> dict[str, Any] | None:
        if self.contacts is None:
            return None
        with self.ledger.stage("contact"):
            from .judgement import judge

            verdict = judge(self.scene, self.contacts, force, couple)
        if verdict is not None and self.scene.time is not None:
            verdict["first_motion"] = self.first_motion
        return verdict

    def _result(self, status: str = "complete", error: str = "") -> Result:
        from .result import Result, gap_of
        from .sampling import centrelines

        force = couple = coefficients = verdict = None
        with self._stage("tractions"):
            if self.probe is not None:
                force, couple = self._loads(surface=True)
                coefficients = self._coefficients(force, couple)
                if status == "complete":
                    verdict = self._judged(force, couple)
            gap = None if self.trajectory is not None else gap_of(self.layout, self.domain)
            lines = centrelines(self.scene, self.fluid)
        bars = None
        if status == "complete" and force is not None and couple is not None:
            bars = self._error_bars(force, couple)
        return Result(
            title=self.scene.title,
            plan=self.plan,
            scene=self.scene.model_dump(mode="json"),
            force=force,
            couple=couple,
            coefficients=coefficients,
            grain=self._grain(),
            gap=gap,
            contacts=self.described_contacts(),
            verdict=verdict,
            trajectory=None if self.trajectory is None else self.trajectory.summary(),
            centrelines=lines,
            error_bars=bars,
            omitted=self._omissions(force, couple, verdict) if status == "complete" else (),
            cost=self.cost(),
            status=status,
            error=error,
            velocity=self.fluid.velocity,
            pressure=self.fluid.pressure,
        )

    def _omissions(self, *found: Any) -> tuple[Omission, ...]:
        from .omitted import omissions

        with self._stage("omitted effects"):
            return omissions(self, *found)

    def _error_bars(self, force: Forces, couple: Couples) -> ErrorBars | None:
        if not self.scene.numerics.error_bars:
            return None
        from .accuracy.errorbars import error_bars

        with self._stage("error bars"):
            return error_bars(self, force, couple)

    def described_contacts(self) -> list[dict[str, Any]]:
        """Contacts as plain data: point, outward normal of the grain, area (0 for a point)."""
        if self.contacts is None:
            return []
        areas = np.zeros(len(self.contacts.points)) if self.contacts.areas is None else self.contacts.areas
        rows = zip(self.contacts.points, self.contacts.normals, areas, strict=True)
        return [{"point": list(p), "normal": list(n), "area": float(a)} for p, n, a in rows]

    def _grain(self) -> dict[str, Any] | None:
        """Place of the grain at rest and where the flow was computed, and its outline there."""
        resting, placement, grain = self.layout.resting, self.layout.placement, self.scene.grain
        if self.trajectory is not None:
            resting = placement = self.trajectory.state.placement
        if resting is None or placement is None or grain is None:
            return None
        return {
            "centre": resting.centre,
            "computed_centre": placement.centre,
            "angle": resting.angle,
            "size": grain.size,
            "volume": grain.volume,
        }

    def cost(self) -> dict[str, Any]:
        """Wall time by stage, unknowns, iterations, memory, versions. Collective."""
        from . import compat

        mesh, statistics = self.domain.mesh, self.fluid.solver.statistics
        memory = self.comm.allgather(peak_memory_mib())
        return {
            "wall_time": self.ledger.to_dict(),
            "effects": cost_of_effects(self),
            "unknowns": self.fluid.space.unknowns,
            "cells": mesh.topology.index_map(mesh.topology.dim).size_global,
            "iterations": {
                **self.iterations,
                "factorisations": statistics.factorisations,
                "krylov": statistics.krylov_iterations,
            },
            "peak_memory_mib": sum(memory),
            "ranks": self.comm.size,
            "versions": compat.versions(),
        }


def estimate(scene: Scene) -> Plan:
    """The plan with its expense, counted by making the mesh on this process. Not collective."""
    plan = make_plan(scene)
    expense: Estimate = layouts.count(layouts.lay_out(scene, plan), plan.order)
    return plan.with_estimate(expense)

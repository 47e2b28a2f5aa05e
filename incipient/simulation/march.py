"""Time integration of a run: flow, coupled parts and remeshing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from ..body.state import BodyState
from ..errors import IncipientError, MeshError
from ..fluid import Fluid
from ..fluid.transient import Interface, Past, QuasiSteady, TimeStep, Transient, of_steps
from ..mesh import domain
from ..planning import meshing
from ..planning.discretisation import of_steady, with_order
from ..planning.effects import EffectName
from ..scene.file import dumps
from ..setup.setup import Setup
from .state import Run

if TYPE_CHECKING:
    from ..coupled.coupling import Coupling
    from ..coupled.part import Part
    from ..effects.moving_grain.part import MovingGrain
    from ..effects.moving_surface import MovingSurface
    from ..mesh.motion import MeshMotion
    from ..restart import Checkpoint


class March:
    """Time integration of a run, from its start or a checkpoint. Every method is collective.

    coupling: of flow and moving boundaries, or None.
    """

    def __init__(self, run: Run, checkpoint: Checkpoint | None):
        assert run.scene.time is not None
        self._run, self._time = run, run.scene.time
        self.coupling: Coupling | None = None
        moving: list[MovingGrain | MovingSurface] = []
        if run.plan.has(EffectName.MOVING_MESH):
            from ..mesh.motion import MeshMotion

            motion = MeshMotion(run.fluid.domain)
            moving = _moving_parts(run, motion, checkpoint)
            self.coupling = self._coupled(run.fluid, moving, motion)
        kind = Transient if run.plan.has(EffectName.UNSTEADINESS) else QuasiSteady
        asked = run.scene.numerics.tolerance
        tolerance = of_steps(asked) if kind is Transient else of_steady(asked)
        order = 2 if self._time.scheme == "bdf2" else 1
        interface: Interface | None = self.coupling
        if run.turbulence is not None:
            interface = run.turbulence.around(interface)
        self.transient = kind(run.fluid, order, tolerance, self._time.tolerance, interface)
        run.march, run.parts = self, (*moving, *run.parts)
        if checkpoint is not None:
            self._restore(checkpoint)

    @property
    def over(self) -> bool:
        grain = self._run.grain
        return grain is not None and grain.ends != ""

    def steps(self) -> Iterator[TimeStep]:
        """Advance to the end or an event of a moving grain (see `Transient.march`).

        Raises ConvergenceError if a step fails, MeshError if remeshing does; the last converged
        state is kept.
        """
        time = self._time
        self._renew_worn_mesh()
        for step in self.transient.march(time.end, time.step, time.first_step):
            for part in self._run.parts:
                part.accept_step(step)
            yield step
            if self.over or time.end - step.time <= 1e-9 * time.end:
                return
            self._renew_worn_mesh()

    def check(self, step: TimeStep) -> None:
        grain, surface = self._run.grain, self._run.surface
        if surface is not None:
            surface.check(step, None if grain is None else grain.state.placement)

    def _coupled(self, fluid: Fluid, moving: Sequence[Part], motion: MeshMotion) -> Coupling:
        from ..coupled.coupling import Coupling

        asked = self._run.scene.numerics.interface_tolerance
        tolerance = None if asked == "auto" else asked
        stage = self._run.accounts.ledger.stage
        coupling = Coupling(fluid, moving, motion, tolerance, stage=stage)
        fluid.domain.mesh.geometry.x[:] = coupling.places[0]
        fluid.constraints.boundary_points_moved()
        return coupling

    def _restore(self, checkpoint: Checkpoint) -> None:
        from ..restart import put_back_flow, spread_nodes

        fluid, mesh = self._run.fluid, self._run.fluid.domain.mesh
        if self.coupling is not None:
            assert checkpoint.motion is not None
            places = spread_nodes(mesh, checkpoint.motion.places)
            self.coupling.places = list(np.moveaxis(places, 1, 0).copy())
            # Values stored by node position belong to the mesh of that time.
            mesh.geometry.x[:] = self.coupling.places[0]
            fluid.constraints.boundary_points_moved()
        for part in self._run.parts:
            part.resume(checkpoint)
        put_back_flow(checkpoint, self.transient)

    def checkpoint(self) -> Checkpoint:
        """The state between two steps, complete on rank 0."""
        from ..restart import (
            Checkpoint,
            Progress,
            StoredMotion,
            numbered_nodes,
            stored_flow,
            stored_mesh,
        )

        run, transient, coupling = self._run, self.transient, self.coupling
        fluid, ledger = transient.fluid, run.accounts.ledger
        progress = Progress(
            number=transient.number,
            next_length=transient.next_length,
            error=transient.last_error,
            first_motion=run.first_motion,
            iterations=dict(run.accounts.iterations),
            linear=asdict(fluid.solver.statistics),
            wall_time=dict(ledger.wall_time),
            total=ledger.total(),
        )
        states = [fluid.state.x.array, *(one.state for one in transient.past)]
        stored: dict[str, Any] = {**stored_flow(fluid, states)}
        for part in run.parts:
            stored |= part.stored(transient)
        if coupling is not None:
            nodes = numbered_nodes(fluid.domain.mesh)
            places = nodes.joined(np.stack(coupling.places, axis=1))
            stored["motion"] = StoredMotion(nodes.joined(coupling.motion.reference), places)
        return Checkpoint(
            # Later versions may choose another order.
            scene=dumps(with_order(run.scene, run.plan.order)),
            progress=progress,
            mesh=stored_mesh(fluid.domain),
            times=np.array([fluid.time, *(one.time for one in transient.past)]),
            **stored,
        )

    def _renew_worn_mesh(self) -> None:
        grain = self._run.grain
        if grain is None or self.coupling is None or (length := grain.last_step()) is None:
            return
        ahead = self.coupling.quality_ahead(length, self.transient.order)
        if ahead.relative >= self._run.scene.numerics.remesh_below:
            return
        first = grain.drawn()
        try:
            self._remesh(grain, self.coupling)
        except MeshError:
            grain.meshes_ahead = False  # a predicted mesh may fold as it moves back to the grain
            if grain.drawn() == first:
                raise
            self._remesh(grain, self.coupling)

    def _remesh(self, grain: MovingGrain, before: Coupling) -> None:
        """Remesh around the grain and transfer all fields; the old mesh is freed last."""
        from ..coupled.remeshing import carry_over
        from ..mesh.motion import MeshMotion

        run, transient = self._run, self.transient
        with run.accounts.ledger.stage("remeshing"):
            old, drawn, scene, height = run.fluid, grain.drawn(), run.scene, run.scene.domain.height
            surface, turbulence = run.surface, run.turbulence
            if surface is not None:
                height = surface.drawn_height(height, drawn)
            higher = {"domain": scene.domain.model_copy(update={"height": height})}
            laid_out = meshing.lay_out(Setup(scene.model_copy(update=higher)), run.plan, drawn)
            made = domain.build(run.comm, laid_out.mesh)
            eddies = None if turbulence is None else turbulence.on(made)
            model = old.model if eddies is None else eddies.within(old.model)
            fluid = Fluid(made, model, old.conditions, old.reynolds)
            fluid.watch = old.watch
            try:
                if eddies is not None:
                    eddies.joined(fluid)
                motion = MeshMotion(made)
                # A surface begins on the mesh as made, which the grain then moves.
                above = [] if surface is None else [surface.on(fluid, motion)]
                moving: list[Any] = [grain.on(fluid, motion), *above]
                coupling = self._coupled(fluid, moving, motion)
                now = Past(old.time, old.state.x.array, np.empty(0))
                (_, *past), done = carry_over(before, coupling, [now, *transient.past])
            except IncipientError:
                fluid.destroy()
                raise
            interface: Interface = coupling
            self.coupling = coupling
            if eddies is not None and turbulence is not None:
                interface = eddies.around(coupling)
                eddies.carry_over(turbulence)
            transient.continue_on(fluid, interface, past)
            grain.remeshings.append(done)
            run.take_mesh(fluid, [*moving, *([] if eddies is None else [eddies])])
        projected = f"the projection onto divergence-free velocities changed the velocity by {done.change:.1e}"
        run.voice.say(f"t = {done.time:.6g}: remeshed with {done.cells} cells; {projected}")


def _moving_parts(
    run: Run, motion: MeshMotion, checkpoint: Checkpoint | None
) -> list[MovingGrain | MovingSurface]:
    """Moving grain and free surface of a run, at the start or for the mesh of a checkpoint."""
    setup, parts = run.setup, list[Any]()
    args = setup, run.fluid, motion, run.accounts.ledger.stage
    if setup.scene.has_surface:
        from ..effects.moving_surface import MovingSurface

        parts = [MovingSurface(*args)]
    if setup.scene.moves:
        assert setup.scene.body is not None
        if setup.scene.body.touches:
            from ..effects.moving_grain.on_bed import GrainOnBed as Grain
        else:
            from ..effects.moving_grain.part import MovingGrain as Grain  # type: ignore[assignment]
        body = None if checkpoint is None else checkpoint.body
        state = None if body is None else BodyState.unpacked(body.made_for)
        parts.insert(0, Grain(*args, state))
    return parts

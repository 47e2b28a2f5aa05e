"""Time integration of a run: flow, coupled parts and remeshing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..effects import known
from ..effects.effect import RunPart
from ..errors import IncipientError, MeshError
from ..fluid import Fluid
from ..fluid.transient import Interface, Past, QuasiSteady, TimeStep, Transient, of_steps
from ..mesh import domain
from ..planning import meshing
from ..planning.discretisation import of_steady
from ..planning.effects import EffectName
from ..setup.setup import Setup
from .state import Run, part_of

if TYPE_CHECKING:
    from ..coupled.coupling import Coupling
    from ..effects.moving_grain.part import MovingGrain
    from ..restart import Checkpoint


class March:
    """Time integration of a run, from its start or a checkpoint. Every method is collective.

    coupling: of flow and moving boundaries, or None.
    """

    def __init__(self, run: Run, checkpoint: Checkpoint | None):
        assert run.scene.time is not None
        self._run, self._time = run, run.scene.time
        stage = run.accounts.ledger.stage
        optional = (effect.part_in_time(run.setup, stage, checkpoint) for effect in known.EFFECTS)
        moving = [part for part in optional if part is not None]
        for part in moving:
            part.joined(run.fluid)
        parts = [*moving, *run.parts]
        self.coupling = self._coupled(run.fluid, parts)
        kind = Transient if run.plan.has(EffectName.UNSTEADINESS) else QuasiSteady
        asked = run.scene.numerics.tolerance
        tolerance = of_steps(asked) if kind is Transient else of_steady(asked)
        order = 2 if self._time.scheme == "bdf2" else 1
        interface: Interface | None = self.coupling
        if run.turbulence is not None:
            interface = run.turbulence.around(interface)
        self.transient = kind(run.fluid, order, tolerance, self._time.tolerance, interface)
        run.march, run.parts = self, tuple(parts)
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

    def _coupled(self, fluid: Fluid, parts: Sequence[RunPart]) -> Coupling | None:
        if not self._run.plan.has(EffectName.MOVING_MESH):
            return None
        from ..coupled.coupling import Coupling
        from ..mesh.motion import MeshMotion

        motion, asked = MeshMotion(fluid.domain), self._run.scene.numerics.interface_tolerance
        moved = [one for part in parts for one in part.moving(motion)]
        tolerance = None if asked == "auto" else asked
        coupling = Coupling(fluid, moved, motion, tolerance, stage=self._run.accounts.ledger.stage)
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
            part.restore(checkpoint)
        put_back_flow(checkpoint, self.transient)

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

        run, transient = self._run, self.transient
        with run.accounts.ledger.stage("remeshing"):
            old, drawn, scene, height = run.fluid, grain.drawn(), run.scene, run.scene.domain.height
            if run.surface is not None:
                height = run.surface.drawn_height(height, drawn)
            higher = {"domain": scene.domain.model_copy(update={"height": height})}
            laid_out = meshing.lay_out(Setup(scene.model_copy(update=higher)), run.plan, drawn)
            made = domain.build(run.comm, laid_out.mesh)
            parts = [part.on(made) for part in run.parts]
            turbulence = part_of(parts, EffectName.TURBULENCE)
            model = old.model if turbulence is None else turbulence.within(old.model)
            fluid = Fluid(made, model, old.conditions, old.reynolds)
            fluid.watch = old.watch
            try:
                for part, one in zip(parts, run.parts, strict=True):
                    part.joined(fluid, one)
                coupling = self._coupled(fluid, parts)
                assert coupling is not None
                now = Past(old.time, old.state.x.array, np.empty(0))
                (_, *past), done = carry_over(before, coupling, [now, *transient.past])
            except IncipientError:
                fluid.destroy()
                raise
            self.coupling, interface = coupling, coupling
            if turbulence is not None:
                interface = turbulence.around(coupling)
                turbulence.carry_over(run.turbulence)
            transient.continue_on(fluid, interface, past)
            grain.remeshings.append(done)
            run.take_mesh(fluid, parts)
        projected = f"the projection onto divergence-free velocities changed the velocity by {done.change:.1e}"
        run.voice.say(f"t = {done.time:.6g}: remeshed with {done.cells} cells; {projected}")

"""The turbulence of a run: made for a scene, solved with its flow."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import dolfinx
import numpy as np
import ufl

from ... import compat
from ...arrays import Floats
from ...coupled.tractions import TractionProbe
from ...fluid import FlowModel, Fluid
from ...fluid.transient import Interface, TimeStep, Transient
from ...mesh.domain import Domain
from ...mesh.transfer import Transfer
from ...planning.base_flow import Velocity
from ...planning.conditions import conditions
from ...planning.effects import EffectName
from ...planning.flow_setup import Setup
from ...planning.tolerance import of_turbulent
from ...restart.redistribution import spread_values, stored_values
from ...results.wall_report import WallReport
from ..run_part import RunPart, Solving, Stage
from .continuation import Continued, continued
from .fields import TurbulenceFields, Values
from .in_time import InTime, Moving

if TYPE_CHECKING:
    from ...coupled.coupling import Coupling
    from ...restart.checkpoint import Checkpoint

ORDER = 2  # of the elements of both logarithms


class TurbulentFlow(RunPart):
    """The turbulence of a scene's flow; each model derives from it. Every method is collective.

    Args:
        stage: context managers by name that take the time.

    Attributes:
        fields: both quantities of the model.
        in_time: these in the steps of a flow in time, once there are any (`around`).
        continued: how the steady flow converged, once it did.
    """

    effect = EffectName.TURBULENCE
    fields: TurbulenceFields
    in_time: InTime | None = None
    continued: Continued | None = None

    def __init__(self, setup: Setup, domain: Domain, stage: Stage):
        self._setup = self._of_run = setup
        self._scene, self._stage = setup.scene, stage
        self.fields = self._made(domain)

    # -- what a model says of itself ----------------------------------------------------------------

    @abstractmethod
    def _made(self, domain: Domain) -> TurbulenceFields:
        """Both quantities on a mesh, as they are at the inflow."""

    @abstractmethod
    def _entering(self) -> tuple[Velocity, Values]:
        """The velocity that enters and the logarithms of both quantities there, functions of places."""

    @property
    @abstractmethod
    def _walls(self) -> Any:
        """The walls of the flow."""

    @abstractmethod
    def wall_report(self) -> WallReport:
        """u* and y+ along the walls, and what they say of the model."""

    # -- in the flow --------------------------------------------------------------------------------

    def within(self, model: FlowModel) -> FlowModel:
        """The model of the flow with the eddy viscosity."""
        fields = self.fields
        eddies = {"viscosity": fields.viscosity, "shear_velocity": fields.shear_velocity()}
        return replace(model, solver="direct", **eddies)

    def joined(self, fluid: Fluid, before: TurbulentFlow | None = None) -> None:
        """Let the velocity of the fluid that this turbulence is in carry it; both are freed together."""
        fluid.holding(self.fields)
        velocity, _ = ufl.split(fluid.state)
        self._viscosity, self._fluid = self.fields.constant(self._scene.viscosity), fluid
        carrier = fluid.carrier(velocity) if fluid.model.moving_mesh else None
        self.fields.carried_by(velocity, self._viscosity, carrier=carrier)
        self.fields.watch(fluid)

    def solve(self, run: Solving, factor: float = 1.0, onwards: bool = False) -> bool:
        """Find the steady flow with its turbulence from that of the inflow, `onwards` from that at hand first.

        The flow may be faster than the scene's by a factor, at the same viscosity; it is in units of itself.

        Raises:
            ConvergenceError: none converged.
        """
        fluid, loads = self._fluid, self._loads(run)
        scene = self._scene
        tolerances = of_turbulent(scene.numerics.tolerance, scene.resolves_walls, scene.gdim == 3)
        self._take(fluid, factor)
        for from_inflow in (False, True) if onwards else (True,):
            if from_inflow:
                self.enter(fluid)
            with run.stage("flow"), self._timed():
                found = self.continued = continued(
                    fluid,
                    self.fields,
                    tolerances,
                    loads,
                    lambda number, change: run.voice.iterate(1.0, number, change),
                )
            if found.converged:
                break
        run.count(turbulence=len(found.changes))
        if not found.converged:
            # A run in time that begins with this flow has no other place for that.
            run.voice.say(
                f"the steady flow has not converged: its loads change by {100.0 * found.spread:.2g}%"
            )
        return True

    def _loads(self, run: Solving) -> Callable[[], Floats]:
        """A function that returns force and torque over the grain's size, (6,), or else the force on the bed, (3,)."""
        grain, probe = self._of_run.geometry.grain, run.probe
        if probe is None or grain is None:
            on_bed = TractionProbe(self._fluid, self._walls.names[0], (0.0, 0.0, 0.0))
            return lambda: on_bed.resultant().force
        if run.fluid is not self._fluid:  # the steady flow that one in time begins with
            probe = TractionProbe(self._fluid, probe.boundary, probe.about)

        def found() -> Floats:
            resultant = probe.resultant()
            return np.concatenate([resultant.force, resultant.torque / grain.size])

        return found

    def mean_load(self) -> tuple[Floats, Floats] | None:
        """Force and torque (3,) on the grain in the mean over the last iterations of a flow that has not converged."""
        grain, found = self._of_run.geometry.grain, self.continued
        if found is None or found.converged or found.loads is None or grain is None:
            return None
        return found.loads[:3], grain.size * found.loads[3:]

    def enter(self, fluid: Fluid) -> None:
        """Let the velocity and its turbulence be those of the inflow everywhere."""
        enters, logarithms = self._entering()
        start = dolfinx.fem.Function(fluid.space.velocity)
        start.interpolate(lambda x: enters(x, 0.0))
        fluid.state.x.array[fluid.space.velocity_map] = start.x.array
        self.fields.state.interpolate(logarithms)

    def _take(self, fluid: Fluid, factor: float) -> None:
        """Let viscosity, inflow and walls be those of a flow faster by a factor."""
        setup = self._of_run if factor == 1.0 else self._of_run.faster(factor)
        scene = setup.scene
        if scene == self._scene:
            return
        self._setup, self._scene = setup, scene
        fluid.reynolds, self._viscosity.value = 1.0 / scene.viscosity, scene.viscosity
        self._give(fluid)
        fluid.let_in(conditions(setup))

    def _give(self, fluid: Fluid) -> None:
        """Let inflow and walls of both quantities be those of the setup as it is now."""
        self.fields.give(self._entering()[1])

    def around(self, interface: Interface | None) -> InTime:
        """The flow in time with its turbulence, and what moves in it."""
        moving = cast("Moving | None", interface)
        self.in_time = InTime(self._fluid, self.fields, self._timed, moving)
        return self.in_time

    def on(self, domain: Domain) -> TurbulentFlow:
        """The turbulence of the scene on another mesh, as it is at the inflow; `carry_over` brings its state."""
        return type(self)(self._of_run, domain, self._stage)

    def carry_over(self, before: TurbulentFlow) -> None:
        """Carry both logarithms over from another mesh, now and before; both meshes are where they are.

        At each point the new mesh takes what the old one has there or next to it, in cells at walls what is given: both
        quantities stay positive.
        """
        old, new = before.in_time, self.in_time
        assert old is not None and new is not None
        new.turbulence.follow()
        places = new.turbulence.space.tabulate_dof_coordinates()
        transfer = Transfer(old.turbulence.domain.mesh, places, reach=0.0)
        values = dolfinx.fem.Function(old.turbulence.space)
        new.past = []
        for state in old.past:
            values.x.array[:] = state
            found = np.maximum(transfer.values(values), np.array([self._least_carried, -np.inf]))
            new.past.append(new.turbulence.at_walls(found.ravel()))
        new.turbulence.state.x.array[:] = new.past[0]

    @property
    def _least_carried(self) -> float:
        """The least logarithm of k on a mesh to which it is carried over."""
        return -np.inf

    def states(self) -> tuple[Any, ...]:
        """The logarithms of both quantities."""
        return (self.fields.state,)

    # -- checkpoints ------------------------------------------------------------------------------

    def stored(self, coupling: Coupling | None, transient: Transient) -> dict[str, Any]:
        """The logarithms of both quantities, now and before."""
        assert self.in_time is not None
        return {"turbulence": stored_values(self.fields.space, self.in_time.past)}

    def restore(self, kept: Checkpoint, coupling: Coupling | None) -> None:
        """Take the logarithms of both quantities from a checkpoint."""
        assert kept.turbulence is not None and self.in_time is not None
        self.fields.follow()
        self.in_time.past = spread_values(self.fields.space, kept.turbulence)
        self.fields.state.x.array[:] = self.in_time.past[0]

    # -- output -----------------------------------------------------------------------------------

    def columns(self, step: TimeStep, coupling: Coupling | None) -> dict[str, Any]:
        """u* and y+ along the walls after a step."""
        return self.wall_report().columns()

    def reported(self) -> dict[str, Any]:
        """u* and y+ along the walls at the end."""
        return {"turbulence": self.wall_report()}

    def unknowns(self) -> dict[str, int]:
        """Unknowns of both quantities."""
        space = self.fields.space
        number = int(space.dofmap.index_map.size_global * space.dofmap.index_map_bs)
        return {EffectName.TURBULENCE: number}

    def functions(self) -> dict[str, Any]:
        """Both quantities and the eddy viscosity on the nodes, by the names that files have."""
        logarithms = ufl.split(self.fields.state)
        expressions = {
            "k": self.fields.energy(logarithms[0]),
            self.fields.second: ufl.exp(logarithms[1]),
            "eddy_viscosity": self.fields.viscosity(self._viscosity) - self._viscosity,
        }
        scalar = compat.space(self.fields.domain.mesh, ("Lagrange", ORDER))
        found = {}
        for name, expression in expressions.items():
            found[name] = dolfinx.fem.Function(scalar, name=name)
            compat.interpolate(found[name], expression)
        return found

    def _timed(self) -> AbstractContextManager[Any]:
        """Takes the time of both quantities."""
        return self._stage("turbulence")

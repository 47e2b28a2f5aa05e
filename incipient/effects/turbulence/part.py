"""The turbulence of a run: made for a scene, solved with its flow, judged by the distance of its walls."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import dolfinx
import numpy as np
import ufl

from ... import compat
from ...fluid import FlowModel, Fluid
from ...fluid.transient import Interface, TimeStep, Transient
from ...forms import turbulence as forms
from ...mesh.domain import Domain
from ...mesh.transfer import Transfer
from ...planning import wall_conditions
from ...planning.effects import EffectName
from ...planning.flow_setup import Setup
from ...planning.linear import FEW_CELLS
from ...planning.tolerance import of_steady
from ...results.wall_report import WallReport
from ..run_part import RunPart, Solving, Stage
from .along_walls import AlongWall, along_wall
from .fields import KEpsilon, TurbulenceConditions
from .iteration import InTime, Moving, solve_steadily

if TYPE_CHECKING:
    from ...coupled.coupling import Coupling
    from ...restart.checkpoint import Checkpoint

ORDER = 2  # of the elements of ln k and ln epsilon


class TurbulentFlow(RunPart):
    """The turbulence of a scene's flow. Every method is collective.

    Args:
        stage: context managers by name that take the time.

    Attributes:
        fields: k and epsilon.
        in_time: k and epsilon in the steps of a flow in time, once there are any (`around`).
    """

    effect = EffectName.TURBULENCE
    in_time: InTime | None = None

    def __init__(self, setup: Setup, domain: Domain, stage: Stage):
        self._setup = self._of_run = setup
        self._scene, self._walls = setup.scene, setup.walls
        self._stage = stage
        enters = wall_conditions.logarithms(self._setup)
        given = TurbulenceConditions(
            (self._setup.sides.left,), enters, self._walls.names, self._walls.distance
        )
        self.fields = KEpsilon(domain, given, ORDER, self._setup.turbulence.constants)

    def within(self, model: FlowModel) -> FlowModel:
        """The model of the flow with the eddy viscosity; on few cells with the direct solver in place of blocks."""
        fields, cells = self.fields, self.fields.domain.mesh.topology.index_map(self._scene.gdim).size_global
        solver = "direct" if model.solver == "block" and cells <= FEW_CELLS else model.solver
        eddies = {"viscosity": fields.viscosity, "shear_velocity": fields.shear_velocity()}
        return replace(model, solver=solver, **eddies)

    def joined(self, fluid: Fluid, before: TurbulentFlow | None = None) -> None:
        """Let the velocity of the fluid that this turbulence is in carry it; both are freed together."""
        fluid.holding(self.fields)
        velocity, _ = ufl.split(fluid.state)
        self._viscosity, self._fluid = self.fields.constant(self._scene.viscosity), fluid
        carrier = fluid.carrier(velocity) if fluid.model.moving_mesh else None
        self.fields.carried_by(velocity, self._viscosity, carrier=carrier)

    def solve(self, run: Solving, factor: float = 1.0, onwards: bool = False) -> bool:
        """Find the steady flow with its turbulence, from that of the inflow everywhere, or `onwards` from that at hand.

        The flow may be faster than the scene's by a factor, at the same viscosity; it is in units of itself.

        Raises:
            ConvergenceError: there is none that could be found.
        """
        fluid = self._fluid
        self._take(fluid, factor)
        walls, scene = self._walls, self._scene
        if not onwards:
            self.enter(fluid)
        with run.stage("flow"):
            rounds = solve_steadily(
                *(fluid, self.fields, walls.depth / scene.reference_velocity),
                of_steady(scene.numerics.tolerance, False),
                lambda found: run.voice.iterate(1.0, found.number, found.of_turbulence),
                self._timed,
            )
        run.count(turbulence=len(rounds))
        return True

    def start(self, steady: TurbulentFlow) -> None:
        """Take k and epsilon of a steady flow on the mesh."""
        self.fields.state.x.array[:] = steady.fields.state.x.array

    def enter(self, fluid: Fluid) -> None:
        """Let the velocity and its turbulence be those of the inflow everywhere."""
        enters = wall_conditions.velocity(self._setup)
        start = dolfinx.fem.Function(fluid.space.velocity)
        start.interpolate(lambda x: enters(x, 0.0))
        fluid.state.x.array[fluid.space.velocity_map] = start.x.array
        self.fields.state.interpolate(wall_conditions.logarithms(self._setup))

    def _take(self, fluid: Fluid, factor: float) -> None:
        """Let viscosity, inflow and walls be those of a flow faster by a factor."""
        setup = self._of_run if factor == 1.0 else self._of_run.faster(factor)
        scene = setup.scene
        if scene == self._scene:
            return
        self._setup, self._scene, self._walls = setup, scene, setup.walls
        fluid.reynolds, self._viscosity.value = 1.0 / scene.viscosity, scene.viscosity
        self.fields.give(wall_conditions.logarithms(setup), self._walls.distance)
        fluid.let_in(wall_conditions.conditions(setup))
        fluid.walls.stand(self._walls.distance)

    def around(self, interface: Interface | None) -> InTime:
        """The flow in time with k and epsilon, and what moves in it."""
        self.in_time = InTime(self._fluid, self.fields, self._timed, cast("Moving | None", interface))
        return self.in_time

    def on(self, domain: Domain) -> TurbulentFlow:
        """The turbulence of the scene on another mesh, as it is at the inflow; `carry_over` brings its state."""
        return TurbulentFlow(self._of_run, domain, self._stage)

    def carry_over(self, before: TurbulentFlow) -> None:
        """Carry ln k and ln epsilon over from another mesh, now and before; both meshes are where they are.

        At each point the new mesh takes what the old one has there: k and epsilon stay positive.
        """
        old, new = before.in_time, self.in_time
        assert old is not None and new is not None
        transfer = Transfer(old.turbulence.domain.mesh, new.turbulence.space.tabulate_dof_coordinates())
        values = dolfinx.fem.Function(old.turbulence.space)
        new.past = []
        for state in old.past:
            values.x.array[:] = state
            new.past.append(transfer.values(values).ravel())
        new.turbulence.state.x.array[:] = new.past[0]

    def states(self) -> tuple[Any, ...]:
        """ln k and ln epsilon."""
        return (self.fields.state,)

    # -- checkpoints ------------------------------------------------------------------------------

    def stored(self, coupling: Coupling | None, transient: Transient) -> dict[str, Any]:
        """ln k and ln epsilon, now and before."""
        from ...restart.redistribution import stored_values

        assert self.in_time is not None
        return {"turbulence": stored_values(self.fields.space, self.in_time.past)}

    def restore(self, kept: Checkpoint, coupling: Coupling | None) -> None:
        """Take ln k and ln epsilon from a checkpoint."""
        from ...restart.redistribution import spread_values

        assert kept.turbulence is not None and self.in_time is not None
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
        """Unknowns of ln k and ln epsilon."""
        space = self.fields.space
        number = int(space.dofmap.index_map.size_global * space.dofmap.index_map_bs)
        return {EffectName.TURBULENCE: number}

    def functions(self) -> dict[str, Any]:
        """k, epsilon and the eddy viscosity on the nodes, by the names that files have."""
        closure, logarithms = self.fields.closure, ufl.split(self.fields.state)
        eddies = forms.eddy_viscosity(logarithms, closure)
        expressions = {
            "k": ufl.exp(logarithms[0]),
            "epsilon": ufl.exp(logarithms[1]),
            "eddy_viscosity": eddies,
        }
        scalar = compat.space(self.fields.domain.mesh, ("Lagrange", ORDER))
        found = {}
        for name, expression in expressions.items():
            found[name] = dolfinx.fem.Function(scalar, name=name)
            compat.interpolate(found[name], expression)
        return found

    def wall_report(self) -> WallReport:
        """u* and y+ along the walls, and what they say of the law."""
        scene, walls, names = self._scene, self._walls, self._walls.names
        along = {name: along_wall(self._fluid, name, self.fields.shear_velocity()) for name in names}
        governing, found, shares, x = (
            np.concatenate(parts)
            for parts in zip(*(self._shear_velocities(one) for one in along.values()), strict=True)
        )
        y_plus = governing * walls.distance / scene.viscosity
        at_end = np.isclose(x, x.max())
        last = np.average(found[at_end], weights=shares[at_end])
        outside = ~walls.law.holds(governing, scene.viscosity, walls.distance, walls.reach)
        return WallReport(
            distance=walls.distance,
            least=float(y_plus.min()),
            largest=float(y_plus.max()),
            shear_velocity=float(found @ shares / shares.sum()),
            at_outflow=float(last),
            friction=float(2.0 * (last / scene.reference_velocity) ** 2),
            viscosity=scene.viscosity,
            c_mu=self._setup.turbulence.c_mu,
            outside=float(shares[outside].sum() / shares.sum()),
            plane=walls.plane,
            roughness=walls.law.roughness,
            reach=walls.reach,
            backward=along[names[0]].backward() if scene.gdim == 2 else (),
            along={name: self._told(one) for name, one in along.items()} if scene.gdim == 2 else {},
        )

    def _timed(self) -> AbstractContextManager[Any]:
        """Takes the time of k and epsilon."""
        return self._stage("turbulence")

    def _told(self, along: AlongWall) -> dict[str, list[float]]:
        """What is drawn of a wall, in six digits."""
        scene = self._scene
        governing, found, _, x = self._shear_velocities(along)
        friction = 2.0 * np.sign(along.velocities[:, 0]) * (found / scene.reference_velocity) ** 2
        columns = {"x": x, "y_plus": governing * self._walls.distance / scene.viscosity, "friction": friction}
        return {name: [float(f"{one:.6g}") for one in values] for name, values in columns.items()}

    def _shear_velocities(self, along: AlongWall) -> tuple[np.ndarray, ...]:
        """At nodes (n,) of a wall: the governing u*, that of the wall's stress, lengths or areas, and x."""
        law, away = self._walls.law, (self._scene.viscosity, self._walls.distance)
        flow = np.maximum(along.speeds, 1e-300), along.shear_velocities
        stress = law.drag(*flow, *away) * along.speeds
        return law.governing(*flow, *away), np.sqrt(stress), along.lengths, along.places[:, 0]

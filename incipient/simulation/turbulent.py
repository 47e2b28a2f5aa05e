"""The turbulence of a run: made for a scene, solved with its flow, judged by the distance of its walls."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import dolfinx
import numpy as np
import ufl

from .. import compat
from ..errors import ConvergenceError
from ..fluid import FlowModel, Fluid
from ..forms import turbulence as forms
from ..mesh.domain import Domain
from ..mesh.transfer import Transfer
from ..planning import turbulence as planned
from ..planning import turbulent_conditions
from ..planning.cells import side_names
from ..planning.linear import FEW_CELLS
from ..results.turbulence import WallReport
from ..scene import Scene
from ..scene.tolerance import of_steady
from ..turbulence import InTime, Surroundings, Turbulence, solve_steadily
from ..turbulence.along_walls import AlongWall, along_wall

if TYPE_CHECKING:
    from ..turbulence.coupled import Moving
    from .state import Run

Stage = Callable[[str], AbstractContextManager[Any]]

ORDER = 2  # of the elements of ln k and ln epsilon
NOT_STEADY = 'time.start: no steady flow to begin with was found; use "rest", or a smaller numerics.mesh_size'


class TurbulentFlow:
    """The turbulence of a scene's flow. Every method is collective.

    Attributes:
        fields: k and epsilon.
    """

    def __init__(self, scene: Scene, domain: Domain):
        self._scene, self._walls, self._of_run = scene, planned.walls_of(scene), scene
        inflow, walls = (side_names(scene)[3],), planned.wall_names(scene)
        surroundings = Surroundings(
            inflow, turbulent_conditions.logarithms(scene), walls, self._walls.distance
        )
        self.fields = Turbulence(domain, surroundings, ORDER, planned.section(scene).constants)

    def within(self, model: FlowModel) -> FlowModel:
        """A model of the flow with the eddies in it; on few cells it is solved by factors in place of blocks."""
        fields, cells = self.fields, self.fields.domain.mesh.topology.index_map(self._scene.gdim).size_global
        solver = "direct" if model.solver == "block" and cells <= FEW_CELLS else model.solver
        eddies = {"viscosity": fields.viscosity, "shear_velocity": fields.shear_velocity()}
        return replace(model, solver=solver, **eddies)

    def joined(self, fluid: Fluid) -> None:
        """Let the velocity of the fluid that this turbulence is in carry it; both are freed together."""
        fluid.holding(self.fields)
        velocity, _ = ufl.split(fluid.state)
        self._viscosity = self.fields.constant(self._scene.viscosity)
        carrier = fluid.carrier(velocity) if fluid.model.moving_mesh else None
        self.fields.carried_by(velocity, self._viscosity, carrier=carrier)

    def solve(self, run: Run, factor: float = 1.0, onwards: bool = False, fluid: Fluid | None = None) -> None:
        """Find the steady flow with its turbulence, from that of the inflow everywhere, or `onwards` from that at hand.

        The flow may be faster than the scene's by a factor, at the same viscosity; it is in units of itself. Without a
        fluid given it is the run's.

        Raises:
            ConvergenceError: there is none that could be found.
        """
        fluid = fluid or run.fluid
        self._take(fluid, factor)
        walls, scene = self._walls, self._scene
        if not onwards:
            self.enter(fluid)
        with run.stage("flow"):
            rounds = solve_steadily(
                *(fluid, self.fields, walls.depth / scene.reference_velocity),
                of_steady(scene.numerics.tolerance, False),
                lambda found: run.voice.iterate(1.0, found.number, found.of_turbulence),
                _stage(run),
            )
        run.accounts.count(turbulence=len(rounds))

    def enter(self, fluid: Fluid) -> None:
        """Let the velocity and its turbulence be those of the inflow everywhere."""
        enters = turbulent_conditions.velocity(self._scene)
        start = dolfinx.fem.Function(fluid.space.velocity)
        start.interpolate(lambda x: enters(x, 0.0))
        fluid.state.x.array[fluid.space.velocity_map] = start.x.array
        self.fields.state.interpolate(turbulent_conditions.logarithms(self._scene))

    def _take(self, fluid: Fluid, factor: float) -> None:
        """Let viscosity, inflow and walls be those of a flow faster by a factor."""
        scene = self._of_run if factor == 1.0 else planned.faster(self._of_run, factor)
        if scene == self._scene:
            return
        self._scene, self._walls = scene, planned.walls_of(scene)
        fluid.reynolds, self._viscosity.value = 1.0 / scene.viscosity, scene.viscosity
        self.fields.give(turbulent_conditions.logarithms(scene), self._walls.distance)
        fluid.let_in(turbulent_conditions.conditions(scene))
        fluid.walls.stand(self._walls.distance)

    def in_time(self, fluid: Fluid, stage: Stage, moving: Moving | None = None) -> InTime:
        """What a flow in time is solved together with, beside what moves in it."""
        return InTime(fluid, self.fields, lambda: stage("turbulence"), moving)

    def on(self, domain: Domain) -> TurbulentFlow:
        """The turbulence of the same scene on another mesh, as it is at the inflow; `carry_over` brings its state."""
        return TurbulentFlow(self._of_run, domain)

    def begin(self, run: Run, fluid: Fluid) -> None:
        """Find the steady flow of a fluid with this turbulence, and give its k and epsilon to the run's.

        A grain that moves later is at rest: with a velocity at its surface fluid would enter through it, of which no k
        is known.

        Raises:
            ConvergenceError: none was found.
        """
        self.joined(fluid)
        try:
            self.solve(run, fluid=fluid)
        except ConvergenceError as error:
            raise ConvergenceError(NOT_STEADY) from error
        assert run.turbulence is not None
        run.turbulence.fields.state.x.array[:] = self.fields.state.x.array

    def carry_over(self, old: InTime, new: InTime) -> None:
        """Carry ln k and ln epsilon over from those of another mesh, now and before; both meshes are where they are.

        At each point the new mesh takes what the old one has there: k and epsilon stay positive.
        """
        transfer = Transfer(old.turbulence.domain.mesh, new.turbulence.space.tabulate_dof_coordinates())
        values = dolfinx.fem.Function(old.turbulence.space)
        new.past = []
        for state in old.past:
            values.x.array[:] = state
            new.past.append(transfer.values(values).ravel())
        new.turbulence.state.x.array[:] = new.past[0]

    def unknowns(self) -> int:
        """How many there are."""
        space = self.fields.space
        return int(space.dofmap.index_map.size_global * space.dofmap.index_map_bs)

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

    def report(self, fluid: Fluid) -> WallReport:
        """u* and y+ along the walls, and what they say of the law."""
        scene, walls, names = self._scene, self._walls, planned.wall_names(self._scene)
        along = {name: along_wall(fluid, name, self.fields.shear_velocity()) for name in names}
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
            c_mu=planned.section(scene).c_mu,
            outside=float(shares[outside].sum() / shares.sum()),
            plane=planned.is_plane(scene),
            roughness=walls.law.roughness,
            reach=walls.reach,
            backward=along[names[0]].backward() if scene.gdim == 2 else (),
            along={name: self._told(one) for name, one in along.items()} if scene.gdim == 2 else {},
        )

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


def _stage(run: Run) -> Callable[[], AbstractContextManager[None]]:
    """Takes the time of k and epsilon."""
    return lambda: run.accounts.ledger.stage("turbulence")

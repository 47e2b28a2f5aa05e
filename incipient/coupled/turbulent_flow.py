"""Turbulence of a run, solved with its steady flow by continuation, or in time steps in turn with it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import dolfinx
import numpy as np
import ufl

from .. import compat
from ..arrays import Floats
from ..errors import ConvergenceError
from ..fluid import FlowModel, Fluid
from ..fluid.along_walls import along_wall, at_end
from ..fluid.conditions import Condition, Friction
from ..fluid.newton import NewtonReport
from ..fluid.transient import Interface, TimeStep, Transient
from ..forms.turbulence import KEpsilon
from ..mesh.domain import Domain
from ..mesh.sampling import transferred
from ..mesh.wall_distance import distances
from ..planning.conditions import conditions
from ..planning.discretisation import of_turbulent, velocity_order
from ..planning.sizes import rise
from ..restart import spread_field, stored_field
from ..results.wall_report import LARGEST_CHANGE, WallReport
from ..scene.sections import OF_K_EPSILON
from ..setup.setup import Setup
from ..turbulence.continuation import Continued, continued
from ..turbulence.fields import ORDER, TurbulenceFields
from .tractions import TractionProbe

if TYPE_CHECKING:
    from ..restart import Checkpoint
    from ..simulation.state import Run

MOST_TURNS = 15  # within a time step
NO_STEP = "the flow with the eddy viscosity as it is does not converge: use a smaller time.step or numerics.mesh_size"


class TurbulentFlow:
    """The turbulence of a scene's flow. Every method is collective.

    Attributes:
        fields: both quantities of the model.
        in_time: these in time steps, once `around`.
        continued: outcome of the steady continuation.
    """

    effect = "turbulence"
    in_time: InTime
    continued: Continued | None = None

    def __init__(self, setup: Setup, domain: Domain):
        self._setup = self._of_run = setup
        section, walls = setup.walls.asked, setup.walls
        self.fields = TurbulenceFields(
            domain,
            walls.inflow.logarithms,
            (setup.sides.left,),
            self._distances(),
            setup.scene.viscosity,
            KEpsilon(*(getattr(section, key) for key in OF_K_EPSILON))
            if section.model == "k-epsilon"
            else None,
            velocity_order(setup)[0],
            walls.least_k,
            in_layers=walls.is_resolved and not walls.plane,
            surfaces=walls.surfaces,
            # Elsewhere ln k is as smooth as cells follow, and fewer iterations are needed without.
            weighted=setup.scene.gdim == 3 and setup.scene.grain is not None,
        )

    def _distances(self) -> dict[str, float]:
        walls = self._setup.walls
        return {name: walls.from_origin(name) for name in walls.names}

    # -- in the flow --------------------------------------------------------------------------------

    def fluid(self, model: FlowModel, conditions: Sequence[Condition], reynolds: float) -> Fluid:
        """The fluid on the mesh with this turbulence, which it frees."""
        fields = self.fields
        eddies = {"viscosity": fields.viscosity, "shear_velocity": fields.shear_velocity()}
        model = replace(model, solver="direct", **eddies)
        self._fluid = fluid = Fluid(fields.domain, model, conditions, reynolds)
        fluid.holding(fields)
        velocity, _ = ufl.split(fluid.state)
        self._viscosity = fields.constant(self._setup.scene.viscosity)
        carrier = fluid.carrier(velocity) if model.moving_mesh else None
        fields.carried_by(velocity, self._viscosity, carrier=carrier)
        fields.watch(fluid)
        return fluid

    def solve(self, run: Run, factor: float = 1.0, onwards: bool = False) -> None:
        """Compute the steady flow with its turbulence from the inflow's, or `onwards` first from the present.

        `factor`: of the scene's speed, at the same viscosity; the flow is in its own units. Raises ConvergenceError.
        """
        fluid, loads = self._fluid, self._loads(run)
        scene = self._setup.scene
        tolerances = of_turbulent(scene.numerics.tolerance, scene.gdim)
        self._take(fluid, factor)
        for from_inflow in (False, True) if onwards else (True,):
            if from_inflow:
                self.enter(fluid)
            try:
                with run.stage("flow"), run.accounts.ledger.stage("turbulence"):
                    outcome = self.continued = continued(
                        fluid,
                        self.fields,
                        tolerances,
                        loads,
                        lambda number, change: run.voice.iterate(1.0, number, change),
                    )
            except ConvergenceError:
                if from_inflow:
                    raise
                continue
            if outcome.converged:
                break
        run.accounts.iterations.update(turbulence=len(outcome.changes))
        if not outcome.converged:
            # A run in time that begins with this flow has no other place for that.
            run.voice.say(
                f"the steady flow has not converged: its loads change by {100.0 * outcome.spread:.2g}%"
            )

    def _loads(self, run: Run) -> Callable[[], Floats]:
        """Function for force and torque over the grain's size, (6,), or the force on the bed, (3,)."""
        grain, probe = self._of_run.scene.grain, run.probe
        if probe is None or grain is None:
            on_bed = TractionProbe(self._fluid, self._setup.walls.names[0], (0.0, 0.0, 0.0))
            return lambda: on_bed.resultant().force
        if run.fluid is not self._fluid:  # the steady flow that one in time begins with
            probe = TractionProbe(self._fluid, probe.boundary, probe.about)
        units = np.repeat([1.0, grain.size], 3)
        return lambda: probe.resultant().load / units

    def mean_load(self) -> Floats | None:
        """Force and torque (6,) on the grain, averaged over the last iterations of a flow that is not converged."""
        grain, outcome = self._of_run.scene.grain, self.continued
        if outcome is None or outcome.loads is None:
            return None
        return outcome.loads * np.repeat([1.0, grain.size], 3)

    def enter(self, fluid: Fluid) -> None:
        """Set velocity and turbulence everywhere to the inflow's at the wall distance."""
        inflow, space = self._setup.walls.inflow, fluid.space.velocity
        speeds = inflow.velocity_at(self._from_walls(space))
        fluid.state.x.array[fluid.space.velocity_map] = speeds.T.ravel()
        logarithms = inflow.logarithms_at(self._from_walls(self.fields.space))
        self.fields.state.x.array[:] = logarithms.T.ravel()

    def begin_near(self, other: TurbulentFlow) -> None:
        """Take velocity and turbulence from a flow on another mesh, outside of it the nearest values."""
        fluid, before = self._fluid, other._fluid
        velocities = [before.state.x.array[before.space.velocity_map]]
        velocities = transferred(velocities, before.space.velocity, fluid.space.velocity)
        fluid.state.x.array[fluid.space.velocity_map] = velocities[0]
        logarithms = transferred(
            [other.fields.state.x.array], other.fields.space, self.fields.space
        )
        self.fields.state.x.array[:] = logarithms[0]

    def _from_walls(self, space: Any) -> Floats:
        """Distances (n,) of the nodes of a space from the nearest wall boundary."""
        domain = self.fields.domain
        places = space.tabulate_dof_coordinates()[:, : domain.gdim]
        return distances(domain, self._setup.walls.names, places)

    def _take(self, fluid: Fluid, factor: float) -> None:
        setup = self._of_run if factor == 1.0 else self._of_run.faster(factor)
        scene = setup.scene
        if self._of_run.walls.plane and scene.turbulence is not None:  # the mesh ends where it did
            kept = {"wall_distance": self._of_run.walls.smooth}
            changed = {"turbulence": scene.turbulence.model_copy(update=kept)}
            setup = Setup(scene.model_copy(update=changed))
            scene = setup.scene
        if scene == self._setup.scene:
            return
        self._setup = setup
        fluid.reynolds, self._viscosity.value = 1.0 / scene.viscosity, scene.viscosity
        walls = setup.walls
        self.fields.give(walls.inflow.logarithms, scene.viscosity, self._distances(), walls.least_k)
        new = conditions(setup)
        fluid.walls.stand(
            {wall.boundary: wall.distance for wall in new if isinstance(wall, Friction)}
        )
        fluid.let_in(new)

    def around(self, interface: Interface | None) -> InTime:
        self.in_time = InTime(self._fluid, self.fields, interface)
        return self.in_time

    def on(self, domain: Domain) -> TurbulentFlow:
        """The turbulence on another mesh, as at the inflow; `carry_over` transfers its state."""
        return type(self)(self._of_run, domain)

    def carry_over(self, before: TurbulentFlow) -> None:
        """Transfer present and past logarithms from another mesh at its present position, by local or nearest values.

        Both quantities stay positive.
        """
        fields, least = self.fields, [np.log(self._setup.walls.least_k), -np.inf]
        fields.follow()
        logarithms = transferred(before.in_time.past, before.fields.space, fields.space)
        floor = np.tile(least, len(logarithms[0]) // 2)
        self.in_time.past = [np.maximum(values, floor) for values in logarithms]
        fields.state.x.array[:] = self.in_time.past[0]

    # -- checkpoints ------------------------------------------------------------------------------

    def stored(self, transient: Transient) -> dict[str, Any]:
        return {"turbulence": stored_field(self.fields.space, self.in_time.past)}

    def resume(self, kept: Checkpoint) -> None:
        self.fields.follow()
        self.in_time.past = spread_field(self.fields.space, kept.turbulence)
        self.fields.state.x.array[:] = self.in_time.past[0]

    # -- output -----------------------------------------------------------------------------------

    def columns(self, step: TimeStep) -> dict[str, Any]:
        return self.wall_report().columns()

    def reported(self) -> dict[str, Any]:
        return {"turbulence": self.wall_report()}

    def wall_report(self) -> WallReport:
        scene, walls = self._setup.scene, self._setup.walls
        in_plane = scene.gdim == 2
        columns, coarse = list[np.ndarray](), list[float]()
        for name in walls.names:
            along = along_wall(self._fluid, name, self.fields.shear_velocity())
            drag = walls.law(name).drag(
                along.speeds, along.shear_velocities, scene.viscosity, walls.slip(name)
            )
            u = np.sqrt(drag * along.speeds)
            if walls.is_resolved and (name == "body" or not walls.roughness):
                coarse.append(along.coarse_fraction(u**2, LARGEST_CHANGE))
            if name == walls.names[0]:
                backward = along.backward() if in_plane else ()
            friction = 2.0 * np.sign(along.velocities[:, 0]) * (u / scene.reference_velocity) ** 2
            y_plus = u * walls.distance(name) / scene.viscosity
            columns.append(np.array([along.places[:, 0], y_plus, friction, u, along.lengths]))
        x, y_plus, _, u, lengths = np.concatenate(columns, axis=1)
        end = at_end(x)
        last = float(np.average(u[end], weights=lengths[end]))
        drawn = {
            name: {
                quantity: [float(f"{value:.6g}") for value in values]
                for quantity, values in zip(("x", "y_plus", "friction"), column, strict=False)
            }
            for name, column in zip(walls.names, columns, strict=True)
        }
        outcome = self.continued or Continued(converged=True, changes=())
        return WallReport(
            model=self._setup.walls.asked.model,
            distance=walls.nearest,
            least=float(y_plus.min()),
            largest=float(y_plus.max()),
            shear_velocity=float(np.average(u, weights=lengths)),
            at_outflow=last,
            friction=2.0 * (last / scene.reference_velocity) ** 2,
            viscosity=scene.viscosity,
            plane=walls.plane,
            roughness=walls.roughness,
            backward=backward,
            along=drawn if in_plane else {},
            converged=outcome.converged,
            spread=outcome.spread,
            changes=outcome.changes,
            mesh_size=scene.numerics.mesh_size,
            coarse_along=None if walls.plane else max(coarse, default=None),
            judged_along=in_plane and scene.grain is None and math.isfinite(rise(scene)),
        )

    @property
    def unknowns(self) -> int:
        space = self.fields.space
        return int(space.dofmap.index_map.size_global * space.dofmap.index_map_bs)

    def functions(self) -> dict[str, Any]:
        logarithms = ufl.split(self.fields.state)
        expressions = {
            "k": ufl.exp(logarithms[0]),
            self.fields.closure.second: ufl.exp(logarithms[1]),
            "eddy_viscosity": self.fields.viscosity(self._viscosity) - self._viscosity,
        }
        scalar = compat.space(self.fields.domain.mesh, ("Lagrange", ORDER))
        functions = {}
        for name, expression in expressions.items():
            functions[name] = dolfinx.fem.Function(scalar, name=name)
            compat.interpolate(functions[name], expression)
        return functions


class InTime(Interface):
    """Turbulence as the interface of an unsteady flow, see `fluid.transient.Interface`.

    Flow and turbulence take the same backward difference. `past`: states (local unknowns,), newest first.
    """

    def __init__(
        self,
        fluid: Fluid,
        turbulence: TurbulenceFields,
        moving: Interface | None = None,
    ):
        super().__init__(fluid)
        self.turbulence, self.parts = turbulence, () if moving is None else (moving,)
        self._moving = moving or Interface(fluid)
        self.past = [turbulence.state.x.array.copy()]

    def attempt(
        self, length: float, order: int, tolerance: float, before: NewtonReport | None = None
    ) -> NewtonReport:
        fluid, turbulence = self.fluid, self.turbulence
        rate = [float(a.value) for a in fluid.rate]
        sizes: list[float] = []
        report: NewtonReport | None = None
        failure = NO_STEP
        for _ in range(MOST_TURNS):
            state = fluid.state.x.array.copy()
            turbulence.look()
            report = self._moving.attempt(length, order, 0.1 * tolerance, report)
            self._follow()
            if not report.converged:
                return replace(report, failure=report.failure or NO_STEP)
            sizes.append(fluid.relative(fluid.state.x.array - state))
            if len(sizes) > 1 and sizes[-1] <= tolerance:
                return replace(report, corrections=tuple(sizes), error=sizes[-1])
            past = (self.past[0], self.past[-1])
            with fluid.stage("turbulence"):
                change = turbulence.step(rate, past, tolerance)
            if not np.isfinite(change):
                failure = f"{turbulence.names} do not converge: use a smaller time.step"
                break
        self.forget()
        return NewtonReport(False, tuple(sizes), np.inf, failure=failure)

    def _follow(self) -> None:
        if self.parts:
            self.turbulence.follow()

    def accept(self, step: TimeStep) -> None:
        self.past = [self.turbulence.state.x.array.copy(), self.past[0]]
        super().accept(step)

    def restore(self) -> None:
        self.turbulence.state.x.array[:] = self.past[0]
        super().restore()
        self._follow()

    def forget(self) -> None:
        self.turbulence.renew_factors()
        super().forget()

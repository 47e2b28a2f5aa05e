"""The run of a moving grain: fluid and body step by step, new meshes on the way, and where it ends."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Floats, planar_cross
from ..body.state import BodyState
from ..coupled.coupling import Coupling, InterfaceReport
from ..coupled.energy import EnergyBudget
from ..coupled.remeshing import Remeshing, carry_over
from ..coupled.rigid import RigidPart
from ..errors import IncipientError
from ..fluid import Fluid, TimeStep, Transient
from ..fluid.transient import Past
from ..geometry.placement import Placement
from ..geometry.plane.grain import Disc
from ..geometry.space.solid import Sphere
from ..mesh import domain
from ..mesh.domain import Domain
from ..mesh.motion import MeshMotion, RigidDisplacement
from ..planning import drawing
from ..planning.body import initial_state, rigid_body
from ..planning.clearance import Clearance, surroundings
from ..planning.plan import Plan
from ..progress import Silent
from ..results.loads import apart, named, named_couple
from ..scene import Scene
from ..scene.tolerance import of_steps

if TYPE_CHECKING:
    from ..turbulence import InTime
    from .free_surface import MovingSurface
    from .turbulent import TurbulentFlow

Stage = Callable[[str], AbstractContextManager[Any]]

# Positions (in grain sizes) and angles are rounded to this before meshing, and the mesh is then moved by the
# remainder: round-off cannot change the mesh, on any number of ranks and after resuming.
ROUNDING = 1e-6
# Columns of the history for the orientation, by the dimension.
ORIENTATION = {2: ("angle",), 3: ("quaternion_w", "quaternion_x", "quaternion_y", "quaternion_z")}


class Trajectory:
    """A grain that moves in its scene. Every method is collective.

    Args:
        fluid: at time zero, on the mesh that was made for the scene; replaced and destroyed with each new mesh.
        stage: context managers by name that take the time.
        voice: told of new meshes and of contact.
        state: the grain's state for which the mesh was made; None: that of the scene.
        turbulence: of the fluid; None: without.
    """

    def __init__(
        self,
        scene: Scene,
        plan: Plan,
        fluid: Fluid,
        stage: Stage,
        voice: Silent,
        state: BodyState | None = None,
        turbulence: TurbulentFlow | None = None,
    ):
        self.scene, self.plan, self.fluid, self._stage, self._voice = scene, plan, fluid, stage, voice
        assert scene.body is not None and scene.time is not None
        assert scene.grain is not None and scene.placement is not None
        self.grain, self.time = scene.grain, scene.time
        self.surroundings = surroundings(scene)
        self._is_free, self._is_repelled = scene.body.motion == "free", scene.body.on_contact == "repel"
        self.body = rigid_body(scene)
        self.surface: MovingSurface | None = None
        self.remeshings: list[Remeshing] = []
        self.interface_iterations: list[int] = []
        self.part, self.coupling, self.surface = self._coupled(fluid, state or initial_state(scene))
        self.turbulence, self.eddies = turbulence, self._eddies(turbulence, self.coupling)
        self.energy = EnergyBudget(fluid)
        order = 2 if self.time.scheme == "bdf2" else 1
        tolerance = of_steps(scene.numerics.tolerance)
        interface = self.eddies or self.coupling
        self.transient = Transient(fluid, order, tolerance, self.time.tolerance, interface)

    @property
    def domain(self) -> Domain:
        """The mesh at present."""
        return self.fluid.domain

    @property
    def state(self) -> BodyState:
        """The grain at present."""
        return self.part.state

    def steps(self) -> Iterator[TimeStep]:
        """Advance to the end, or until the grain meets something. See `Transient.march`.

        Raises:
            ConvergenceError: a step failed; the last good state is kept.
            MeshError: the grain's new place cannot be meshed, or fields do not survive the transfer.
        """
        self._renew_worn_mesh()
        time = self.time
        for step in self.transient.march(time.end, time.step, time.first_step):
            assert isinstance(step.report, InterfaceReport)
            self.interface_iterations.append(step.report.corrected)
            yield step
            if self.coupling.met or self.time.end - step.time <= 1e-9 * self.time.end:
                return
            self._renew_worn_mesh()

    # -- what is told -----------------------------------------------------------------------------

    def row(self, step: TimeStep) -> dict[str, Any]:
        """One line of the history."""
        assert isinstance(step.report, InterfaceReport)
        state, load = self.state, self.part.end.flow_load
        with self._stage("tractions"):
            kinetic, dissipation, power = (
                self.energy.kinetic(),
                self.energy.dissipation(),
                self.energy.power(),
            )
        residuals = step.report.residuals
        return {
            "time": step.time,
            "step": step.length,
            "newton": step.report.iterations,
            "error": np.nan if step.error is None else step.error,
            **columns_of_state(state),
            **columns_of_load(load, "force", "couple"),
            # Zero for a free grain that is not repelled.
            **(columns_of_load(self.repulsion(), "repulsion", "repulsion_couple") if self._is_free else {}),
            "interface": step.report.corrected,
            "interface_residual": residuals[-1],
            "mesh_quality": self.coupling.quality.worst,
            **(self.surface.columns(step) if self.surface is not None else {}),
            **(self.turbulence.report(self.fluid).columns() if self.turbulence is not None else {}),
            "meshes": 1 + len(self.remeshings),
            "energy_fluid": kinetic,
            "energy_body": self.body.kinetic_energy(state),
            "dissipation": dissipation,
            "power": power,
        }

    def summary(self) -> dict[str, Any]:
        """Plain data for the result: how it ended, where the grain is, how it went."""
        state, near = self.state, self.clearance()
        iterations, in_space = self.interface_iterations or [0], self.scene.gdim == 3
        return {
            "ended": {
                "by": "contact" if self.coupling.met else "time",
                "time": self.fluid.time,
                "clearance": near.distance,
                "nearest": near.other,
                "without_verdict": "",
            },
            "place": state.place,
            **({"quaternion": state.orientation} if in_space else {"angle": float(state.orientation[0])}),
            "velocity": state.velocity,
            "spin": state.spin if in_space else float(state.spin[0]),
            "mass": self.body.inertia.mass,
            "inertia": self.body.inertia.moments if in_space else float(self.body.inertia.moments[0]),
            "interface_iterations": {"mean": float(np.mean(iterations)), "most": max(iterations)},
            "remeshings": [asdict(one) for one in self.remeshings],
        }

    def clearance(self) -> Clearance:
        """How far the grain is from what is nearest to it. Not collective."""
        return self.surroundings.clearance(self.state.placement)

    def repulsion(self) -> Floats:
        """Force and couple (3,), in space (6,), from what the grain has come close to; zero unless it is repelled."""
        return self._repulsion(self.state) if self._is_repelled else np.zeros(self.body.size)

    # -- building ---------------------------------------------------------------------------------

    def _coupled(
        self, fluid: Fluid, state: BodyState, drawn: Placement | None = None
    ) -> tuple[RigidPart, Coupling, MovingSurface | None]:
        """The grain in the fluid, whose mesh, drawn for a placement, is moved to where the state is."""
        numerics, surface = self.scene.numerics, self._above(fluid)
        turning = not isinstance(self.grain, Disc | Sphere)
        free = () if surface is None else (surface.part.mesh.boundary,)
        displacement = RigidDisplacement(fluid.domain, "body", drawn or state.placement, turning, free)
        motion = MeshMotion(fluid.domain)
        if drawn is not None:
            motion.move(displacement.at(state.placement))
            fluid.constraints.boundary_points_moved()
        room = None if self._is_repelled else self._room
        exact = numerics.coupling == "exact"
        part = RigidPart(
            fluid, self.body, state, displacement, self._other_load, room, self._stage, added_mass=exact
        )
        if surface is not None:
            return part, surface.coupled(motion, part), surface
        tolerance = None if numerics.interface_tolerance == "auto" else numerics.interface_tolerance
        return part, Coupling(fluid, [part], motion, tolerance, stage=self._stage), None

    def _eddies(self, turbulence: TurbulentFlow | None, coupling: Coupling) -> InTime | None:
        """What grain and flow are solved together with; None without turbulence."""
        return None if turbulence is None else turbulence.in_time(coupling.fluid, self._stage, coupling)

    def _above(self, fluid: Fluid) -> MovingSurface | None:
        """The free surface above a fluid, carried over to it if there is one already; None without one."""
        if not self.scene.has_surface:
            return None
        from .free_surface import MovingSurface

        if self.surface is not None:
            return self.surface.carried_to(fluid)
        return MovingSurface(self.scene, fluid, self._stage)

    def _room(self, state: BodyState) -> float:
        """How far the grain may still go before the gap to something is that which counts as contact."""
        gap = self.scene.contact_gap
        return self.surroundings.clearance(state.placement, 2.0 * gap).distance - gap

    def _other_load(self, state: BodyState) -> Floats:
        """Weight and buoyancy, and what keeps a repelled grain away."""
        load = np.zeros(self.body.size)
        load[: self.body.gdim] = (self.body.inertia.mass - self.grain.volume) * self.scene.gravity_vector
        if self._is_repelled:
            load += self._repulsion(state)
        return load

    def _repulsion(self, state: BodyState) -> Floats:
        """Force and couple that keep a grain from what it comes close to.

        Along the shortest line between both, S ((r - d)/r)^2 at a distance d below the range r, which is three
        times the contact gap: enough to stop the grain at the reference velocity V, S = 10 (m + m_f) V^2/r,
        against ten times its submerged weight, and against the drag, 100 nu V in the plane, times its size in space.
        """
        reach = 3.0 * self.scene.contact_gap
        near = self.surroundings.clearance(state.placement, reach)
        if near.distance >= reach:
            return np.zeros(self.body.size)
        speed, volume, mass = self.scene.reference_velocity, self.grain.volume, self.body.inertia.mass
        weight = abs(mass - volume) * float(np.linalg.norm(self.scene.gravity_vector))
        drag = 100.0 * self.scene.viscosity * speed * self.grain.size ** (self.scene.gdim - 2)
        strength = 10.0 * (mass + volume) * speed**2 / reach + 10.0 * weight + drag
        on_grain, on_other = np.array(near.on_grain), np.array(near.on_other)
        towards = on_grain - on_other if near.distance > 0.0 else on_other - on_grain
        away = towards / max(float(np.linalg.norm(towards)), 1e-300)
        force = strength * (1.0 - near.distance / reach) ** 2 * away
        arm = on_grain - state.place
        twist = np.cross(arm, force) if len(arm) == 3 else [planar_cross(arm, force)]
        load = np.concatenate([force, twist])
        if self.scene.symmetric:  # as much from the mirror image of what it has come close to
            load[[1, 3, 5]] = 0.0
        return load

    # -- a new mesh -------------------------------------------------------------------------------

    def _renew_worn_mesh(self) -> None:
        """Remesh if a step as long as the last would spoil the mesh."""
        times = [one.time for one in self.part.past]
        if len(times) == 1:
            return
        ahead = self.coupling.quality_ahead(times[0] - times[1], self.transient.order)
        if ahead.relative < self.scene.numerics.remesh_below:
            self._remesh()

    def _remesh(self) -> None:
        """Mesh the fluid anew around the grain and carry everything over; the old mesh goes last."""
        with self._stage("remeshing"):
            old = self.fluid
            assert self.scene.placement is not None
            drawn = rounded(self.state.placement, self.scene.placement, ROUNDING * self.grain.size)
            scene = self.scene if self.surface is None else self.surface.drawn(drawn)
            laid_out = drawing.lay_out(scene, self.plan, drawn)
            made = domain.build(old.domain.comm, laid_out.drawing, self.scene.gdim)
            turbulence = None if self.turbulence is None else self.turbulence.on(made)
            model = old.model if turbulence is None else turbulence.within(old.model)
            fluid = Fluid(made, model, old.conditions, old.reynolds)
            fluid.watch = old.watch
            if turbulence is not None:
                turbulence.joined(fluid)
            try:
                part, coupling, surface = self._coupled(fluid, self.state, drawn)
                now = Past(old.time, old.state.x.array, np.empty(0))
                (_, *past), told = carry_over(
                    (self.coupling, self.part), (coupling, part), [now, *self.transient.past]
                )
            except IncipientError:
                fluid.destroy()
                raise
            self.fluid, self.part, self.coupling, self.energy = fluid, part, coupling, EnergyBudget(fluid)
            self.surface = surface
            eddies = self._eddies(turbulence, coupling)
            if turbulence is not None and eddies is not None and self.eddies is not None:
                turbulence.carry_over(self.eddies, eddies)
            self.turbulence, self.eddies = turbulence, eddies
            self.transient.continue_on(fluid, eddies or coupling, past)
            self.remeshings.append(told)
            old.destroy()
        self._voice.say(
            f"t = {told.time:.6g}: a new mesh of {told.cells} cells; making the flow free of divergence on it "
            f"changed the velocity by {told.change:.1e}"
        )


def rounded(placement: Placement, first: Placement, unit: float) -> Placement:
    """The placement with its way from the first one rounded to a unit of length, and its turn to ROUNDING."""
    way = np.subtract(placement.centre, first.centre)
    turn = placement.turn_since(first)
    return first.moved(unit * np.round(way / unit), ROUNDING * np.round(turn / ROUNDING))


def columns_of_state(state: BodyState) -> dict[str, float]:
    """Place, orientation and velocities by the names of the history's columns. Not collective."""
    gdim = len(state.place)
    turned = dict(zip(ORIENTATION[gdim], state.orientation.tolist(), strict=True))
    place = dict(zip("xyz", state.place.tolist(), strict=False))
    velocity, spin = apart(state.velocities)
    return {**place, **turned, **named("velocity", velocity, gdim), **named_couple("spin", spin, gdim)}


def columns_of_load(load: Floats, force: str, couple: str) -> dict[str, float]:
    """A load (3,), in space (6,), by the names of the history's columns. Not collective."""
    gdim, (pushed, twisted) = 2 if len(load) == 3 else 3, apart(load)
    return named(force, pushed, gdim) | named_couple(couple, twisted, gdim)

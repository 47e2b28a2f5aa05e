"""Rigid body in a fluid, with the derivative of the traction with respect to the body's velocity.

A segregated exchange diverges for light bodies, whose added mass dominates; here A_u = R^T A (R - A_0^-1 A R)
is added to the mass, with the rigid motions R of the boundary, the flow's Jacobian A, and A_0 with the boundary
fixed. Mesh displacement enters A R by finite differences, Broyden's updates correct A_u between iterations, and
with a law of the wall A_u follows from the change of its load.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .. import compat
from ..arrays import Floats, extrapolated, spatial
from ..body.rigidbody import MeanLoad, Motion, RigidBody
from ..body.state import BodyState, rigid_velocity
from ..errors import ConvergenceError, SceneError
from ..fluid import Fluid
from ..fluid.transient import TimeStep
from ..mesh.motion import RigidDisplacement
from ..parallel import largest
from ..results.loads import COMPONENTS
from .coupling import Part
from .tractions import TractionProbe, rigid_motion

# Relative change of the step length that requires a new derivative.
SAME_LENGTH = 0.1
# Clearance, relative to the body's extent, that counts as contact.
CLOSE = 1e-6
# Shortest step to contact, relative to the step in which it occurs.
TOUCHING_STEP = 1e-6
# Finite-difference displacement, relative to the body's extent.
NUDGE = 1e-6
# Relative residual of the flow's response: an iteration leaves about as much, and LU factorisations are exact anyway.
ANSWERED = 1e-3
# Smallest change of the body's velocities, relative to the flow's, that resolves the change of load.
SEEN = 1e-8


@dataclass(frozen=True, eq=False)
class End:
    """End of a step: body state, total and hydrodynamic load (k,), step length."""

    state: BodyState
    load: Floats
    flow_load: Floats
    length: float


@dataclass(frozen=True, eq=False)
class Response:
    """Changes of the flow's state (k, unknowns) by rigid motions, and `resistance` (k, k) A_u.

    length: of the step; factors: number of the flow's factorisation
    """

    changes: Floats
    resistance: Floats
    length: float
    factors: int


class RigidPart(Part):
    """A rigid body as a part of a coupling (see `coupling.Part`). Every method is collective.

    met: contact at the end of the last attempt

    Args:
        fluid: with `Carried` or moving `Friction` on the boundary.
        load: force and torque (k,) of a state other than the flow's, such as weight.
        room: clearance [length] of a state; None: unlimited.
    """

    met = False
    name = "body"
    folded = "the cells around the grain fold over: use a larger numerics.remesh_below or a smaller time.step"

    def __init__(
        self,
        fluid: Fluid,
        body: RigidBody,
        state: BodyState,
        displacement: RigidDisplacement,
        load: Callable[[BodyState], Floats],
        room: Callable[[BodyState], float] | None = None,
    ):
        self.fluid, self.body = fluid, body
        self.mesh, self.boundary = displacement, displacement.boundary
        self._load, self._room = load, room
        self.state = body.consistent(state)
        self.past = [self.state]
        self.mean_load = MeanLoad()
        self.end = End(self.state, np.zeros(body.size), np.zeros(body.size), 0.0)
        self.probe = TractionProbe(fluid, self.boundary, state.place)
        self._components = COMPONENTS[body.gdim]
        self._rubs = self.boundary in fluid.constraints.rubbing
        self._blocks = compat.nodes_on(fluid.space.velocity, fluid.domain.facets_of(self.boundary))
        arms = fluid.constraints.points[self._blocks, : body.gdim] - self.state.place
        self._extent = largest(fluid.domain.comm, np.linalg.norm(arms, axis=1))  # largest arm
        # Lengths (k,) that turn spins into velocities.
        self._unit = np.repeat([1.0, self._extent], [body.gdim, body.size - body.gdim])
        self._tried = self._improved = self.state
        self._response: Response | None = None
        self._motion: Motion | None = None

    # -- the step, as the coupling sees it --------------------------------------------------------

    def predict(self, length: float, order: int) -> None:
        self._tried = self.predicted(length, order)

    def displacement(self) -> Floats:
        return self.mesh.at(self._tried.placement)

    def place(self) -> None:
        self.lend(self._tried)

    def lend(self, state: BodyState) -> None:
        """Set the grain's boundary velocity to that of a state."""
        if self._rubs:
            self.fluid.walls.carry(self.boundary, state.velocity, state.spin, state.place)
        else:
            self.fluid.constraints.carry(self.boundary, lambda x: rigid_velocity(state, x))

    def residual(self, length: float, order: int) -> float:
        """Relative residual of the equation of motion; also computes the end under the present load.

        Raises ConvergenceError: singular resistance on a folded mesh or in too long a step.
        """
        self.mean_load = replace(self.mean_load, order=order)
        try:
            self._improved, residual = self._under_load(self._tried, length)
        except SceneError as error:
            raise ConvergenceError(str(error)) from error
        return residual

    def correct(self) -> None:
        change = self._improved.velocities - self._tried.velocities
        self._tried = self._improved
        with self.fluid.stage("interface"):
            if self._response is not None:
                self.fluid.state.x.array[:] += change @ self._response.changes

    def allowed(self, length: float) -> float:
        if self._room is None or self._motion is None:
            return length
        left, close = self._room(self.end.state), CLOSE * self._extent
        self.met = left <= close
        if left >= -close:
            return length
        first = self._motion.first(self._room)
        # In contact from the start of the step: keep its length.
        return (
            length if first is None else max(first.time - self.state.time, TOUCHING_STEP * length)
        )

    def accept(self, step: TimeStep) -> None:
        self.mean_load = self.mean_load.accept(self.end.load, self.end.length)
        self.state = self.end.state
        self.past = [self.state, *self.past[:2]]

    def restore(self) -> None:
        self.end = replace(self.end, state=self.state)

    def forget(self) -> None:
        self._response = None

    def velocities(self) -> Floats:
        """Velocity, and spin times the largest arm, (k,), at the end of the last attempt."""
        return self.end.state.velocities * self._unit

    def predicted(self, length: float, order: int) -> BodyState:
        start, free = self.state, self.body.mask
        if not free.any():
            self._motion = self.body.motion(start, length, np.zeros(self.body.size))
            return self._motion.end
        velocities = start.velocities
        if order == 2:
            known = [state.velocities for state in self.past]
            velocities = extrapolated(
                [state.time for state in self.past], known, start.time + length
            )
        velocities = np.where(free, velocities, self.body.imposed(start.time + length))
        way = 0.5 * length * (start.velocities + velocities)
        d = self.body.gdim
        return BodyState.at(
            start.placement.moved(way[:d], way[d:]), velocities, start.time + length
        )

    # -- one iteration ----------------------------------------------------------------------------

    def _under_load(self, end: BodyState, length: float) -> tuple[BodyState, float]:
        with self.fluid.stage("tractions"):
            self.probe.about = spatial(end.place)
            flow_load = self.probe.resultant().load[self._components]
        load = flow_load + self._load(end)
        before, self.end = self.end, End(end, load, flow_load, length)
        if not self.body.mask.any():
            return end, 0.0
        with self.fluid.stage("interface"):
            resistance = self._responded(before, self.end).resistance
            stiffness = self._stiffness(end, load - flow_load, length)
            added = self.mean_load.added(resistance + stiffness, length)
            improved = self._moved(length, self.mean_load.mean(load, length), added, end.velocities)
            change = improved.velocities - end.velocities
            missed = self.body.momentum(improved) - self.body.momentum(end) + added @ change
            return improved, self._relative(missed / length, resistance)

    def _moved(self, length: float, mean: Floats, added: Floats, guess: Floats) -> BodyState:
        """End of a step under a mean load (k,), with an added mass (k, k) about velocities `guess` (k,)."""
        self._motion = self.body.motion(self.state, length, mean, added, guess)
        return self._motion.end

    def _relative(self, missed: Floats, resistance: Floats) -> float:
        end, free = self.end, self.body.mask
        unit = self._unit
        loads = (end.flow_load, end.load - end.flow_load, resistance @ end.state.velocities)
        scale = max(float(np.linalg.norm((load / unit)[free])) for load in loads)
        size = float(np.linalg.norm((missed / unit)[free]))
        return size / scale if size > 0.0 else 0.0

    # -- the derivative ---------------------------------------------------------------------------

    def _responded(self, before: End, end: End) -> Response:
        """Present response with Broyden's update, or a new one after a change of factorisation or step length."""
        known = self._response
        if (
            known is None
            or known.factors != self.fluid.solver.statistics["factorisations"]
            or abs(end.length / known.length - 1.0) > SAME_LENGTH
        ):
            known = self._response = self._respond(end.state, end.length)
        elif before.state.time == end.state.time and before.length == end.length:
            known = self._response = self._corrected(known, before, end)
        return known

    def _corrected(self, known: Response, before: End, end: End) -> Response:
        step = end.state.velocities - before.state.velocities
        scaled = step * self._unit**2
        size = float(step @ scaled)
        if size <= (SEEN * self.fluid.speed()) ** 2:
            return known
        missed = before.flow_load - end.flow_load - known.resistance @ step
        return replace(known, resistance=known.resistance + np.outer(missed, scaled) / size)

    def _respond(self, end: BodyState, length: float) -> Response:
        size, fluid, before = self.body.size, self.fluid, self.fluid.residual()
        changes, resistance = np.zeros((size, len(fluid.state.x.array))), np.zeros((size, size))
        for k in np.flatnonzero(self.body.mask):
            nudged, change = self._nudged(end, k, length)
            self._try(nudged)
            forcing = (fluid.residual() - before) / change  # by the displacement of the mesh
            self._try(end)
            moved = np.zeros(size) if self._rubs else np.eye(size)[k]
            motion = rigid_motion(fluid, self.boundary, end.place, moved)
            changes[k] = fluid.response(motion, forcing, ANSWERED)
            if self._rubs:
                resistance[:, k] = self._resistance_of_wall(nudged, change, changes[k])
                self._try(end)
            else:
                answer = fluid.change_of_residual(changes[k]) + forcing
                resistance[:, k] = -self.probe.resultant_of(answer).load[self._components]
        factors = fluid.solver.statistics["factorisations"]
        return Response(changes, resistance, length, factors)

    def _nudged(self, end: BodyState, k: int, length: float) -> tuple[BodyState, float]:
        way, d = np.zeros(self.body.size), self.body.gdim
        way[k] = NUDGE * self._extent / self._unit[k]
        # The end velocity contributes half the step length to the displacement.
        change = way / (0.5 * length)
        placement = end.placement.moved(way[:d], way[d:])
        return BodyState.at(placement, end.velocities + change, end.time), float(change[k])

    def _try(self, state: BodyState) -> None:
        self._tried = state
        self.follow()

    def _resistance_of_wall(self, nudged: BodyState, change: float, answer: Floats) -> Floats:
        """Decrease (k,) of the load per unit velocity, from the flow's response (unknowns,)."""
        fluid, before = self.fluid, self.fluid.state.x.array.copy()
        self._try(nudged)
        fluid.state.x.array[:] += change * answer
        self.probe.about = spatial(nudged.place)
        moved = self.probe.resultant().load[self._components]
        fluid.state.x.array[:] = before
        self.probe.about = spatial(self.end.state.place)
        return np.asarray((self.end.flow_load - moved) / change)

    def _stiffness(self, end: BodyState, load: Floats, length: float) -> Floats:
        """Minus the derivative (k, k) of the non-hydrodynamic load with respect to the body's velocities."""
        changes = np.zeros((self.body.size, self.body.size))
        for k in np.flatnonzero(self.body.mask):
            nudged, change = self._nudged(end, k, length)
            changes[:, k] = (load - self._load(nudged)) / change
        return changes

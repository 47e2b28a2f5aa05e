"""Rigid body in a fluid, with the derivative of the traction with respect to the body's velocity.

A segregated exchange diverges for light bodies, whose added mass dominates; here A_u = R^T A (R - A_0^-1 A R)
is added to the mass, with the rigid motions R of the boundary, the flow's Jacobian A, and A_0 with the boundary
fixed. A_u is the finite difference of the load between the flow and its linear response to a displacement of body and
mesh; Broyden's updates correct it between iterations.
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

    stiffness: decrease (k, k) of the other load; length: of the step; factors: number of the flow's factorisation
    """

    changes: Floats
    resistance: Floats
    stiffness: Floats
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
        blocks = compat.nodes_on(fluid.space.velocity, fluid.domain.facets_of(self.boundary))
        arms = fluid.constraints.points[blocks, : body.gdim] - self.state.place
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
        before, end, self._improved = self.end, self._tried, self._tried
        with self.fluid.stage("tractions"):
            flow_load = self._flow_load(end)
        load = flow_load + self._load(end)
        self.end = End(end, load, flow_load, length)
        if not self.body.mask.any():
            return 0.0
        with self.fluid.stage("interface"):
            response = self._responded(before, self.end)
            added = self.mean_load.added(response.resistance + response.stiffness, length)
            mean = self.mean_load.mean(load, length)
            try:
                self._improved = self._moved(length, mean, added, end.velocities)
            except SceneError as error:
                raise ConvergenceError(str(error)) from error
        change = self._improved.velocities - end.velocities
        missed = self.body.momentum(self._improved) - self.body.momentum(end) + added @ change
        return self._relative(missed / length, response.resistance)

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
        known, end = self.past if order == 2 else self.past[:1], start.time + length
        velocities = extrapolated(
            [state.time for state in known], [state.velocities for state in known], end
        )
        velocities = np.where(free, velocities, self.body.imposed(end))
        way = 0.5 * length * (start.velocities + velocities)
        d = self.body.gdim
        return BodyState.at(start.placement.moved(way[:d], way[d:]), velocities, end)

    # -- one iteration ----------------------------------------------------------------------------

    def _flow_load(self, state: BodyState) -> Floats:
        self.probe.about = spatial(state.place)
        return self.probe.resultant().load[self._components]

    def _moved(self, length: float, mean: Floats, added: Floats, guess: Floats) -> BodyState:
        """End of a step under a mean load (k,), with an added mass (k, k) about velocities `guess` (k,)."""
        self._motion = self.body.motion(self.state, length, mean, added, guess)
        return self._motion.end

    def _relative(self, missed: Floats, resistance: Floats) -> float:
        end, free = self.end, self.body.mask
        loads = (end.flow_load, end.load - end.flow_load, resistance @ end.state.velocities)
        scale = max(float(np.linalg.norm((load / self._unit)[free])) for load in loads)
        size = float(np.linalg.norm((missed / self._unit)[free]))
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
            known = self._respond(end)
        elif before.state.time == end.state.time and before.length == end.length:
            step = end.state.velocities - before.state.velocities
            scaled = step * self._unit**2
            size = float(step @ scaled)
            if size > (SEEN * self.fluid.speed()) ** 2:
                missed = before.flow_load - end.flow_load - known.resistance @ step
                resistance = known.resistance + np.outer(missed, scaled) / size
                known = replace(known, resistance=resistance)
        self._response = known
        return known

    def _respond(self, end: End) -> Response:
        """New response, from the loads on the body displaced a little in each direction."""
        size, d, fluid, known = self.body.size, self.body.gdim, self.fluid, self.fluid.residual()
        state, now = fluid.state.x.array.copy(), end.state
        changes, (resistance, stiffness) = np.zeros((size, len(state))), np.zeros((2, size, size))
        for k in np.flatnonzero(self.body.mask):
            direction = np.eye(size)[k]
            way = NUDGE * self._extent / self._unit[k]
            # The end velocity contributes half the step length to the displacement.
            change = way / (0.5 * end.length)
            placement = now.placement.moved(way * direction[:d], way * direction[d:])
            nudged = BodyState.at(placement, now.velocities + change * direction, now.time)
            self._try(nudged)
            forcing = (fluid.residual() - known) / change  # by the displacement of the mesh
            moved = np.zeros(size) if self._rubs else direction
            motion = rigid_motion(fluid, self.boundary, nudged.place, moved)
            changes[k] = fluid.response(motion, forcing, ANSWERED)
            fluid.state.x.array[:] += change * changes[k]
            resistance[:, k] = (end.flow_load - self._flow_load(nudged)) / change
            stiffness[:, k] = (end.load - end.flow_load - self._load(nudged)) / change
            fluid.state.x.array[:] = state
        self._try(now)
        self.probe.about = spatial(now.place)
        factors = fluid.solver.statistics["factorisations"]
        return Response(changes, resistance, stiffness, end.length, factors)

    def _try(self, state: BodyState) -> None:
        self._tried = state
        self.follow()

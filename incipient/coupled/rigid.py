"""A rigid body in a fluid, with the derivative of the traction with respect to the body's velocity.

A body accelerates with the fluid around it. For a light body the added mass dominates,
and a segregated exchange of forces and velocities diverges. The iteration here uses the derivative of the traction
with respect to the body's velocity, A_u = R^T A (R - A_0^-1 A R): R are the rigid motions (3 in 2-D, 6
in 3-D) of the body's boundary, A the Jacobian of the flow and A_0 the same with the boundary held, which
the fluid's solver solves. The contribution of the displaced mesh to A R is a one-sided finite difference, and
Broyden's updates correct A_u from one iteration to the next. With A_u added to the mass, bodies without mass
converge as well.
A law of the wall does not prescribe the flow's velocity: the wall's velocity enters friction and impermeability. The
flow then responds to the change of this load, and A_u is the resulting change of the load.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from ..arrays import Floats, extrapolated
from ..body.rigidbody import MeanLoad, Motion, RigidBody
from ..body.state import BodyState, rigid_velocity, turned
from ..errors import ConvergenceError, SceneError
from ..fluid import Fluid
from ..fluid.space import boundary_blocks
from ..mesh.motion import RigidDisplacement
from .tractions import Resultant, TractionProbe

Stage = Callable[[str], AbstractContextManager[Any]]

# A step whose length differs by more than this fraction from that of the present derivative takes a new one.
SAME_LENGTH = 0.1
# Room left, relative to the body's extent, at which a body counts as having met something.
CLOSE = 1e-6
# The shortest step to a meeting, relative to the step in which it occurs.
TOUCHING_STEP = 1e-6
# Displacement of the body, relative to its extent, by which derivatives are formed.
NUDGE = 1e-6
# Residual of the flow's answers, relative: an iteration then leaves about as much, and factors are exact anyway.
ANSWERED = 1e-3
# Smallest change of the body's velocities, relative to the flow's, from which the change of load is resolved.
SEEN = 1e-8


@dataclass(frozen=True, eq=False)
class End:
    """State at the end of a step: body, total load (k,), hydrodynamic load (k,), step length."""

    state: BodyState
    load: Floats
    flow_load: Floats
    length: float


@dataclass(frozen=True, eq=False)
class Response:
    """The flow's response to rigid motions of its body: changes of its state (k, unknowns), and of the load.

    `resistance` (k, k) is A_u, minus the derivative of the load by the velocities, for steps of a `length`.
    """

    changes: Floats
    resistance: Floats
    length: float


class RigidPart:
    """A rigid body as a part of a coupling (see `part.Part`). Every method is collective.

    Args:
        fluid: with `Carried(displacement.boundary)`, or there `Friction` that moves, among its conditions, and with
            `FlowModel.moving_mesh`.
        body: its mass, moments and freedom.
        state: position and velocities at the fluid's time.
        displacement: displacement of the mesh by the body.
        load: force and torque (k,) on the body in a state that are not the flow's traction: weight, buoyancy.
        room: clearance [length] of a body in a state; None: unlimited.
        stage: context managers by name that take the time.
        added_mass: False iterates without the derivative of the traction, as programs that pass forces and
            velocities back and forth do. It diverges for light bodies: for comparison only.
    """

    name = "body"
    folded = (
        "the mesh around the body folds over: use a larger numerics.remesh_below, or shorter steps"
    )

    def __init__(
        self,
        fluid: Fluid,
        body: RigidBody,
        state: BodyState,
        displacement: RigidDisplacement,
        load: Callable[[BodyState], Floats],
        room: Callable[[BodyState], float] | None = None,
        stage: Stage = lambda name: nullcontext(),
        added_mass: bool = True,
    ):
        self.fluid, self.body, self.mesh, self.boundary = (
            fluid,
            body,
            displacement,
            displacement.boundary,
        )
        self._load, self._room, self._stage = load, room, stage
        self.added_mass, self.met = added_mass, False
        self.state = body.consistent(state)
        self.past = [self.state]
        self.mean_load = MeanLoad()
        self.end = End(self.state, np.zeros(body.size), np.zeros(body.size), 0.0)
        self.probe = TractionProbe(fluid, self.boundary, state.place.tolist())
        self._rubs = self.boundary in fluid.constraints.rubbing
        self._blocks = boundary_blocks(fluid.space.velocity, fluid.domain.facets_of(self.boundary))
        self._extent = self._largest_arm()
        self._tried = self._improved = self.state
        self._response: Response | None = None
        self._motion: Motion | None = None
        self._factors = -1
        self._follow: Callable[[], None] = lambda: None

    # -- the step, as the coupling sees it --------------------------------------------------------

    def join(self, follow: Callable[[], None]) -> None:
        """Enter a coupling; `follow` brings mesh and boundary values to where all parts are at the end tried."""
        self._follow = follow

    def predict(self, length: float, order: int) -> None:
        """Try the end of a step with velocities extrapolated as the fluid's are."""
        self._tried = self.predicted(length, order)

    def displacement(self) -> Floats:
        """(n, 3) what the body adds to the places of the mesh's nodes at the end tried."""
        return self.mesh.at(self._tried.placement)

    def place(self) -> None:
        """Give the boundary the body's velocity at the end tried."""
        self.lend(self._tried)

    def lend(self, state: BodyState) -> None:
        """Give the boundary the velocity that the body has in a state."""
        if self._rubs:
            self.fluid.walls.carry(self.boundary, state.velocity, state.spin, state.place)
        else:
            self.fluid.constraints.carry(self.boundary, lambda x: rigid_velocity(state, x))

    def residual(self, length: float, order: int) -> float:
        """The residual of the body's equation of motion relative to its load; also computes the end under that load.

        Raises:
            ConvergenceError: the resistance of a folded mesh, or of a step so long that the body's path outweighs
                its velocity, may be singular; shorter steps converge.
        """
        self.mean_load = replace(self.mean_load, order=order)
        try:
            self._improved, residual = self._under_load(self._tried, length)
        except SceneError as error:
            if not self.added_mass:
                raise
            raise ConvergenceError(str(error)) from error
        return residual

    def correct(self) -> None:
        """Try the end under the present load; the flow responds linearly to the change of the body's velocities."""
        change = self._improved.velocities - self._tried.velocities
        self._tried = self._improved
        with self._stage("interface"):
            if self._response is not None:
                self.fluid.state.x.array[:] += change @ self._response.changes

    def allowed(self, length: float) -> float:
        """The length, or the shorter one after which the body meets something on the way it has taken."""
        if self._room is None or self._motion is None:
            return length
        left, close = self._room(self.end.state), CLOSE * self._extent
        self.met = left <= close
        if left >= -close:
            return length
        first = self._motion.first(self._room)
        # Already within at the start of the step: nothing is shorter than the step itself.
        return (
            length if first is None else max(first.time - self.state.time, TOUCHING_STEP * length)
        )

    def accept(self) -> None:
        """The end of the attempt is the last state now."""
        self.mean_load = self.mean_load.accept(self.end.load, self.end.length)
        self.state = self.end.state
        self.past = [self.state, *self.past[:2]]

    def take_over(self, was: RigidPart) -> None:
        """Continue from the body on another mesh."""
        self.mean_load, self.end, self.past = was.mean_load, was.end, list(was.past)

    def restore(self) -> None:
        """Put the body back to the last state."""
        self.end = replace(self.end, state=self.state)

    def forget(self) -> None:
        """Drop the flow's response. Not collective."""
        self._response = None

    def velocities(self) -> Floats:
        """(k,) velocity, and spin times the body's largest arm, at the end of the last attempt."""
        return self.end.state.velocities * self._unit()

    def predicted(self, length: float, order: int) -> BodyState:
        """The body at the end of a step, with velocities extrapolated as the fluid's are. Not collective."""
        start, free = self.state, self.body.mask
        if not free.any():
            self._motion = self.body.motion(start, length, np.zeros(self.body.size))
            return self._motion.end
        velocities = start.velocities
        if order == 2:
            known = [one.velocities for one in self.past]
            velocities = extrapolated([one.time for one in self.past], known, start.time + length)
        velocities = np.where(free, velocities, self.body.freedom.imposed(start.time + length))
        way = 0.5 * length * (start.velocities + velocities)
        d = self.body.gdim
        return BodyState.at(
            start.placement.moved(way[:d], way[d:]), velocities, start.time + length
        )

    # -- one iteration ----------------------------------------------------------------------------

    def _under_load(self, end: BodyState, length: float) -> tuple[BodyState, float]:
        """The end under the present load, and the residual of the body's equation of motion there."""
        with self._stage("tractions"):
            self.probe.refer_to(end.place.tolist())
            flow_load = self._load_of(self.probe.resultant())
        load = flow_load + self._load(end)
        before, self.end = self.end, End(end, load, flow_load, length)
        if not self.body.mask.any():
            return end, 0.0
        with self._stage("interface"):
            resistance = self._responded(before, self.end).resistance
            stiffness = self._stiffness(end, load - flow_load, length) if self.added_mass else 0.0
            added = self.mean_load.added(resistance + stiffness, length)
            improved = self._moved(length, self.mean_load.mean(load, length), added, end.velocities)
            change = improved.velocities - end.velocities
            missed = self.body.momentum(improved) - self.body.momentum(end) + added @ change
            return improved, self._relative(missed / length, resistance)

    def _moved(self, length: float, mean: Floats, added: Floats, guess: Floats) -> BodyState:
        """The end of a step under a mean load (k,), with an added mass (k, k) linearised about a guess (k,)."""
        self._motion = self.body.motion(self.state, length, mean, added, guess)
        return self._motion.end

    def _relative(self, missed: Floats, resistance: Floats) -> float:
        """A residual load relative to the loads of the flow, of other forces, and of the resistance to the motion."""
        end, free = self.end, self.body.mask
        unit = self._unit()
        loads = (end.flow_load, end.load - end.flow_load, resistance @ end.state.velocities)
        largest = max(float(np.linalg.norm((load / unit)[free])) for load in loads)
        size = float(np.linalg.norm((missed / unit)[free]))
        return size / largest if size > 0.0 else 0.0

    # -- the derivative ---------------------------------------------------------------------------

    def _responded(self, before: End, end: End) -> Response:
        """The present response, updated by the last iteration, or a new one.

        New after a change of the factorisation or of the step's length. Otherwise Broyden's update, the smallest that
        explains the last change of the load with the velocities. It accounts for the change of the load with the
        body's position, which A_u neglects, and for an old factorisation.
        """
        if not self.added_mass:
            return self._no_response(end.length)
        factors, known = self.fluid.solver.statistics.factorisations, self._response
        if (
            known is None
            or factors != self._factors
            or abs(end.length / known.length - 1.0) > SAME_LENGTH
        ):
            known = self._response = self._respond(end.state, end.length)
            self._factors = self.fluid.solver.statistics.factorisations
        elif before.state.time == end.state.time and before.length == end.length:
            known = self._response = self._corrected(known, before, end)
        return known

    def _no_response(self, length: float) -> Response:
        size = self.body.size
        return Response(
            np.zeros((size, len(self.fluid.state.x.array))), np.zeros((size, size)), length
        )

    def _corrected(self, known: Response, before: End, end: End) -> Response:
        step = end.state.velocities - before.state.velocities
        scaled = step * self._unit() ** 2
        size = float(step @ scaled)
        if size <= (SEEN * self.fluid.speed()) ** 2:
            return known
        missed = before.flow_load - end.flow_load - known.resistance @ step
        return replace(known, resistance=known.resistance + np.outer(missed, scaled) / size)

    def _unit(self) -> Floats:
        """(k,) lengths that turn spins into velocities: one, and the body's largest arm."""
        d = self.body.gdim
        return np.concatenate([np.ones(d), np.full(self.body.size - d, self._extent)])

    def _respond(self, end: BodyState, length: float) -> Response:
        space, size = self.fluid.space, self.body.size
        arms = self.fluid.constraints.points[self._blocks, : space.gdim] - end.place
        changes, resistance = (
            np.zeros((size, len(self.fluid.state.x.array))),
            np.zeros((size, size)),
        )
        places = space.unknowns_at_nodes[self._blocks]
        free = np.flatnonzero(self.body.mask)
        forcing = self._of_displacements(end, length, free)
        for k in free:
            motion = np.zeros_like(self.fluid.state.x.array)
            unit = np.eye(size)[k]
            if not self._rubs:
                motion[places] = unit[: space.gdim] + turned(unit[space.gdim :], arms)
            changes[k], residual = self.fluid.response(motion, forcing[k], ANSWERED)
            if self._rubs:
                resistance[:, k] = self._resistance_of_wall(
                    *self._nudged(end, k, length), changes[k]
                )
                self._try(end)
            else:
                resistance[:, k] = -self._load_of(self.probe.resultant_of(residual))
        return Response(changes, resistance, length)

    def _of_displacements(
        self, end: BodyState, length: float, free: NDArray[np.intp]
    ) -> dict[int, Floats]:
        """Derivatives of the fluid's residual by velocities of the body, at given velocities of the fluid.

        They arise from the position of the mesh at the end, and directly along a law of the wall.
        """
        before, derivatives = self.fluid.residual(), {}
        for k in free:
            nudged, change = self._nudged(end, k, length)
            self._try(nudged)
            derivatives[k] = (self.fluid.residual() - before) / change
        self._try(end)
        return derivatives

    def _nudged(self, end: BodyState, k: int, length: float) -> tuple[BodyState, float]:
        """The end of a step with a perturbed velocity, and the perturbation."""
        way, d = np.zeros(self.body.size), self.body.gdim
        way[k] = NUDGE * self._extent / self._unit()[k]
        # At the end of a step the body has gone half the step's length times its velocity there.
        change = way / (0.5 * length)
        placement = end.placement.moved(way[:d], way[d:])
        return BodyState.at(placement, end.velocities + change, end.time), float(change[k])

    def _try(self, state: BodyState) -> None:
        self._tried = state
        self._follow()

    def _resistance_of_wall(self, nudged: BodyState, change: float, answer: Floats) -> Floats:
        """Decrease (k,) of the load per unit velocity, from the flow's response (unknowns,)."""
        fluid, before = self.fluid, self.fluid.state.x.array.copy()
        self._try(nudged)
        fluid.state.x.array[:] += change * answer
        self.probe.refer_to(nudged.place.tolist())
        moved = self._load_of(self.probe.resultant())
        fluid.state.x.array[:] = before
        self.probe.refer_to(self.end.state.place.tolist())
        return np.asarray((self.end.flow_load - moved) / change)

    def _stiffness(self, end: BodyState, load: Floats, length: float) -> Floats:
        """Minus the derivative (k, k) of the load that is not the flow's by the body's velocities; not collective.

        It arises from the position at the end as in `_of_displacements`, and directly; zero for a constant load.
        """
        changes = np.zeros((self.body.size, self.body.size))
        for k in np.flatnonzero(self.body.mask):
            nudged, change = self._nudged(end, k, length)
            changes[:, k] = (load - self._load(nudged)) / change
        return changes

    def _load_of(self, resultant: Resultant) -> Floats:
        """Force and torque as the body takes them, (k,)."""
        d = self.body.gdim
        return np.concatenate(
            [resultant.force[:d], resultant.torque[2:] if d == 2 else resultant.torque]
        )

    def _largest_arm(self) -> float:
        arms = self.fluid.constraints.points[self._blocks, : self.body.gdim] - self.state.place
        mine = float(np.sqrt((arms**2).sum(axis=1)).max(initial=0.0))
        return float(self.fluid.domain.comm.allreduce(mine, op=MPI.MAX))

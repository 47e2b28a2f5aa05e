"""A scene's moving grain as a rigid body, and its state at time zero."""

import numpy as np

from ..body.rigidbody import RigidBody
from ..body.state import BodyState, Freedom, Inertia, rigid_velocity
from ..geometry.placement import Placement
from ..scene import Body
from ..scene.expression import of_time
from ..scene.mass import inertia_tensor, mass
from .base_flow import Velocity

DEGREES = {2: ("x", "y", "angle"), 3: ("x", "y", "z", "rx", "ry", "rz")}
# What a grain in half of a symmetric scene cannot do: its mirror image would move otherwise.
OUT_OF_THE_PLANE = ("y", "rx", "rz")


def rigid_body(body: Body, symmetric: bool = False) -> RigidBody:
    """Mass, moments and freedom of a moving grain; `symmetric`: half of it is in the flow."""
    if body.course is None:
        held = {*body.locked, *(OUT_OF_THE_PLANE if symmetric else ())}
        freedom = Freedom(tuple(name not in held for name in DEGREES[body.gdim]))
    else:
        freedom = Freedom.none(body.gdim, of_time(body.course, "body.course"))
    return RigidBody(_inertia(body), freedom)


def initial_state(body: Body, placement: Placement, symmetric: bool = False) -> BodyState:
    """Position and velocities of a moving grain at time zero."""
    velocities = np.concatenate([np.atleast_1d(body.velocity), np.atleast_1d(body.spin)])
    return rigid_body(body, symmetric).consistent(BodyState.at(placement, velocities))


def velocity_at_first(body: Body, placement: Placement, symmetric: bool = False) -> Velocity:
    """Velocity of the surface of a moving grain at time zero, at positions (gdim, n)."""
    state = initial_state(body, placement, symmetric)
    return lambda x, t: rigid_velocity(state, x[: body.gdim].T).T


def _inertia(body: Body) -> Inertia:
    tensor = inertia_tensor(body)
    tensor = np.zeros((3, 3)) if tensor is None else tensor
    heavy = mass(body) or 0.0
    return Inertia.about(heavy, tensor, body.gdim)

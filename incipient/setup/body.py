"""A scene's moving grain as a rigid body, and its state at time zero."""

import numpy as np

from ..body.rigidbody import RigidBody
from ..body.state import BodyState, Freedom, Inertia
from ..geometry.placement import Placement
from ..scene import Body
from ..scene.expression import of_time
from ..scene.grains import inertia_tensor, mass

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
    inertia = Inertia.about(mass(body) or 0.0, inertia_tensor(body), body.gdim)
    return RigidBody(inertia, freedom)


def initial_state(body: Body, placement: Placement, symmetric: bool = False) -> BodyState:
    """Position and velocities of a moving grain at time zero."""
    velocities = np.concatenate([np.atleast_1d(body.velocity), np.atleast_1d(body.spin)])
    return rigid_body(body, symmetric).consistent(BodyState.at(placement, velocities))

"""A scene's moving grain as a rigid body: mass, moment, freedom, and its state at time zero."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Floats
from ..body.rigidbody import RigidBody
from ..body.state import BodyState, Freedom, Inertia
from ..scene import Scene
from ..scene.expression import Expression
from ..scene.motion import moment


def rigid_body(scene: Scene) -> RigidBody:
    """Mass, moment and freedom of a scene's moving grain."""
    body = scene.body
    assert body is not None
    inertia = Inertia(scene.mass or 0.0, np.array([moment(body) or 0.0]))
    if body.course is None:
        freedom = Freedom(tuple(name not in body.locked for name in ("x", "y", "angle")))
    else:
        freedom = Freedom.none(scene.gdim, _course(body.course))
    return RigidBody(inertia, freedom)


def initial_state(scene: Scene) -> BodyState:
    """Place and velocities of a scene's moving grain at time zero."""
    body, placement = scene.body, scene.placement
    assert body is not None and placement is not None
    return rigid_body(scene).consistent(BodyState.at(placement, [*body.velocity, body.spin]))


def _course(formulas: tuple[str, ...]) -> Callable[[float], Floats]:
    """Velocities (3,) as functions of time."""
    components = [Expression(formula) for formula in formulas]
    return lambda time: np.array([float(one(np.zeros((3, 1)), time)[0]) for one in components])

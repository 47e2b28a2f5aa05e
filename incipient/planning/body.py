"""A scene's moving grain as a rigid body: mass, moments, freedom, and its state at time zero."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Floats
from ..body.rigidbody import RigidBody
from ..body.state import BodyState, Freedom, Inertia
from ..scene import Scene
from ..scene.expression import expressions
from ..scene.motion import inertia_tensor

DEGREES = {2: ("x", "y", "angle"), 3: ("x", "y", "z", "rx", "ry", "rz")}
# What a grain in half of a symmetric scene cannot do: its mirror image would move otherwise.
OUT_OF_THE_PLANE = ("y", "rx", "rz")


def rigid_body(scene: Scene) -> RigidBody:
    """Mass, moments and freedom of a scene's moving grain."""
    body = scene.body
    assert body is not None
    if body.course is None:
        held = {*body.locked, *(OUT_OF_THE_PLANE if scene.symmetric else ())}
        freedom = Freedom(tuple(name not in held for name in DEGREES[scene.gdim]))
    else:
        freedom = Freedom.none(scene.gdim, _course(body.course))
    return RigidBody(_inertia(scene), freedom)


def initial_state(scene: Scene) -> BodyState:
    """Place and velocities of a scene's moving grain at time zero."""
    body, placement = scene.body, scene.placement
    assert body is not None and placement is not None
    velocities = np.concatenate([np.atleast_1d(body.velocity), np.atleast_1d(body.spin)])
    return rigid_body(scene).consistent(BodyState.at(placement, velocities))


def _inertia(scene: Scene) -> Inertia:
    """Mass and moments; zero where the scene gives none, which a prescribed motion has no use for."""
    assert scene.body is not None
    tensor = inertia_tensor(scene.body)
    tensor = np.zeros((3, 3)) if tensor is None else tensor
    mass = scene.mass or 0.0
    if scene.gdim == 2:
        return Inertia(mass, np.array([tensor[2, 2]]))
    return Inertia.about(mass, tensor)


def _course(formulas: tuple[str, ...]) -> Callable[[float], Floats]:
    """Velocities (3,), in space (6,), as functions of time."""
    components = expressions(formulas, "body.course")
    return lambda time: np.array([float(one(np.zeros((3, 1)), time)[0]) for one in components])

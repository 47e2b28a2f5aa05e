"""The undisturbed flow of a scene, and the boundary conditions that let it in."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from .layout import side_names
from .scene import ExpressionFlow, Scene, Shear

if TYPE_CHECKING:
    from .fluid import Condition

Velocity = Callable[[np.ndarray, float], np.ndarray]


def undisturbed(scene: Scene) -> Velocity:
    """The velocity the flow would have without grain and bed forms: x (3, n) and t give (2, n), scene units.

    Profiles start from the bed's height at the inflow.
    """
    flow = scene.flow
    if isinstance(flow, ExpressionFlow):
        return _from_expressions(flow)
    base = scene.domain.bottom
    if scene.bed_shape is not None:
        base = float(scene.bed_shape.height([scene.domain.left])[0])
    depth = scene.domain.ceiling - base
    profile = _profile(scene, depth)
    return lambda x, t: np.vstack([profile(np.clip(x[1] - base, 0.0, depth)), np.zeros_like(x[1])])


def _profile(scene: Scene, depth: float) -> Callable[[np.ndarray], np.ndarray]:
    """Speed against height above the bed."""
    flow = scene.flow
    if isinstance(flow, Shear):
        return lambda y: flow.rate * y
    mean = flow.velocity
    profiles: dict[str, Callable[[np.ndarray], np.ndarray]] = {
        "poiseuille": lambda y: 6 * mean * y * (depth - y) / depth**2,
        "open-channel": lambda y: 1.5 * mean * y * (2 * depth - y) / depth**2,
        "uniform": lambda y: np.full_like(y, mean),
        "lid": lambda y: np.full_like(y, mean),
        "still": lambda y: np.zeros_like(y),
    }
    return profiles[flow.kind]


def _from_expressions(flow: ExpressionFlow) -> Velocity:
    from .scene.expression import Expression

    components = [Expression(text) for text in flow.components]
    return lambda x, t: np.vstack([component(x, t) for component in components])


def conditions(scene: Scene, held: bool = False) -> list[Condition]:
    """Boundary conditions in the order in which they override each other: walls last, so corners are watertight.

    The velocity of a moving grain's surface is given within each step, or is that of time zero if it is `held`.
    """
    from .fluid import Carried, Open, Prescribed, Slip, no_slip

    bottom, right, top, left = side_names(scene)
    stream = undisturbed(scene)
    walls: list[str] = []
    moving: list[str] = []
    free: list[Condition] = []
    if scene.domain.kind == "channel":
        moving.append(left)
        free.append(Open(right))
    else:
        walls.extend((left, right))
    (walls if _is_wall(scene) else moving).append(bottom)
    if scene.top == "slip":
        free.append(Slip(top, axis=1))
    elif scene.top == "wall" and scene.flow.kind != "lid":
        walls.append(top)
    else:
        moving.insert(0, top)
    if scene.body is not None and scene.body.moves and held:
        free.append(Prescribed("body", _velocity_at_first(scene)))
    elif scene.body is not None and scene.body.moves:
        free.append(Carried("body"))
    elif scene.body is not None:
        walls.append("body")
    return [*free, *(Prescribed(name, stream) for name in moving), *(no_slip(name) for name in walls)]


def _velocity_at_first(scene: Scene) -> Velocity:
    """Of the surface of a moving grain at time zero."""
    from .bodystate import rigid_velocity
    from .trajectory import initial_state

    state = initial_state(scene)
    return lambda x, t: rigid_velocity(state, x[:2].T).T


def _is_wall(scene: Scene) -> bool:
    """Whether the bottom is a wall at rest rather than part of the stream."""
    bounded = scene.domain.kind == "box" or scene.top == "wall" or scene.flow.kind == "open-channel"
    return bounded or scene.bed is not None

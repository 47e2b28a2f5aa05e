"""The undisturbed flow of a scene: what the stream would be without grain and bed forms, and what enters."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..scene import ExpressionFlow, LogLaw, Scene, Shear

Velocity = Callable[[np.ndarray, float], np.ndarray]


SAMPLES = 1000  # of heights for a mean
STEEPER = 3.0  # than the profile is its rise from a bed that is above the datum at the inflow


def undisturbed(scene: Scene) -> Velocity:
    """The velocity the flow would have without grain and bed forms: x (3, n) and t give (gdim, n), scene units.

    Profiles start from the scene's datum; below it the fluid is at rest. Not collective.
    """
    return _stream(scene, scene.datum)


def inflow(scene: Scene) -> Velocity:
    """The velocity on the inflow: the undisturbed one, brought to rest on a bed that is above the datum there.

    Not collective.
    """
    bed = scene.bed_shape
    if bed is None:
        return undisturbed(scene)
    if scene.gdim == 2:
        return _stream(scene, max(scene.datum, float(bed.height([scene.domain.left])[0])))
    return _stream(scene, lambda x: np.maximum(scene.datum, bed.height(x[:2].T)))


def mean_speed(scene: Scene) -> float:
    """The scene's reference velocity; of a log-law stream, whose reference is the shear velocity, the mean one.

    Not collective.
    """
    if not isinstance(scene.flow, LogLaw):
        return scene.reference_velocity
    depth = scene.domain.ceiling - scene.datum
    return float(np.mean(_profile(scene)(depth * (np.arange(SAMPLES) + 0.5) / SAMPLES)))


def column(scene: Scene, place: Sequence[float], heights: np.ndarray) -> np.ndarray:
    """Points (3, n) of given heights above or below a place (gdim,) of the scene. Not collective."""
    points = np.zeros((3, len(heights)))
    points[: scene.up] = np.array(place[: scene.up])[:, None]
    points[scene.up] = heights
    return points


def bed_stress(scene: Scene) -> float:
    """Shear stress of the undisturbed flow at its datum, scene units with fluid density one. Not collective.

    It is that of the flow's profile, the same over the whole bed; of a flow given by formulas, at the inflow. Of the
    mean of a turbulent stream it is u*^2, of which the viscosity is but a part where the bed is rough.
    """
    if isinstance(scene.flow, LogLaw):
        return scene.flow.shear_velocity**2
    step = 1e-6 * scene.domain.height
    heights = scene.datum + step * np.array([0.0, 1.0, 2.0])
    speed = undisturbed(scene)(column(scene, scene.domain.origin, heights), 0.0)[0]
    gradient = (-3 * speed[0] + 4 * speed[1] - speed[2]) / (2 * step)
    return float(scene.viscosity * abs(gradient))


def _stream(scene: Scene, foot: float | Callable[[np.ndarray], np.ndarray]) -> Velocity:
    """The flow of the scene, at rest below `foot`, which is the datum or higher, or a function of places (3, n)."""
    if isinstance(scene.flow, ExpressionFlow):
        return _from_expressions(scene.flow)
    profile, datum, up = _profile(scene), scene.datum, scene.up

    def velocity(x: np.ndarray, t: float) -> np.ndarray:
        """Velocities (gdim, n) at places (3, n), along the first axis; they do not depend on the time."""
        speed = np.minimum(
            profile(x[up] - datum), STEEPER * profile(x[up] - (foot(x) if callable(foot) else foot))
        )
        return np.vstack([speed, *np.zeros((up, len(speed)))])

    return velocity


def _profile(scene: Scene) -> Callable[[np.ndarray], np.ndarray]:
    """Speed against height above the datum; none below."""
    flow, depth = scene.flow, scene.domain.ceiling - scene.datum
    if isinstance(flow, Shear):
        return lambda y: flow.rate * np.clip(y, 0.0, depth)
    if isinstance(flow, LogLaw):
        from .mean_profile import mean_profile

        law = mean_profile(scene)
        return lambda y: law.speed(np.clip(y, 0.0, depth))
    mean = flow.velocity
    profiles: dict[str, Callable[[np.ndarray], np.ndarray]] = {
        "poiseuille": lambda y: 6 * mean * y * (depth - y) / depth**2,
        "open-channel": lambda y: 1.5 * mean * y * (2 * depth - y) / depth**2,
        "uniform": lambda y: np.full_like(y, mean),
        "lid": lambda y: np.full_like(y, mean),
        "still": lambda y: np.zeros_like(y),
    }
    speed = profiles[flow.kind]
    # A uniform stream begins at the datum itself, found to round-off.
    return lambda y: np.where(y < -1e-9 * depth, 0.0, speed(np.clip(y, 0.0, depth)))


def _from_expressions(flow: ExpressionFlow) -> Velocity:
    from ..scene.expression import Expression

    components = [Expression(text) for text in flow.components]
    return lambda x, t: np.vstack([component(x, t) for component in components])

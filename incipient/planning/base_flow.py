"""The undisturbed flow of a scene: what the stream would be without grain and bed forms, and what enters."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..scene import ExpressionFlow, LogLaw, Scene, Shear
from ..scene.datum import height_of_datum

Velocity = Callable[[np.ndarray, float], np.ndarray]


Profile = Callable[[np.ndarray, np.ndarray], np.ndarray]

SAMPLES = 1000  # of heights for a mean
STEEPER = 3.0  # than the profile is its rise from a bed that is above the datum at the inflow


def undisturbed(scene: Scene, speed: float = 1.0) -> Velocity:
    """The velocity the flow would have without grain and bed forms: x (3, n) and t give (gdim, n), scene units.

    Profiles start from the datum; below it the fluid is at rest. With `speed` it is the velocity of a flow faster by
    that factor, in its own units: only the datum may be another one. Not collective.
    """
    datum = height_of_datum(scene, speed)
    return _stream(scene, datum, datum)


def inflow(scene: Scene, speed: float = 1.0) -> Velocity:
    """The velocity on the inflow: the undisturbed one, brought to rest on a bed that is above the datum there.

    Not collective.
    """
    bed, datum = scene.bed_shape, height_of_datum(scene, speed)
    if bed is None:
        return undisturbed(scene, speed)
    if scene.gdim == 2:
        return _stream(scene, datum, max(datum, float(bed.height([scene.domain.left])[0])))
    return _stream(scene, datum, lambda x: np.maximum(datum, bed.height(x[:2].T)))


def mean_speed(scene: Scene) -> float:
    """The scene's reference velocity; of a log-law stream, whose reference is the shear velocity, the mean one.

    Not collective.
    """
    if not isinstance(scene.flow, LogLaw):
        return scene.reference_velocity
    depth = scene.domain.ceiling - scene.datum
    heights = depth * (np.arange(SAMPLES) + 0.5) / SAMPLES
    return float(np.mean(_profile(scene, scene.datum)(heights, np.zeros(SAMPLES))))


def column(scene: Scene, place: Sequence[float], heights: np.ndarray) -> np.ndarray:
    """Points (3, n) of given heights above or below a place (gdim,) of the scene. Not collective."""
    points = np.zeros((3, len(heights)))
    points[: scene.up] = np.array(place[: scene.up])[:, None]
    points[scene.up] = heights
    return points


def bed_stress(scene: Scene, speed: float = 1.0) -> float:
    """Shear stress of the undisturbed flow at its datum, scene units with fluid density one. Not collective.

    It is that of the flow's profile, the same over the whole bed; between walls, in the middle; of a flow given by
    formulas, at the inflow. Of the mean of a turbulent stream it is u*^2, of which the viscosity is but a part where
    the bed is rough; with the k-epsilon model as the law of the wall estimates it. In a flow faster by `speed` it is
    that times this, in units of the scene.
    """
    if scene.is_turbulent:
        from .turbulence import faster, walls_of

        speed = speed if 0.0 < speed < np.inf else 1.0
        return float(speed * walls_of(faster(scene, speed)).shear_velocity ** 2)
    if isinstance(scene.flow, LogLaw):
        return scene.flow.shear_velocity**2
    step = 1e-6 * scene.domain.height
    heights = height_of_datum(scene, speed) + step * np.array([0.0, 1.0, 2.0])
    u = undisturbed(scene, speed)(column(scene, scene.domain.entrance, heights), 0.0)[0]
    gradient = (-3 * u[0] + 4 * u[1] - u[2]) / (2 * step)
    return float(scene.viscosity * abs(gradient))


def _stream(scene: Scene, datum: float, foot: float | Callable[[np.ndarray], np.ndarray]) -> Velocity:
    """The flow from a datum, at rest below `foot`, which is the datum or higher, or a function of places (3, n)."""
    if isinstance(scene.flow, ExpressionFlow):
        return _from_expressions(scene.flow)
    profile, up = _profile(scene, datum), scene.up

    def velocity(x: np.ndarray, t: float) -> np.ndarray:
        """Velocities (gdim, n) at places (3, n), along the first axis; they do not depend on the time."""
        lowest = foot(x) if callable(foot) else foot
        speed = np.minimum(profile(x[up] - datum, x[1]), STEEPER * profile(x[up] - lowest, x[1]))
        return np.vstack([speed, *np.zeros((up, len(speed)))])

    return velocity


def _profile(scene: Scene, datum: float) -> Profile:
    """Speed against height above the datum, and y where sides are walls; none below the datum."""
    flow, depth = scene.flow, scene.domain.ceiling - datum
    if isinstance(flow, Shear):
        return lambda z, y: flow.rate * np.clip(z, 0.0, depth)
    if isinstance(flow, LogLaw):
        from .mean_profile import mean_profile

        law = mean_profile(scene)
        return lambda z, y: law.speed(np.clip(z, 0.0, depth))
    mean = flow.velocity
    if scene.gdim == 3 and scene.sides == "wall" and flow.kind in ("poiseuille", "open-channel"):
        return _in_duct(scene, mean, depth if flow.kind == "poiseuille" else 2.0 * depth)
    profiles: dict[str, Callable[[np.ndarray], np.ndarray]] = {
        "poiseuille": lambda z: 6 * mean * z * (depth - z) / depth**2,
        "open-channel": lambda z: 1.5 * mean * z * (2 * depth - z) / depth**2,
        "uniform": lambda z: np.full_like(z, mean),
        "lid": lambda z: np.full_like(z, mean),
        "still": lambda z: np.zeros_like(z),
    }
    speed = profiles[flow.kind]
    # A uniform stream begins at the datum itself, found to round-off.
    return lambda z, y: np.where(z < -1e-9 * depth, 0.0, speed(np.clip(z, 0.0, depth)))


def _in_duct(scene: Scene, mean: float, depth: float) -> Profile:
    """The profile between walls: that of a duct of a depth, of which an open channel is the lower half."""
    from .duct import duct_speed

    (low, high), highest = scene.domain.across, scene.domain.ceiling - scene.datum

    def speed(z: np.ndarray, y: np.ndarray) -> np.ndarray:
        across, up = np.clip(y - low, 0.0, high - low), np.clip(z, 0.0, highest)
        return mean * duct_speed(across, up, high - low, depth)

    return speed


def _from_expressions(flow: ExpressionFlow) -> Velocity:
    from ..scene.expression import expressions

    components = expressions(flow.components, "flow.components")
    return lambda x, t: np.vstack([component(x, t) for component in components])

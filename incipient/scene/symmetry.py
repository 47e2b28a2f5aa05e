"""Whether a scene in space is its own mirror image in the vertical plane through the middle of its width.

Of such a scene half is computed: the flow at one side of the plane, through which nothing flows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from ..arrays import Floats
from ..errors import SceneError
from .model import SceneSections

ALIKE = 1e-6  # of the grain's size, or of the bed's relief and the flow's speed: differences below it do not count
SPACING = 0.1  # of points on a grain's surface, in its size
FEW = 200  # points at which a grain is compared first
PLACES = 41  # in each direction, at which bed and flow are looked at
MIRRORED = np.array([1.0, -1.0, 1.0])


def is_halved(scene: SceneSections) -> bool:
    """Whether half of the scene is computed.

    Raises SceneError if the scene is said to be its own mirror image and is not.
    """
    asked = scene.domain.symmetric
    if scene.gdim == 2 or asked is False:
        return False
    why = next(differences(scene), None)
    if why is not None and asked is True:
        raise SceneError(f"domain.symmetric: is true, but {why}; make the scene symmetric, or give false")
    return why is None


def differences(scene: SceneSections) -> Iterator[str]:
    """What keeps a scene in space from being its own mirror image, in words."""
    checks: tuple[Callable[[SceneSections], str], ...] = (
        _of_grain,
        _of_motion,
        _of_bed,
        _of_flow,
        _of_surface,
    )
    yield from (why for check in checks if (why := check(scene)))


def _of_grain(scene: SceneSections) -> str:
    grain, placement, middle = scene.grain, scene.placement, scene.domain.middle
    if grain is None or placement is None:
        return ""
    away = placement.centre[1] - middle
    if abs(away) > ALIKE * grain.size:
        return f"the grain's centroid is {abs(away):.3g} beside the middle, y = {middle:g}"
    points = grain.surface(SPACING * grain.size).points
    for some in (points[:: 1 + len(points) // FEW], points):  # few tell at once that a scanned grain is none
        mirrored = placement.to_scene(some)
        mirrored[:, 1] = 2.0 * middle - mirrored[:, 1]
        off = float(np.abs(grain.level(placement.to_body(mirrored)) - grain.level(some)).max())
        if off > ALIKE * grain.size:
            return f"the grain is {off:.2g} off its mirror image"
    return ""


def _of_motion(scene: SceneSections) -> str:
    """Velocities that a mirror image would have otherwise: across, and spins about x and z."""
    body = scene.body
    if body is None or not body.moves:
        return ""
    from .expression import Expression

    velocity, spin = np.asarray(body.velocity), np.asarray(body.spin)
    if velocity[1] or spin[0] or spin[2]:
        return "the grain's velocity and spin are not those of its mirror image"
    for place in (1, 3, 5) if body.course is not None else ():
        assert body.course is not None and scene.time is not None
        times, formula = np.linspace(0.0, scene.time.end, PLACES), Expression(body.course[place])
        if any(formula(np.zeros((3, 1)), float(t))[0] for t in times):
            return "the grain's course is not that of its mirror image"
    return ""


def _of_bed(scene: SceneSections) -> str:
    bed, domain = scene.bed_shape, scene.domain
    if bed is None or not np.isfinite(bed.feature):
        return ""
    # Places that no period of the bed divides.
    x = np.linspace(domain.left, domain.right, 7 * PLACES + 2)
    y = np.linspace(*domain.across, 5 * PLACES + 1)
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    mirrored = points * [1.0, -1.0] + [0.0, 2.0 * domain.middle]
    heights = bed.height(points)
    off = float(np.abs(heights - bed.height(mirrored)).max())
    if off <= ALIKE * max(float(np.ptp(heights)), 1e-300):
        return ""
    return f"the bed is {off:.2g} off its mirror image in y = {domain.middle:g}"


def _of_flow(scene: SceneSections) -> str:
    """Formulas for the flow; other flows depend on the height alone."""
    if scene.flow.kind != "expression":
        return ""
    from .expression import Expression

    components = [Expression(text) for text in scene.flow.components]
    points, middle = _within(scene), scene.domain.middle
    mirrored = points.copy()
    mirrored[1] = 2.0 * middle - points[1]
    times = np.linspace(0.0, scene.time.end, PLACES) if scene.time else np.zeros(1)
    for t in map(float, times):
        here = np.vstack([one(points, t) for one in components])
        there = np.vstack([one(mirrored, t) for one in components]) * MIRRORED[:, None]
        if np.abs(here - there).max() > ALIKE * max(float(np.abs(here).max()), 1e-300):
            return "the flow is not its mirror image"
    return ""


def _of_surface(scene: SceneSections) -> str:
    """Formulas for the first elevation of a free surface, and for the pressure above it."""
    if scene.surface is None:
        return ""
    from .expression import Expression

    points, middle = _within(scene), scene.domain.middle
    mirrored = points.copy()
    mirrored[1] = 2.0 * middle - points[1]
    times = np.linspace(0.0, scene.time.end, PLACES) if scene.time else np.zeros(1)
    for text in (
        scene.surface.elevation,
        scene.surface.pressure,
        scene.surface.inflow,
        scene.surface.seepage,
    ):
        for t in map(float, times):
            here, there = (Expression(text)(places, t) for places in (points, mirrored))
            if np.abs(here - there).max() > ALIKE * max(float(np.abs(here).max()), 1e-300):
                return "the free surface is not its mirror image"
    return ""


def _within(scene: SceneSections) -> Floats:
    """Points (3, n) in the domain."""
    domain = scene.domain
    sides = ((domain.left, domain.right), domain.across, (domain.bottom, domain.ceiling))
    axes = [np.linspace(low, high, 11) for low, high in sides]
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3).T

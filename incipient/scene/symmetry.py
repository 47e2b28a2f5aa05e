"""Differences of a 3-D scene from its mirror image in the vertical plane at mid-width.

Of a symmetric scene only one half is computed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Floats
from .expression import Expression, expressions, of_time
from .flows import ExpressionFlow

if TYPE_CHECKING:
    from .model import Scene

ALIKE = 1e-6  # of the grain's size, or of a field's range: differences below it do not count
MIRRORED = np.array([1.0, -1.0, 1.0])  # factors on the components of a mirrored field
# Name, values (k, n) at points (n, 3) and a time, factors on those of a mirrored field, points, times.
Field = tuple[str, Callable[[Floats, float], Any], Floats, Floats, list[float]]


def differences(scene: Scene) -> Iterator[str]:
    """Differences of a 3-D scene from its mirror image, as text."""
    middle, placement = scene.domain.middle, scene.placement
    times = np.linspace(0.0, scene.time.end, 41).tolist() if scene.time else [0.0]
    if placement and abs(away := placement.centre[1] - middle) > ALIKE * scene.grain.size:
        yield f"the grain's centroid is {abs(away):.3g} from mid-width, y = {middle:g}"
    if scene.moves and _is_turned_over(scene.body, times):
        yield "the grain's motion is not that of its mirror image"
    for name, values, factors, points, instants in _fields(scene, times):
        mirrored = points * MIRRORED + [0.0, 2.0 * middle, 0.0]
        for time in instants:
            here, there = (np.reshape(values(x, time), (-1, len(x))) for x in (points, mirrored))
            off = float(np.abs(here - factors[:, None] * there).max())
            if off > ALIKE * max(float(np.ptp(here)), 1e-300):
                yield f"the {name} is {off:.2g} off its mirror image in y = {middle:g}"
                break


def _fields(scene: Scene, times: list[float]) -> Iterator[Field]:
    domain, bed, flow = scene.domain, scene.bed_shape, scene.flow
    grain, placement, unchanged = scene.grain, scene.placement, np.ones(1)
    if placement is not None:
        surface = grain.surface(0.1 * grain.size).points
        points = placement.to_scene(np.vstack([np.zeros(3), surface]))
        # Some 200 points suffice to exclude most scanned grains.
        for some in (points[:: 1 + len(points) // 200], points):
            yield "grain", lambda x, t: grain.level(placement.to_body(x)), unchanged, some, [0.0]
    if bed is not None and np.isfinite(bed.feature):
        # Numbers of points that have no common period with bedforms.
        points = np.insert(domain.grid(289, 103), 2, 0.0, axis=1)
        yield "bed", lambda x, t: bed.height(x[:, :2]), unchanged, points, [0.0]
    points = domain.grid(11, 11, 11)
    if isinstance(flow, ExpressionFlow):
        formulas = expressions(flow.components, "flow.components")
        yield "flow", lambda x, t: [one(x.T, t) for one in formulas], MIRRORED, points, times
    if scene.surface is not None:
        formula = Expression(scene.surface.elevation, "surface.elevation")
        yield "free surface", lambda x, t: formula(x.T), unchanged, points, [0.0]


def _is_turned_over(body: Any, times: list[float]) -> bool:
    """Whether a grain leaves the plane at mid-width, or turns about an axis in it."""
    course = of_time(body.course or (), "body.course")
    rows = [np.hstack([body.velocity, body.spin]), *map(course, times)]
    return any(row[1::2].any() for row in rows)

"""Differences of a 3-D scene from its mirror image in the vertical plane at mid-width.

Of a symmetric scene only one half is computed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Floats
from .domain import Domain
from .expression import Expression, expressions, of_time
from .flows import ExpressionFlow

if TYPE_CHECKING:
    from .model import Scene

ALIKE = 1e-6  # of the grain's size, or of the bed's relief and the flow's speed: differences below it do not count
FEW = 200  # points at which a grain is compared first
SPACING = 0.1  # of points on a grain's surface, in its size
PLACES = 41  # points in each direction, and instants, at which beds and formulas are compared
MIRRORED = np.array([1.0, -1.0, 1.0])
UNCHANGED = np.ones(1)


def differences(scene: Scene) -> Iterator[str]:
    """Differences of a 3-D scene from its mirror image, as text."""
    domain, surface = scene.domain, scene.surface
    times = np.linspace(0.0, scene.time.end, PLACES).tolist() if scene.time else [0.0]
    if scene.grain is not None and scene.placement is not None:
        yield from _of_grain(scene.grain, scene.placement, domain.middle)
    if scene.moves:
        yield from _of_motion(scene.body, times)
    if scene.bed_shape is not None and np.isfinite(scene.bed_shape.feature):
        yield from _of_bed(scene.bed_shape, domain)
    fields = []
    if isinstance(scene.flow, ExpressionFlow):
        components = expressions(scene.flow.components, "flow.components")
        fields.append(("flow", components, MIRRORED))
    for key in ("elevation", "pressure") if surface is not None else ():
        formula = Expression(getattr(surface, key), f"surface.{key}")
        fields.append(("free surface", [formula], UNCHANGED))
    for name, formulas, mirror in fields:
        if any(_differ(formulas, mirror, domain, time) for time in times):
            yield f"the {name} is not its mirror image"


def _of_grain(grain: Any, placement: Any, middle: float) -> Iterator[str]:
    away = placement.centre[1] - middle
    if abs(away) > ALIKE * grain.size:
        yield f"the grain's centroid is {abs(away):.3g} from mid-width, y = {middle:g}"
        return
    points = grain.surface(SPACING * grain.size).points
    # A few points suffice to exclude most scanned grains.
    for some in (points[:: 1 + len(points) // FEW], points):
        mirrored = placement.to_scene(some) * MIRRORED + [0.0, 2.0 * middle, 0.0]
        off = float(np.abs(grain.level(placement.to_body(mirrored)) - grain.level(some)).max())
        if off > ALIKE * grain.size:
            yield f"the grain is {off:.2g} off its mirror image"
            return


def _of_motion(body: Any, times: list[float]) -> Iterator[str]:
    if body.velocity[1] or body.spin[0] or body.spin[2]:
        yield "the grain's velocity and spin are not those of its mirror image"
    course = of_time(body.course or (), "body.course")
    if any(course(time)[1::2].any() for time in times):
        yield "the grain's course is not that of its mirror image"


def _of_bed(bed: Any, domain: Domain) -> Iterator[str]:
    # Numbers of points without a common period with the bed.
    along, across = 7 * PLACES + 2, 5 * PLACES + 1
    heights = bed.height(domain.grid(along, across)).reshape(along, across)
    off = float(np.abs(heights - heights[:, ::-1]).max())
    if off > ALIKE * max(float(np.ptp(heights)), 1e-300):
        yield f"the bed is {off:.2g} off its mirror image in y = {domain.middle:g}"


def _differ(formulas: Sequence[Expression], mirror: Floats, domain: Domain, time: float) -> bool:
    points = domain.grid(11, 11, 11).T
    here = np.array([formula(points, time) for formula in formulas]).reshape(-1, 11, 11, 11)
    there = mirror[:, None, None, None] * here[:, :, ::-1]
    return bool(np.abs(here - there).max() > ALIKE * max(float(np.abs(here).max()), 1e-300))

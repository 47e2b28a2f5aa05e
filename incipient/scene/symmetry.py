"""Differences of a 3-D scene from its mirror image in the vertical plane at mid-width.

Of a symmetric scene only one half is computed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .expression import Expression, expressions, of_time
from .flows import ExpressionFlow

if TYPE_CHECKING:
    from .model import Scene

ALIKE = 1e-6  # of the grain's size, or of a field's range: differences below it do not count
FEW = 200  # points at which a grain is compared first
SPACING = 0.1  # of points on a grain's surface, in its size
INSTANTS = 41  # at which formulas are compared
HERE = (11, 11, 11)  # points along each axis at which formulas are compared
OF_BED = (289, 206)  # the same of beds: numbers without a common period with them
MIRRORED, UNCHANGED = (1.0, -1.0, 1.0), (1.0,)  # factors on the components of a mirrored field


def differences(scene: Scene) -> Iterator[str]:
    """Differences of a 3-D scene from its mirror image, as text."""
    domain, bed, flow = scene.domain, scene.bed_shape, scene.flow
    times = np.linspace(0.0, scene.time.end, INSTANTS).tolist() if scene.time else [0.0]
    if scene.placement is not None:
        yield from _of_grain(scene.grain, scene.placement, domain.middle)
    if scene.moves:
        yield from _of_motion(scene.body, times)
    fields: list[tuple[str, Sequence[Any], tuple[float, ...], tuple[int, ...], list[float]]] = []
    if bed is not None and np.isfinite(bed.feature):
        fields.append(("bed", [lambda x, t: bed.height(x.T)], UNCHANGED, OF_BED, [0.0]))
    if isinstance(flow, ExpressionFlow):
        components = expressions(flow.components, "flow.components")
        fields.append(("flow", components, MIRRORED, HERE, times))
    if scene.surface is not None:
        formula = Expression(scene.surface.elevation, "surface.elevation")
        fields.append(("free surface", [formula], UNCHANGED, HERE, [0.0]))
    for name, parts, factors, counts, instants in fields:
        points = domain.grid(*counts).T
        for time in instants:
            here = np.stack([np.reshape(part(points, time), counts) for part in parts])
            there = np.reshape(factors, (-1, *[1] * len(counts))) * here[:, :, ::-1]
            off = float(np.abs(here - there).max())
            if off > ALIKE * max(float(np.ptp(here)), 1e-300):
                yield f"the {name} is {off:.2g} off its mirror image in y = {domain.middle:g}"
                break


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

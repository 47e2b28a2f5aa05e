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
from .surface import Surface

if TYPE_CHECKING:
    from .model import Scene, Time

ALIKE = 1e-6  # of the grain's size, or of the bed's relief and the flow's speed: differences below it do not count
SPACING = 0.1  # of points on a grain's surface, in its size
FEW = 200  # points at which a grain is compared first
PLACES = 41  # points in each direction at which bed and flow are compared
MIRRORED = np.array([1.0, -1.0, 1.0])
UNCHANGED = np.ones(1)


def differences(scene: Scene) -> Iterator[str]:
    """Differences of a 3-D scene from its mirror image, as text."""
    domain, time, surface = scene.domain, scene.time, scene.surface
    if scene.grain is not None and scene.placement is not None:
        yield from _of_grain(scene.grain, scene.placement, domain.middle)
    if scene.moves:
        yield from _of_motion(scene.body, _times(time))
    if scene.bed_shape is not None and np.isfinite(scene.bed_shape.feature):
        yield from _of_bed(scene.bed_shape, domain)
    if isinstance(scene.flow, ExpressionFlow):
        formulas = expressions(scene.flow.components, "flow.components")
        if _differ(formulas, domain, time, MIRRORED):
            yield "the flow is not its mirror image"
    if surface is not None and any(
        _differ([formula], domain, time) for formula in _formulas(surface)
    ):
        yield "the free surface is not its mirror image"


def _of_grain(grain: Any, placement: Any, middle: float) -> Iterator[str]:
    away = placement.centre[1] - middle
    if abs(away) > ALIKE * grain.size:
        yield f"the grain's centroid is {abs(away):.3g} from mid-width, y = {middle:g}"
        return
    points = grain.surface(SPACING * grain.size).points
    for some in (
        points[:: 1 + len(points) // FEW],
        points,
    ):  # a few points suffice to exclude most scanned grains
        mirrored = placement.to_scene(some)
        mirrored[:, 1] = 2.0 * middle - mirrored[:, 1]
        off = float(np.abs(grain.level(placement.to_body(mirrored)) - grain.level(some)).max())
        if off > ALIKE * grain.size:
            yield f"the grain is {off:.2g} off its mirror image"
            return


def _of_motion(body: Any, times: list[float]) -> Iterator[str]:
    velocity, spin = np.asarray(body.velocity), np.asarray(body.spin)
    if velocity[1] or spin[0] or spin[2]:
        yield "the grain's velocity and spin are not those of its mirror image"
    course = None if body.course is None else of_time(body.course, "body.course")
    if course is not None and any(course(t)[1::2].any() for t in times):
        yield "the grain's course is not that of its mirror image"


def _of_bed(bed: Any, domain: Domain) -> Iterator[str]:
    along, across = (
        7 * PLACES + 2,
        5 * PLACES + 1,
    )  # numbers of points without a common period with the bed
    heights = bed.height(domain.grid(along, across)).reshape(along, across)
    off = float(np.abs(heights - heights[:, ::-1]).max())
    if off > ALIKE * max(float(np.ptp(heights)), 1e-300):
        yield f"the bed is {off:.2g} off its mirror image in y = {domain.middle:g}"


def _differ(
    formulas: Sequence[Expression], domain: Domain, time: Time | None, mirror: Floats = UNCHANGED
) -> bool:
    points = domain.grid(11, 11, 11).T
    for t in _times(time):
        here = np.array([formula(points, t) for formula in formulas]).reshape(-1, 11, 11, 11)
        there = mirror[:, None, None, None] * here[:, :, ::-1]
        if np.abs(here - there).max() > ALIKE * max(float(np.abs(here).max()), 1e-300):
            return True
    return False


def _formulas(surface: Surface) -> list[Expression]:
    names = ("elevation", "pressure")
    return [Expression(getattr(surface, name), f"surface.{name}") for name in names]


def _times(time: Time | None) -> list[float]:
    return np.linspace(0.0, time.end, PLACES).tolist() if time else [0.0]

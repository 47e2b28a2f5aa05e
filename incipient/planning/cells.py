"""Cell sizes of a scene, in 2-D and 3-D, for mesh_size = 1; `wall_cells` has those along walls of a mean flow."""

import math
from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np

from ..arrays import Floats, Point
from ..geometry.placement import Placement
from ..geometry.plane.closing import Closing
from ..geometry.plane.curves import Curve
from ..geometry.space.grains import Box
from ..meshes import Away, Near, Resolved, Sizes
from ..setup.geometry import Stance, point
from ..setup.setup import Setup, speed_past_grain
from .discretisation import by_order, far_cell

# Cell sizes by dimension and order of the velocity, chosen so that the orders err alike
# (docs/contribute/defaults.md).
GRAIN_CELL = {2: by_order(0.05, 0.1, 0.15), 3: by_order(0.15, 0.22, 0.3)}  # of the grain
BED_CELL = {2: by_order(0.15, 0.25, 0.35), 3: by_order(0.35, 0.5, 0.7)}  # of the bed's feature
# Of the gap between grain and bed, in 3-D also of narrow passages.
GAP_CELL = {2: by_order(0.5, 0.75, 1.0), 3: by_order(0.8, 1.5, 1.8)}
# Along the bed below a base flow that bends next to it, in thicknesses of that layer.
PROFILE_CELL = by_order(0.5, 1.0, 1.5)
CORNER_CELL, EDGE_CELL = 0.3, 0.5  # of the grain's cells, at corners in 2-D, at sharp edges in 3-D
GROWTH, GAP_GROWTH = {2: 0.25, 3: 0.3}, {2: 0.18, 3: 0.22}  # of cell sizes with distance
# Along a bed away from the grain: how fast cells grow with the distance from it, and up to which part of the bed's
# smallest feature. There only the drag of the bed as a whole matters; larger cells do not follow its surface.
BED_GROWTH, BED_LARGEST = {2: 0.05, 3: 0.15}, 0.6
# The boundary layer of a held 3-D grain thins as Re^-1/2: from this Reynolds number on cells at it do, to this part.
LAYERED, THINNEST = 50.0, 0.2
# Cells behind a held grain with such a layer, how far from its centre, and how far in time, over the grain's size.
WAKE_CELL, WAKE, WAKE_IN_TIME = 0.25, 3.0, 6.0
TOP_CELL = 0.1  # of the largest cells, at the ends of a sliding top
# At an inflow given by formulas: which part of the discharge a cell's interpolation may miss, of a reattachment length
# behind a step at Re 800 eight times as much; the least cell over the usual one; parts of a cell; instants.
MISSED, FINEST, UNEVEN, INFLOW_SAMPLES = 1e-4, 1e-3, 0.382, 9


def sizes(
    setup: Setup, order: int, stance: Stance, outline: tuple[Curve, ...], closing: Closing | None
) -> Sizes:
    """Cell sizes around a grain with an `outline` in 2-D."""
    scene, gdim, far = setup.scene, setup.scene.gdim, far_cell(setup.scene, order)
    near = [
        *_along_grain(setup, order, outline, stance, closing),
        *_along_bed(setup, order, stance.placement),
        *_in_profile(setup, order, stance.placement),
    ]
    if thinner(setup) < 1.0 or (gdim == 3 and setup.is_averaged and setup.walls.is_resolved):
        near += _in_wake(setup)
    if gdim == 3:
        return Sizes(far, tuple(near), gap_part=GAP_CELL[3][order])
    if scene.flow.by_formulas:
        near += _at_inflow(setup, order)
    if scene.flow.moves_top:
        ends = tuple((x, scene.domain.ceiling) for x in (scene.domain.left, scene.domain.right))
        near.append(Near(TOP_CELL * far, GROWTH[2], points=ends))
    return Sizes(far, tuple(near))


def _along_grain(
    setup: Setup, order: int, outline: tuple[Curve, ...], stance: Stance, closing: Closing | None
) -> Iterator[Near]:
    grain, gdim = setup.scene.grain, setup.scene.gdim
    if grain is None:
        return
    size = thinner(setup) * GRAIN_CELL[gdim][order] * grain.size
    edged = isinstance(grain, Box) and grain.edge_radius == 0.0
    yield Near(EDGE_CELL * size if edged else size, GROWTH[gdim], boundary="body")
    if sharp := corners(outline, outline[1:] + outline[:1]):
        yield Near(CORNER_CELL * size, GROWTH[gdim], points=sharp)
    if closing is not None:
        points = tuple(
            end for line in (closing.left, closing.right) for end in (line.start, line.end)
        )
    elif stance.gap < 4.0 * size and stance.gap_ends is not None and stance.placement is not None:
        points = setup.geometry.gap_points(stance.gap_ends, stance.placement)
    else:
        return
    width = GAP_CELL[gdim][order] * stance.gap
    yield Near(width, GAP_GROWTH[gdim], points=points, needed=True)


def meshed_bed(setup: Setup, placement: Placement | None) -> Resolved | None:
    """The region about a held grain in which 3-D bedforms are meshed; None: everywhere."""
    if setup.scene.gdim == 2 or setup.scene.moves:
        return None
    return setup.geometry.resolved_bed(placement, setup.base_flow.datum)


def _along_bed(setup: Setup, order: int, placement: Placement | None) -> Iterator[Near]:
    scene, bed, gdim = setup.scene, setup.scene.bed_shape, setup.scene.gdim
    if bed is None or not math.isfinite(bed.feature):
        return
    largest, most, level, away = BED_LARGEST * bed.feature, math.inf, math.inf, None
    if gdim == 3:
        most, meshed = largest, meshed_bed(setup, placement)
        level = math.inf if meshed is None else meshed.radius + meshed.passage
    # With wall layers in 2-D the drag of the forms makes the flow, and they are meshed alike all along.
    if placement is not None and (gdim == 3 or not scene.is_averaged):
        away = Away(point(placement.centre), BED_GROWTH[gdim], largest, level)
    size = min(BED_CELL[gdim][order] * bed.feature, largest)
    yield Near(size, GROWTH[gdim], boundary="bed", away=away, most=most)


def _in_profile(setup: Setup, order: int, placement: Placement | None) -> Iterator[Near]:
    """Cells in the layer of an oscillating flow, in 2-D also of a mean profile."""
    layer, gdim, away = setup.base_flow.layer, setup.scene.gdim, None
    if math.isinf(layer) or (gdim == 3 and not setup.scene.flow.oscillates):
        return
    if gdim == 3 and placement is not None:
        away = Away(point(placement.centre), BED_GROWTH[3], far_cell(setup.scene, order))
    size = PROFILE_CELL[order] * layer
    yield Near(size, GROWTH[gdim], boundary=setup.sides.bottom, away=away)


def thinner(setup: Setup) -> float:
    """Factor by which the boundary layer of a held 3-D grain reduces the cells at it."""
    scene, base_flow = setup.scene, setup.base_flow
    unlayered = scene.gdim == 2 or scene.grain is None or scene.moves
    if unlayered or base_flow.creeping or setup.is_averaged:
        return 1.0
    reynolds = speed_past_grain(setup) * scene.grain.size / setup.scene.viscosity
    return float(np.clip((LAYERED / max(reynolds, LAYERED)) ** 0.5, THINNEST, 1.0))


def _in_wake(setup: Setup) -> Iterator[Near]:
    scene, grain, placement = setup.scene, setup.scene.grain, setup.scene.placement
    if grain is None or placement is None:
        return
    centre = np.array(placement.centre)
    velocity = setup.base_flow.velocity(centre[:, None], 0.0)[:, 0]
    speed = float(np.linalg.norm(velocity))
    if speed == 0.0:
        return
    steps = np.arange(0.5, WAKE if scene.time is None else WAKE_IN_TIME, 0.5 * WAKE_CELL)
    if scene.flow.oscillates:
        steps = np.concatenate([-steps, steps])
    points = centre + grain.size * steps[:, None] * velocity / speed
    yield Near(WAKE_CELL * grain.size, GROWTH[3], points=tuple(map(point, points)))


def _at_inflow(setup: Setup, order: int) -> Iterator[Near]:
    """Cells that resolve an inflow given by formulas, bisected until their interpolation misses little discharge."""
    domain, scene = setup.scene.domain, setup.scene
    low, high = setup.ceiling - setup.base_flow.depth, setup.ceiling
    times = np.linspace(0.0, scene.time.end, INFLOW_SAMPLES) if scene.time is not None else [0.0]

    def velocities(heights: Floats) -> Floats:
        points = setup.base_flow.column((domain.left, low), heights)
        return np.array([setup.base_flow.entering(points, float(t)) for t in times])

    size = far_cell(scene, order)
    nodes, places = np.linspace(0.0, 1.0, order + 1), (np.arange(50) + 0.5) / 50
    shapes = np.linalg.solve(np.vander(nodes).T, np.vander(places, order + 1).T)
    whole = np.abs(velocities(low + (high - low) * places)).mean(axis=2).max() * (high - low)
    waiting = list(pairwise(np.linspace(low, high, max(2, math.ceil((high - low) / size)) + 1)))
    while waiting:
        start, end = waiting.pop()
        length = end - start
        missed = velocities(start + length * places) - velocities(start + length * nodes) @ shapes
        if length < size:
            yield Near(length, GROWTH[2], points=((domain.left, 0.5 * (start + end)),))
        if np.abs(missed).mean(axis=2).max() * length > MISSED * whole and length > FINEST * size:
            # Not in halves, at whose ends a kink would hide.
            middle = start + UNEVEN * length
            waiting += [(start, middle), (middle, end)]


def corners(curves: Iterable[Curve], following: Iterable[Curve]) -> tuple[Point, ...]:
    """Corners of more than ten degrees between successive curves."""
    cosine = np.cos(np.radians(10.0))
    return tuple(
        after.start
        for before, after in zip(curves, following, strict=False)
        if before.tangent([1.0])[0] @ after.tangent([0.0])[0] < cosine
    )

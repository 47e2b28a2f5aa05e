"""Cell sizes of a scene, in 2-D and 3-D, for mesh_size = 1, with those along the walls of a mean flow."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from itertools import pairwise, takewhile
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats, Point, point
from ..geometry.placement import Placement
from ..geometry.plane.curves import Curve
from ..geometry.space.grains import Box
from ..meshes import LAYERS_SHARE, Away, Grid, Near, Sizes, WallLayers, graded_ends
from ..scene import Scene
from ..setup.geometry import Stance
from ..setup.setup import Setup
from .discretisation import FEWEST, by_order, far_cell, velocity_order

if TYPE_CHECKING:
    from ..turbulence.walls import Walls

# Cell sizes by dimension and order of the velocity, chosen so that the orders err alike
# (docs/contribute/defaults.md).
GRAIN_CELL = {2: by_order(0.05, 0.1), 3: by_order(0.15, 0.22, 0.3)}  # of the grain
BED_CELL = {2: by_order(0.15, 0.25), 3: by_order(0.35, 0.5, 0.6)}  # of the bed's feature
# Of the gap between grain and bed, in 3-D also of narrow passages.
GAP_CELL = {2: by_order(0.5, 0.75), 3: by_order(0.8, 1.5, 1.8)}
GROWTH, GAP_GROWTH = {2: 0.25, 3: 0.3}, {2: 0.18, 3: 0.22}  # of cell sizes with distance
# Along a bed away from the grain: how fast cells grow with the distance from it, and up to which part of the bed's
# smallest feature. There only the drag of the bed as a whole matters; larger cells do not follow its surface.
BED_GROWTH, BED_LARGEST = {2: 0.05, 3: 0.15}, 0.6

# Rows of a channel: their growth with the distance from the wall, and the largest over the depth; columns over the
# depth; the fewest of both.
ROW_GROWTH, LARGEST_ROW, COLUMN = 0.3, 0.08, 0.5
FEWEST_ROWS, FEWEST_COLUMNS = 6, 8
# Cells at other walls, over their distance: in the logarithmic layer, and the first layer in the viscous sublayer.
WALL_CELL, FIRST_LAYER = 4.0, 2.2
# Factor on cells at walls by order: sizes in the logarithmic layer are for order three, in the sublayer for order two.
COARSENING = {"logarithmic": by_order(0.75, 1.0, 1.0), "resolved": by_order(1.0, 1.3, 1.3)}
# First rows and layers at rough walls, over the distance of a smooth wall with the same flow: with 0.5 the velocity
# over u* k_s/nu = 27 is within 0.1% of the developed flow, with 2.2 it was 8% off.
ON_ROUGH = 0.5
LAYER_GROWTH = {2: 1.35, 3: 2.0}
# Cells along walls with such layers: over the depth, a grain's size, and the length over which a bed would rise by its
# relief at its steepest slope (tests/end_to_end/test_resolved_channels.py).
ALONG = 0.1


def sizes(setup: Setup, order: int, stance: Stance, outline: tuple[Curve, ...]) -> Sizes:
    """Cell sizes around a grain with an `outline` in 2-D."""
    scene, far, placement = setup.scene, far_cell(setup.scene, order), stance.placement
    near = [
        *_along_grain(setup, order, outline, stance),
        *_along_bed(setup, order, placement),
        *_in_profile(setup, order, placement),
        *_in_wake(setup),
        *_at_top_and_inflow(setup, far),
    ]
    gap_part, layers = GAP_CELL[3][order] if scene.gdim == 3 else math.inf, None
    if scene.is_averaged:
        around, layered = placement if scene.moves else scene.placement, setup.walls.is_resolved
        planar = layered and scene.gdim == 3
        near += _along_plane_layers(setup, around) if planar else _along_walls(setup, order, around)
        sizes_along = [math.inf] if scene.gdim == 2 else [x.size for x in near if x.boundary]
        layers = wall_layers(setup, order, min(sizes_along)) if layered else None
    return Sizes(far, tuple(near), gap_part=gap_part, layers=layers)


def _along_grain(
    setup: Setup, order: int, outline: tuple[Curve, ...], stance: Stance
) -> Iterator[Near]:
    grain, gdim = setup.scene.grain, setup.scene.gdim
    if grain is None:
        return
    size = thinner(setup) * GRAIN_CELL[gdim][order] * grain.size
    edged = isinstance(grain, Box) and grain.sharp
    # Half as large at sharp edges in 3-D, less at corners in 2-D.
    yield Near(0.5 * size if edged else size, GROWTH[gdim], boundary="body")
    if sharp := corners(outline, outline[1:] + outline[:1]):
        yield Near(0.3 * size, GROWTH[gdim], points=sharp)
    if stance.closing or stance.gap < 4.0 * size:
        width, points = GAP_CELL[gdim][order] * stance.gap, setup.gap_points(stance)
        yield Near(width, GAP_GROWTH[gdim], points=points, needed=True)


def _along_bed(setup: Setup, order: int, placement: Placement | None) -> Iterator[Near]:
    scene, bed, gdim = setup.scene, setup.scene.bed_shape, setup.scene.gdim
    if math.isinf(bed.feature):
        return
    largest, resolved = BED_LARGEST * bed.feature, setup.resolved_bed(placement)
    level = resolved.radius + resolved.passage if resolved else math.inf
    # With wall layers in 2-D the drag of the forms makes the flow, and they are meshed alike all along.
    near = None if gdim == 2 and scene.is_averaged else placement
    away = _away_from(near, BED_GROWTH[gdim], largest, level)
    size, most = BED_CELL[gdim][order] * bed.feature, math.inf if gdim == 2 else largest
    yield Near(size, GROWTH[gdim], boundary="bed", away=away, most=most)


def _away_from(
    placement: Placement | None, growth: float, largest: float, level: float = math.inf
) -> Away | None:
    """Growth of the cells along a boundary with the distance from a grain, if there is one."""
    return None if placement is None else Away(point(placement.centre), growth, largest, level)


def _in_profile(setup: Setup, order: int, placement: Placement | None) -> Iterator[Near]:
    """Cells in the layer of an oscillating flow, in 2-D also of a mean profile."""
    layer, gdim = setup.base_flow.layer, setup.scene.gdim
    if math.isinf(layer) or (gdim == 3 and not setup.scene.flow.oscillates):
        return
    near = None if gdim == 2 else placement
    away = _away_from(near, BED_GROWTH[3], far_cell(setup.scene, order))
    size = by_order(0.5, 1.0)[order] * layer
    yield Near(size, GROWTH[gdim], boundary=setup.sides.bottom, away=away)


def thinner(setup: Setup) -> float:
    """Factor by which the boundary layer of a held 3-D grain reduces the cells at it."""
    scene = setup.scene
    unlayered = scene.gdim == 2 or scene.grain is None or scene.moves
    if unlayered or setup.base_flow.creeping or scene.is_averaged:
        return 1.0
    # The layer thins as Re^-1/2; from Re = 50 on the cells do.
    reynolds = max(setup.numbers.grain_reynolds or 0.0, 50.0)
    return float(np.clip((50.0 / reynolds) ** 0.5, 0.2, 1.0))


def _in_wake(setup: Setup) -> Iterator[Near]:
    """Cells behind a held 3-D grain with a thin boundary layer."""
    scene, grain, placement = setup.scene, setup.scene.grain, setup.scene.placement
    layered = scene.gdim == 3 and scene.is_averaged and setup.walls.is_resolved
    if grain is None or placement is None or not (layered or thinner(setup) < 1.0):
        return
    centre = np.array(placement.centre)
    velocity = setup.base_flow.velocity(centre[:, None], 0.0)[:, 0]
    if speed := float(np.linalg.norm(velocity)):
        # Cells of a quarter of its size, up to three sizes from its centre, in unsteady flow six.
        behind = np.arange(0.5, 3.0 if scene.time is None else 6.0, 0.125)
        steps = np.concatenate([-behind, behind]) if scene.flow.oscillates else behind
        points = centre + grain.size * steps[:, None] * velocity / speed
        yield Near(0.25 * grain.size, GROWTH[3], points=tuple(map(point, points)))


def _at_top_and_inflow(setup: Setup, far: float) -> Iterator[Near]:
    """Cells at the ends of a sliding top, and at kinks of an inflow given by formulas, in 2-D."""
    scene, domain = setup.scene, setup.scene.domain
    if scene.gdim == 2 and scene.flow.moves_top:
        ends = tuple((x, domain.ceiling) for x in (domain.left, domain.right))
        yield Near(0.1 * far, GROWTH[2], points=ends)
    if scene.gdim == 3 or not scene.flow.by_formulas:
        return
    low, high = setup.ceiling - setup.base_flow.depth, setup.ceiling
    times = np.linspace(0.0, 0.0 if scene.time is None else scene.time.end, 9)
    heights = np.linspace(low, high, 1001)
    points = setup.base_flow.column((domain.left, low), heights)
    velocities = np.array([setup.base_flow.entering(points, float(t)) for t in times])
    bends = np.abs(np.diff(velocities, 3, axis=-1)).max(axis=(0, 1))
    # Next to a kink the third difference of the velocity is not small.
    kinks = heights[1:-2][bends > 1e-4 * np.abs(velocities).max()]
    if len(kinks):
        # Discharge missed at a kink from 0 to 12 U/h: 2e-6.
        at_kinks = tuple((domain.left, y) for y in kinks.tolist())
        yield Near(0.02 * far, GROWTH[2], points=at_kinks)


def corners(curves: Iterable[Curve], following: Iterable[Curve]) -> tuple[Point, ...]:
    """Corners of more than ten degrees between successive curves."""
    cosine = np.cos(np.radians(10.0))
    return tuple(
        after.start
        for before, after in zip(curves, following, strict=False)
        if before.tangent([1.0])[0] @ after.tangent([0.0])[0] < cosine
    )


# -- walls of a mean flow ---------------------------------------------------------------------------


def coarsening(walls: Walls, order: int) -> float:
    """Factor on cells at walls for an order."""
    return COARSENING["resolved" if walls.is_resolved else "logarithmic"][order]


def wall_cell(walls: Walls, order: int) -> float:
    """Size of cells at walls in the logarithmic layer."""
    return WALL_CELL * coarsening(walls, order) * walls.nearest


def channel_grid(setup: Setup, order: int, mesh_size: float) -> Grid:
    """The mesh between plane walls: rows that grow with the distance from them; extruded in 3-D."""
    walls, domain, gdim = setup.walls, setup.scene.domain, setup.scene.gdim
    coarse = mesh_size * coarsening(walls, order)
    column, across = COLUMN * walls.depth * coarse, [setup.half] if gdim == 3 else []
    heights = domain.bottom + walls.nearest, walls.ceiling
    counts = [max(FEWEST_COLUMNS, round(domain.length / column))]
    counts += [max(2, round((high - low) / (2.0 * column))) for low, high in across]
    columns = (graded_ends(count, 1.0) for count in counts)
    return Grid(
        ((domain.left, domain.right), *across, heights),
        (*columns, tuple(map(float, _row_ends(walls, coarse)))),
        setup.sides.of_grid,
        setup.symmetric,
        parallel=gdim == 3,
    )


def _rows(walls: Walls, coarse: float) -> tuple[float, float, float, float]:
    """First and largest row, and the number of rows to where they stop growing and in all, for cells of size 1."""
    largest = LARGEST_ROW * walls.depth
    bed = walls.names[0]
    # The first row is 4/3 of the distance of the wall high. On coarse meshes it is at most 3.5: where it was 6.5 or 10
    # (mesh_size 3 or 4) k in the viscous sublayer grew in each iteration, and the flow did not converge.
    highest = 3.5 * ROW_GROWTH / math.expm1(ROW_GROWTH * coarse)
    over = min(ON_ROUGH if walls.is_rough(bed) else 4.0 / 3.0, highest)
    first = min(over * walls.from_origin(bed), largest)
    part = walls.depth - walls.nearest
    bend = min((largest - first) / ROW_GROWTH, part)
    to_bend = math.log1p(ROW_GROWTH * bend / first) / ROW_GROWTH
    return first, largest, to_bend, to_bend + (part - bend) / largest


def _row_ends(walls: Walls, coarse: float) -> Floats:
    """Ends of the rows as fractions of the height."""
    first, largest, to_bend, whole = _rows(walls, coarse)
    number = max(math.ceil(whole / coarse), FEWEST_ROWS // walls.number)
    counted = whole * np.arange(1, number + 1) / number
    near = first * np.expm1(ROW_GROWTH * np.minimum(counted, to_bend)) / ROW_GROWTH
    ends = (near + largest * np.maximum(counted - to_bend, 0.0)) / (walls.depth - walls.nearest)
    ends[-1] = 1.0
    if walls.number == 1:
        return ends
    return 0.5 * np.concatenate([ends, 2.0 - ends[-2::-1], [2.0]])


def coarsest(setup: Setup) -> float:
    """Largest numerics.mesh_size at which all cells still grow; inf except in an empty box and between planes."""
    scene, order = setup.scene, velocity_order(setup)[0]
    if scene.is_empty_box:
        return min(scene.domain.sizes.values()) / (FEWEST[scene.gdim] * far_cell(scene, order))
    if not scene.is_averaged or not setup.walls.plane:
        return math.inf
    walls = setup.walls
    rows = _rows(walls, 1.0)[-1] / (FEWEST_ROWS // walls.number)
    columns = scene.domain.length / (COLUMN * walls.depth * FEWEST_COLUMNS)
    if walls.asked.inflow == "developed":  # the flow does not change along them
        columns = math.inf
    return min(rows, columns) / coarsening(walls, order)


def ratio_of_rows(setup: Setup, coarser: float) -> float:
    """Factor to cells `coarser` times as large; between planes the ratio of their rows, at most that."""
    if not setup.scene.is_averaged or not setup.walls.plane:
        return coarser
    walls = setup.walls
    size = setup.scene.numerics.mesh_size * coarsening(walls, velocity_order(setup)[0])
    fine, coarse = (len(_row_ends(walls, size * factor)) for factor in (1.0, coarser))
    return min(fine / coarse, coarser)


def _along_walls(setup: Setup, order: int, placement: Placement | None) -> Iterator[Near]:
    """Cells along walls some of which are not planar, in 3-D with wall functions, and at corners of a 2-D bed."""
    walls, scene, bed = setup.walls, setup.scene, setup.scene.bed_shape
    if walls.is_resolved:
        largest = beyond = ALONG * walls.depth
        along = ALONG * rise(scene) if placement is None else ALONG * scene.grain.size
        # At corners where layers meet.
        size, growth, at_corner = min(largest, along), GROWTH[3], 27.0 * walls.smooth
    else:
        size = beyond = wall_cell(walls, order)
        # Away from a grain the flow next to the bed is that of a channel, for which its rows do; at corners that
        # protrude cells are small.
        largest, growth, at_corner = max(size, LARGEST_ROW * walls.depth), GROWTH[2], 0.05 * size
    away = _away_from(placement, BED_GROWTH[2], largest)
    for name in walls.names:
        yield Near(size, growth, boundary=name, away=None if name == "body" else away)
    if scene.gdim == 3:
        return
    curves = bed.curves(scene.domain.left, scene.domain.right)
    leaving = dict(_separating(curves))
    if sharp := corners(curves[:-1], curves[1:]) if walls.is_resolved else tuple(leaving):
        yield Near(at_corner, GROWTH[2], points=sharp)
    for (x, y), drop in leaving.items():
        if drop > beyond:  # a shear layer, which reaches the bed within some six heights
            shares = np.linspace(0.0, 1.0, 25).tolist()
            points = tuple((x + 6.0 * drop * s, y - drop * s) for s in shares)
            yield Near(0.09 * drop, 0.15, points=points)


def _along_plane_layers(setup: Setup, placement: Placement | None) -> Iterator[Near]:
    """Cells along the planes among resolved walls in 3-D."""
    walls, bed, largest = setup.walls, setup.scene.bed_shape, LARGEST_ROW * setup.walls.depth
    if placement is not None and math.isinf(bed.feature):
        size = min(0.2 * setup.scene.grain.size, largest)  # on a level bed next to the grain
        away = _away_from(placement, BED_GROWTH[3], largest)
        yield Near(size, GROWTH[3], boundary=walls.names[0], away=away)
    if setup.sides.top in walls.names:
        yield Near(largest, GROWTH[3], boundary=setup.sides.top)


def rise(scene: Scene) -> float:
    """Length over which a 2-D bed without corners would rise by its relief at its steepest slope."""
    bed, domain = scene.bed_shape, scene.domain
    if math.isinf(bed.feature) or len(bed.corners(domain.left, domain.right)):
        return math.inf
    x = np.linspace(domain.left, domain.right, 4001)
    heights = bed.height(x)
    return float(np.ptp(heights) / np.abs(np.gradient(heights, x)).max())


def wall_layers(setup: Setup, order: int, along: float) -> WallLayers:
    """Layers at resolved walls some of which are not planar, with cells of a size along them in 3-D."""
    walls, gdim = setup.walls, setup.scene.gdim
    coarse = coarsening(walls, order)
    over = {name: ON_ROUGH if walls.is_rough(name) else FIRST_LAYER for name in walls.names}
    first = {
        name: min(size * coarse * walls.from_origin(name), along) for name, size in over.items()
    }
    if "body" in first:
        first["body"] *= 0.5  # u* on its crest is twice that of the bed
    # Up to 2.5 nu/u* omega is that of the viscous sublayer (Wilcox 1988, AIAA J. 26, 1299); with 3.6 k grew in each
    # iteration.
    thickest = 2.5 * walls.unit / (FIRST_LAYER * coarse * walls.smooth)
    growth, number = LAYER_GROWTH[gdim], 80
    if gdim == 3:
        most = LAYERS_SHARE * along / min(first.values())
        number = max(math.ceil(math.log(1.0 + (growth - 1.0) * most) / math.log(growth)), 1)
    return WallLayers(first, number, growth, graded=gdim == 2, most=thickest)


def _separating(bed: tuple[Curve, ...]) -> Iterator[tuple[Point, float]]:
    """Corners that protrude into the flow, which separates there, and the drop of the bed behind each."""
    for before, after in pairwise(range(len(bed))):
        ahead, behind = bed[before].tangent([1.0])[0], bed[after].tangent([0.0])[0]
        if ahead[0] * behind[1] - ahead[1] * behind[0] < -0.17:  # sine of the turn, ten degrees
            falling = takewhile(lambda curve: curve.end[1] <= curve.start[1], bed[after:])
            lowest = min([curve.end[1] for curve in falling], default=bed[after].start[1])
            yield bed[after].start, bed[after].start[1] - lowest

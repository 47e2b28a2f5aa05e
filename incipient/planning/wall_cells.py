"""Cells at the walls of a mean flow: rows of a channel, layers in the viscous sublayer, sizes along walls."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..geometry.placement import Placement
from ..meshes import LAYERS_SHARE, Away, Grid, Near, WallLayers, graded_ends
from ..scene import Scene
from ..setup.geometry import point
from ..setup.setup import Setup
from .cells import corners, layer_ends, lee, separating
from .discretisation import velocity_order

if TYPE_CHECKING:
    from ..turbulence.walls import Walls

# Rows of a channel: the first over the distance of the wall; growth with the distance from it; the largest over the
# depth, along the channel as well.
FIRST_ROW, ROW_GROWTH, LARGEST_ROW, COLUMN = 4.0 / 3.0, 0.3, 0.08, 0.5
# First row on coarse meshes over the distance of the wall, at most: where it was 6.5 or 10 (mesh_size 3 or 4) k of that
# row in the viscous sublayer grew in each iteration, and the flow did not converge.
LARGEST_FIRST = 3.5
FEWEST_ROWS, FEWEST_COLUMNS, LAYERS = 6, 8, 2
# Cells at other walls in the logarithmic layer, over the distance; in the viscous sublayer the first layer likewise,
# and at a grain, where u* on its crest is twice that of the bed.
WALL_CELL, FIRST_LAYER, AT_GRAIN = 4.0, 2.2, 0.5
# The first layer on coarse meshes [nu/u*], at most: up to here omega is that of the viscous sublayer (Wilcox 1988, AIAA
# J. 26, 1299). Where it was 3.6 thick k grew in each iteration.
THICKEST = 2.5
# Rows and layers at rough walls, over the distance of a smooth wall with the same flow: with 0.5 the velocity over
# u* k_s/nu = 27 is within 0.1% of the developed flow, with 2.2 it was 8% off.
ON_ROUGH = 0.5
WALL_GROWTH, GROWTH, MOST_LAYERS = 0.25, {2: 1.35, 3: 2.0}, 80
# Cells along walls with such layers: over the depth, a grain's size, and the length over which a bed would rise by its
# relief at its steepest slope (tests/end_to_end/test_resolved_channels.py).
ALONG, NEAR_GRAIN, ALONG_RISE, RISE_SAMPLES, GROWTH_ALONG = 0.1, 0.1, 0.1, 4001, 0.3
AWAY_GROWTH, CORNER_CELL = (
    0.05,
    0.05,
)  # of cells along a bed away from a grain; cells at corners that stick out
BED_CORNER = 27.0  # cells where layers meet at a corner of the bed, over the distance of the walls


def coarsening(walls: Walls, order: int) -> float:
    """Factor on cells at walls for an order; sizes in the logarithmic layer are for order three."""
    if walls.is_resolved:
        return 1.0 if order == 2 else 1.3
    return 1.0 if order > 2 else 0.75


def channel_grid(setup: Setup, order: int, mesh_size: float) -> Grid:
    """The mesh between plane walls: rows that grow with the distance from them; extruded in 3-D."""
    walls, scene, names = setup.walls, setup.scene, setup.sides
    domain, half, coarse = (
        scene.domain,
        setup.symmetric,
        mesh_size * coarsening(walls, order),
    )
    extents = (domain.left, domain.right), (domain.bottom + walls.nearest, walls.ceiling)
    rows = tuple(map(float, _row_ends(walls, extents[1][1] - extents[1][0], coarse)))
    columns = max(FEWEST_COLUMNS, round(domain.length / (COLUMN * walls.depth * coarse)))
    along = graded_ends(columns, 1.0)
    if scene.gdim == 2:
        return Grid(extents, (along, rows), names.of_rectangle)
    low, high = setup.geometry.half
    layers = max(LAYERS, round((high - low) / (2.0 * COLUMN * walls.depth * coarse)))
    ends = along, layer_ends(layers, 1.0, half), rows
    extents_in_space = extents[0], (low, high), extents[1]
    return Grid(extents_in_space, ends, names.of_box(half), half, parallel=True)


def _rows(walls: Walls, coarse: float) -> tuple[float, float, float, float]:
    largest = LARGEST_ROW * walls.depth
    bed = walls.names[0]
    over = min(
        ON_ROUGH if walls.is_rough(bed) else FIRST_ROW,
        LARGEST_FIRST * ROW_GROWTH / math.expm1(ROW_GROWTH * coarse),
    )
    first = min(over * walls.from_origin(bed), largest)
    part = walls.depth - walls.nearest
    bend = min((largest - first) / ROW_GROWTH, part)
    to_bend = math.log1p(ROW_GROWTH * bend / first) / ROW_GROWTH
    return first, largest, to_bend, to_bend + (part - bend) / largest


def _row_ends(walls: Walls, height: float, coarse: float) -> Floats:
    first, largest, to_bend, whole = _rows(walls, coarse)
    number = max(math.ceil(whole / coarse), FEWEST_ROWS // walls.number)
    counted = whole * np.arange(1, number + 1) / number
    near = first * np.expm1(ROW_GROWTH * np.minimum(counted, to_bend)) / ROW_GROWTH
    ends = (near + largest * np.maximum(counted - to_bend, 0.0)) / (height / walls.number)
    ends[-1] = 1.0
    if walls.number == 1:
        return ends
    return 0.5 * np.concatenate([ends, 2.0 - ends[-2::-1], [2.0]])


def coarsest(setup: Setup) -> float:
    """Largest numerics.mesh_size at which all cells still grow; inf except between planes."""
    walls = setup.walls
    if not walls.plane:
        return math.inf
    rows = _rows(walls, 1.0)[-1] / (FEWEST_ROWS // walls.number)
    columns = math.inf
    if walls.asked.inflow != "developed":  # else the flow does not change along them
        columns = setup.scene.domain.length / (COLUMN * walls.depth * FEWEST_COLUMNS)
    return min(rows, columns) / coarsening(walls, velocity_order(setup)[0])


def cells(setup: Setup, order: int, placement: Placement | None) -> Iterator[Near]:
    """Cells along walls some of which are not planar, and at their corners."""
    walls, scene = setup.walls, setup.scene
    if walls.is_resolved:
        yield from _along_layers(walls, scene, placement)
    else:
        yield from _in_logarithmic_layer(walls, scene, order, placement)


def _in_logarithmic_layer(
    walls: Walls, scene: Scene, order: int, placement: Placement | None
) -> Iterator[Near]:
    away, size = None, WALL_CELL * coarsening(walls, order) * walls.nearest
    if placement is not None:
        # Away from a grain the flow next to the bed is that of a channel, for which its rows do.
        away = Away(point(placement.centre), AWAY_GROWTH, max(size, LARGEST_ROW * walls.depth))
    for name in walls.names:
        yield Near(size, WALL_GROWTH, boundary=name, away=None if name == "body" else away)
    if scene.bed_shape is None or scene.gdim == 3:
        return
    leaving = tuple(separating(scene.bed_shape.curves(scene.domain.left, scene.domain.right)))
    if leaving:
        points = tuple(corner for corner, _ in leaving)
        yield Near(CORNER_CELL * size, WALL_GROWTH, points=points)
    yield from (lee(corner, drop) for corner, drop in leaving if drop > size)


def _along_layers(walls: Walls, scene: Scene, placement: Placement | None) -> Iterator[Near]:
    if scene.gdim == 3:
        return
    largest = ALONG * walls.depth
    size, far = min(largest, ALONG_RISE * rise(scene)), None
    if placement is not None:
        size = min(largest, NEAR_GRAIN * scene.grain.size)
        far = Away(point(placement.centre), AWAY_GROWTH, largest)
    for name in walls.names:
        yield Near(size, GROWTH_ALONG, boundary=name, away=None if name == "body" else far)
    if scene.bed_shape is None:
        return
    bed = scene.bed_shape.curves(scene.domain.left, scene.domain.right)
    if sharp := corners(bed[:-1], bed[1:]):
        yield Near(BED_CORNER * walls.smooth, WALL_GROWTH, points=sharp)
    yield from (lee(corner, drop) for corner, drop in separating(bed) if drop > largest)


def rise(scene: Scene) -> float:
    """Length over which a 2-D bed without corners would rise by its relief at its steepest slope."""
    bed, domain = scene.bed_shape, scene.domain
    if bed is None or not np.isfinite(bed.feature) or len(bed.corners(domain.left, domain.right)):
        return math.inf
    x = np.linspace(domain.left, domain.right, RISE_SAMPLES)
    heights = bed.height(x)
    return float(np.ptp(heights) / np.abs(np.gradient(heights, x)).max())


def layers(setup: Setup, order: int, along: float) -> WallLayers | None:
    """Layers at walls some of which are not planar, with cells of a size along them in 3-D, or None."""
    walls, gdim = setup.walls, setup.scene.gdim
    if not walls.is_resolved:
        return None
    coarse = coarsening(walls, order)
    over = {name: ON_ROUGH if walls.is_rough(name) else FIRST_LAYER for name in walls.names}
    first = {
        name: min(size * coarse * walls.from_origin(name), along) for name, size in over.items()
    }
    if "body" in first:
        first["body"] *= AT_GRAIN
    thickest = THICKEST * walls.unit / (FIRST_LAYER * coarse * walls.smooth)
    if gdim == 2:
        return WallLayers(first, MOST_LAYERS, GROWTH[2], graded=True, most=thickest)
    most = LAYERS_SHARE * along / min(first.values())
    number = math.ceil(math.log(1.0 + (GROWTH[3] - 1.0) * most) / math.log(GROWTH[3]))
    return WallLayers(first, max(number, 1), GROWTH[3], most=thickest)

"""Cells at the walls of a mean flow: rows of a channel, layers in the viscous sublayer, sizes along walls."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise, takewhile
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats, Point
from ..geometry.placement import Placement
from ..geometry.plane.curves import Curve
from ..meshes import LAYERS_SHARE, Away, Grid, Near, Sizes, WallLayers, graded_ends
from ..scene import Scene
from ..setup.geometry import point
from ..setup.setup import Setup
from .cells import BED_GROWTH, GROWTH, corners
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
LAYER_GROWTH, MOST_LAYERS = {2: 1.35, 3: 2.0}, 80
# Cells along walls with such layers: over the depth, a grain's size, and the length over which a bed would rise by its
# relief at its steepest slope (tests/end_to_end/test_resolved_channels.py).
ALONG, RISE_SAMPLES = 0.1, 4001
CORNER_CELL = 0.05  # at corners that protrude, over the cells at walls
PLANE_CELL = 0.2  # of a 3-D grain, along a level bed next to it
BED_CORNER = 27.0  # cells where layers meet at a corner of the bed, over the distance of the walls

# Behind a corner that sticks out: how far its shear layer reaches, and the cells in it, over the height by which the
# bed falls; their growth away from it; points along it; sine of the turn from which on a corner is one.
LEE, LEE_CELL, LEE_GROWTH, LEE_POINTS, OUTWARD = 6.0, 0.09, 0.15, 25, -0.17


def coarsening(walls: Walls, order: int) -> float:
    """Factor on cells at walls for an order; sizes in the logarithmic layer are for order three."""
    if walls.is_resolved:
        return 1.0 if order == 2 else 1.3
    return 1.0 if order > 2 else 0.75


def channel_grid(setup: Setup, order: int, mesh_size: float) -> Grid:
    """The mesh between plane walls: rows that grow with the distance from them; extruded in 3-D."""
    walls, domain, gdim = setup.walls, setup.scene.domain, setup.scene.gdim
    low, high, coarse = (
        domain.bottom + walls.nearest,
        walls.ceiling,
        mesh_size * coarsening(walls, order),
    )
    columns = domain.length / (COLUMN * walls.depth * coarse)
    along = graded_ends(max(FEWEST_COLUMNS, round(columns)), 1.0)
    rows = tuple(map(float, _row_ends(walls, high - low, coarse)))
    if gdim == 2:
        return Grid(((domain.left, domain.right), (low, high)), (along, rows), setup.sides.of_grid)
    across = setup.geometry.half
    layers = max(LAYERS, round((across[1] - across[0]) / (2.0 * COLUMN * walls.depth * coarse)))
    extents, ends = (
        ((domain.left, domain.right), across, (low, high)),
        (along, graded_ends(layers, 1.0), rows),
    )
    return Grid(extents, ends, setup.sides.of_grid, setup.symmetric, parallel=True)


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


def _number_of_rows(walls: Walls, coarse: float) -> int:
    return max(math.ceil(_rows(walls, coarse)[-1] / coarse), FEWEST_ROWS // walls.number)


def _row_ends(walls: Walls, height: float, coarse: float) -> Floats:
    first, largest, to_bend, whole = _rows(walls, coarse)
    number = _number_of_rows(walls, coarse)
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


def ratio_of_rows(setup: Setup, coarser: float) -> float:
    """Rows between planes over those of a mesh with cells `coarser` times as large, at most that factor."""
    walls, size = setup.walls, setup.scene.numerics.mesh_size
    if not walls.plane:
        return coarser
    size *= coarsening(walls, velocity_order(setup)[0])
    fine, coarse = (_number_of_rows(walls, size * factor) for factor in (1.0, coarser))
    return min(fine / coarse, coarser)


def with_walls(sizes: Sizes, setup: Setup, order: int, placement: Placement | None) -> Sizes:
    """Cell sizes with those along walls some of which are not planar, around a grain placed for the flow."""
    scene, walls = setup.scene, setup.walls
    near = (*sizes.near, *cells(setup, order, placement if scene.moves else scene.placement))
    along = math.inf
    if scene.gdim == 3 and walls.is_resolved:
        along = min(one.size for one in near if one.boundary)
    return replace(sizes, near=near, layers=layers(setup, order, along))


def cells(setup: Setup, order: int, placement: Placement | None) -> Iterator[Near]:
    """Cells along walls some of which are not planar, and at corners of a 2-D bed."""
    walls, scene, bed, away = setup.walls, setup.scene, setup.scene.bed_shape, None
    if walls.is_resolved and scene.gdim == 3:
        yield from _along_plane_layers(setup, placement)
        return
    if walls.is_resolved:
        largest = beyond = ALONG * walls.depth
        along = ALONG * rise(scene) if placement is None else ALONG * scene.grain.size
        size, growth, at_corner = min(largest, along), GROWTH[3], BED_CORNER * walls.smooth
    else:
        size = beyond = WALL_CELL * coarsening(walls, order) * walls.nearest
        # Away from a grain the flow next to the bed is that of a channel, for which its rows do.
        largest, growth, at_corner = (
            max(size, LARGEST_ROW * walls.depth),
            GROWTH[2],
            CORNER_CELL * size,
        )
    if placement is not None:
        away = Away(point(placement.centre), BED_GROWTH[2], largest)
    for name in walls.names:
        yield Near(size, growth, boundary=name, away=None if name == "body" else away)
    if bed is None or scene.gdim == 3:
        return
    curves = bed.curves(scene.domain.left, scene.domain.right)
    leaving = tuple(separating(curves))
    sharp = tuple(corner for corner, _ in leaving)
    if walls.is_resolved:
        sharp = corners(curves[:-1], curves[1:])
    if sharp:
        yield Near(at_corner, GROWTH[2], points=sharp)
    yield from (lee(corner, drop) for corner, drop in leaving if drop > beyond)


def _along_plane_layers(setup: Setup, placement: Placement | None) -> Iterator[Near]:
    walls, bed, largest = setup.walls, setup.scene.bed_shape, LARGEST_ROW * setup.walls.depth
    if placement is not None and (bed is None or math.isinf(bed.feature)):
        size = min(PLANE_CELL * setup.scene.grain.size, largest)
        away = Away(point(placement.centre), BED_GROWTH[3], largest)
        yield Near(size, GROWTH[3], boundary=walls.names[0], away=away)
    if setup.sides.top in walls.names:
        yield Near(largest, GROWTH[3], boundary=setup.sides.top)


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
        return WallLayers(first, MOST_LAYERS, LAYER_GROWTH[2], graded=True, most=thickest)
    most = LAYERS_SHARE * along / min(first.values())
    number = math.ceil(math.log(1.0 + (LAYER_GROWTH[3] - 1.0) * most) / math.log(LAYER_GROWTH[3]))
    return WallLayers(first, max(number, 1), LAYER_GROWTH[3], most=thickest)


def separating(bed: tuple[Curve, ...]) -> Iterator[tuple[Point, float]]:
    """Corners that protrude into the flow, which separates there, and the drop of the bed behind each."""
    for before, after in pairwise(range(len(bed))):
        ahead, behind = bed[before].tangent([1.0])[0], bed[after].tangent([0.0])[0]
        if ahead[0] * behind[1] - ahead[1] * behind[0] < OUTWARD:
            falling = takewhile(lambda curve: curve.end[1] <= curve.start[1], bed[after:])
            lowest = min([curve.end[1] for curve in falling], default=bed[after].start[1])
            yield bed[after].start, bed[after].start[1] - lowest


def lee(corner: Point, drop: float) -> Near:
    """Cells in the shear layer that leaves a corner."""
    shares = np.linspace(0.0, 1.0, LEE_POINTS).tolist()
    points = tuple((corner[0] + LEE * drop * s, corner[1] - drop * s) for s in shares)
    return Near(LEE_CELL * drop, LEE_GROWTH, points=points)

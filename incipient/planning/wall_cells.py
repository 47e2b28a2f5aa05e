"""Cells at walls with wall functions: rows of a channel, and sizes along other walls."""

import math

from ..geometry.placement import Placement
from ..meshes import Away, Grid, Near, graded_ends
from .cells import FEWEST_ROWS, RowSizes, growing_rows, layer_ends, lee, separating
from .flow_setup import Setup
from .scene_geometry import Geometry, point
from .sides import SideNames
from .wall_layer import LayeredWalls

# A channel's mesh: rows over the depth of a wall; column over that depth; finest over largest row.
ROWS, COLUMN, GRADING = 14, 1.0, 0.3
FEWEST_COLUMNS = 4  # whatever the cells' size
# First of these rows over their mean; where the law's distance is less than 1/FINE_ROW of it, the first row is FINE_ROW
# distances thick, and rows grow by ROW_GROWTH of the distance from it: velocity and epsilon change as fast as that.
FIRST_ROW, FINE_ROW, ROW_GROWTH = 0.5, 4.0 / 3.0, 0.4
FIRST_OF_GRADED = (
    2.0 * GRADING / (1.0 + GRADING)
)  # first over mean row of those that are graded as usual
# Other meshes: cells at walls, over the distance of the law; growth away from them; cells at corners that stick out,
# over those: a shear layer begins as thick as a cell there, which is most of the error of where it reattaches.
WALL_CELL, WALL_GROWTH, CORNER_CELL = 4.0, 0.25, 0.05
AWAY_GROWTH = 0.05  # of cells along a bed, with the distance from a grain
LAYERS = 2  # of cells across a 3-D channel, at the least


def channel_grid(
    walls: LayeredWalls, geometry: Geometry, names: SideNames, order: int, mesh_size: float
) -> Grid:
    """The mesh between the walls, less what the law of the wall covers; in 3-D it is extruded. Not collective."""
    domain, half = geometry.domain, geometry.symmetric
    coarse = mesh_size * coarsening(order)
    columns = max(FEWEST_COLUMNS, round(domain.length / (COLUMN * walls.depth * coarse)))
    height = domain.height - walls.number * walls.distance
    bottom = domain.bottom + walls.distance
    rows = _row_ends(walls, coarse, height) or graded_ends(
        max(FEWEST_ROWS, round(ROWS * walls.number / coarse)), GRADING
    )
    along, upright = (domain.left, domain.right), (bottom, bottom + height)
    along_ends = graded_ends(columns, GRADING)
    if geometry.gdim == 2:
        return Grid((along, upright), (along_ends, rows), names.of_rectangle)
    low, high = geometry.half
    layers = max(LAYERS, round((high - low) / (COLUMN * walls.depth * coarse)))
    ends = along_ends, layer_ends(layers, 1.0, half), rows
    return Grid((along, (low, high), upright), ends, names.of_box(half), half, parallel=True)


def _row_ends(walls: LayeredWalls, coarse: float, height: float) -> tuple[float, ...]:
    """Where rows end that are as fine at walls as the law's distance asks for; none: rows graded as usual do."""
    largest, first = walls.depth / ROWS, FINE_ROW * walls.distance
    if first >= FIRST_ROW * largest:
        return ()
    ends = growing_rows(RowSizes(first, ROW_GROWTH, largest), height, walls.number, coarse)
    # Few rows, graded as usual, may have the thinner one at the wall.
    return tuple(map(float, ends)) if ends[0] < FIRST_OF_GRADED / len(ends) else ()


def coarsening(order: int) -> float:
    """The size of cells at walls with elements of an order, relative to those of order three."""
    return 1.0 if order > 2 else 0.75


def coarsest(setup: Setup) -> float:
    """The largest numerics.mesh_size by which all cells become larger; no bound but between planes. Not collective."""
    if setup.resolves_walls:
        return setup.resolved_walls.coarsest(setup.geometry.domain, setup.order.number)
    walls, length = setup.walls, setup.geometry.domain.length
    if not walls.plane:
        return math.inf
    rows, columns = (
        ROWS * walls.number / FEWEST_ROWS,
        length / (COLUMN * walls.depth * FEWEST_COLUMNS),
    )
    return min(rows, columns) / coarsening(setup.order.number)


def cells(
    walls: LayeredWalls, geometry: Geometry, order: int, placement: Placement | None = None
) -> tuple[Near, ...]:
    """Cells along walls of which some are no planes, and at their corners, with a grain placed. Not collective."""
    away = None
    size = WALL_CELL * coarsening(order) * walls.distance
    if placement is not None:
        # Away from a grain the flow next to the bed is that of a channel, for which its rows do.
        away = Away(point(placement.centre), AWAY_GROWTH, max(size, walls.depth / ROWS))
    found = [
        Near(size, WALL_GROWTH, boundary=name, away=None if name == "body" else away)
        for name in walls.names
    ]
    if geometry.bed is not None and geometry.gdim == 2:
        bed = geometry.bed.curves(geometry.domain.left, geometry.domain.right)
        if leaving := tuple(separating(bed)):
            points = tuple(corner for corner, _ in leaving)
            found.append(Near(CORNER_CELL * size, WALL_GROWTH, points=points))
        found.extend(lee(corner, drop) for corner, drop in leaving if drop > size)
    return tuple(found)

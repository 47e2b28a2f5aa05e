"""The region in 3-D that gmsh meshes, from the geometry of a scene: the box above a bed, less the grain."""

import math
from collections.abc import Iterator

import numpy as np

from ..geometry.placement import Placement
from ..geometry.space.beds import Plane, Terrain
from ..geometry.space.grains import Box
from ..meshes import Away, Grid, Near, PlacedSolid, Resolved, Sizes, SolidRegion
from .boundary_layer import GRAIN_CELL_IN_SPACE, thinner
from .cells import FEWEST, layer_ends
from .flow_setup import Setup
from .meshed_bed import resolved_bed
from .scene_geometry import Geometry, Stance, point
from .sides import SideNames

# Cell sizes for mesh_size = 1 by order of the velocity (docs/contribute/defaults.md).
BED_CELL = {2: 0.35, 3: 0.5, 4: 0.7}  # of the bed's smallest feature
GAP_CELL = {2: 0.8, 3: 1.5, 4: 1.8}  # of the gap between grain and bed, and of narrow passages
EDGE_CELL = 0.5  # of the grain's cells, at sharp edges
# Cells behind a held grain with such a layer, how far from its centre, and how far in time, over the grain's size.
WAKE_CELL, WAKE, WAKE_IN_TIME = 0.25, 3.0, 6.0
PLANE_CELL = 0.2  # likewise, along a level bed that is resolved, near a grain
GROWTH, GAP_GROWTH = 0.3, 0.22  # of cell sizes with distance
BED_GROWTH = 0.15  # along a bed away from the grain, see `meshing`
GRID_GRADING = 0.2  # of the cells of an empty box, at walls over those in the middle
BED_LARGEST = (
    0.6  # of the bed's smallest feature, whatever mesh_size: larger cells do not follow its surface
)


def box_grid(geometry: Geometry, names: SideNames, cell: float) -> Grid:
    """The grid of an empty box with cells of a size on average, finer next to its walls; half of it if symmetric."""
    domain, half = geometry.domain, geometry.symmetric
    extents = ((domain.left, domain.right), geometry.half, (domain.bottom, domain.ceiling))
    counts = [max(FEWEST[3], round((high - low) / cell)) for low, high in extents]
    gradings = (GRID_GRADING, GRID_GRADING if geometry.walled else 1.0, GRID_GRADING)
    ends = (
        layer_ends(n, grading, half and axis == 1)
        for axis, (n, grading) in enumerate(zip(counts, gradings, strict=True))
    )
    return Grid(extents, (*ends,), names.of_box(half), half)


def region(setup: Setup, placement: Placement | None) -> SolidRegion:
    """The meshed geometry: the domain above the bed, less the placed grain."""
    geometry, names = setup.geometry, setup.sides
    domain = geometry.domain
    return SolidRegion(
        x=(domain.left, domain.right),
        y=domain.across,
        ceiling=setup.ceiling,
        bed=geometry.bed or Plane(origin_z=domain.bottom),
        holes={} if placement is None else {"body": PlacedSolid(geometry.grain, placement)},
        sides=(names.left, names.right, "right", "left", names.top, names.bottom),
        symmetric=geometry.symmetric,
        resolved=_meshed(setup, placement),
    )


def _meshed(setup: Setup, placement: Placement | None) -> Resolved | None:
    """The region where the bed is resolved; None: everywhere, as for a moving grain."""
    if setup.geometry.moves:
        return None
    return resolved_bed(setup.geometry, placement, setup.base_flow.datum)


def cut_at_inflow(setup: Setup) -> bool:
    """Whether the inflow cuts bedforms, which are meshed there. Not collective."""
    geometry, placement = setup.geometry, setup.geometry.placement
    if (
        geometry.gdim == 2
        or geometry.bed is None
        or placement is None
        or not np.isfinite(geometry.bed.feature)
    ):
        return False
    meshed = _meshed(setup, placement)
    nearest = np.array([[geometry.domain.left, placement.centre[1]]])
    return meshed is None or bool(meshed.share(nearest)[0] < 1.0)


def sizes(setup: Setup, order: int, stance: Stance) -> Sizes:
    """Cell sizes for mesh_size = 1."""
    layer = thinner(setup)
    near = [*_along_grain(setup.geometry, order, stance, layer), *_along_bed(setup, order, stance)]
    if layer < 1.0:
        near.extend(_in_wake(setup, setup.geometry.placement))
    layers = None
    if setup.is_averaged:
        from . import wall_cells

        near.extend(wall_cells.cells(setup, order, setup.geometry.placement))
        if setup.walls.is_resolved:
            placement = setup.geometry.placement
            near += [*_in_wake(setup, placement), *_at_plane_walls(setup, placement)]
            along = min(one.size for one in near if one.boundary)
            layers = wall_cells.layers(setup, order, along)
    far = setup.far_cells.largest_in_space(order)
    return Sizes(far, tuple(near), gap_part=GAP_CELL[order], layers=layers)


def _at_plane_walls(setup: Setup, placement: Placement | None) -> Iterator[Near]:
    """Cells along walls that have no forms and are resolved, with layers between the walls and them."""
    from .wall_cells import LARGEST_ROW

    walls, bed, grain = setup.walls, setup.geometry.bed, setup.geometry.grain
    size = largest = LARGEST_ROW * walls.depth
    away = None
    if grain is not None and placement is not None:
        size = min(PLANE_CELL * grain.size, largest)
        away = Away(point(placement.centre), BED_GROWTH, largest)
    if bed is None or not np.isfinite(bed.feature):
        yield Near(size, GROWTH, boundary=walls.names[0], away=away)
    if setup.sides.top in walls.names:
        yield Near(largest, GROWTH, boundary=setup.sides.top)


def _in_wake(setup: Setup, placement: Placement | None) -> list[Near]:
    """Cells behind the grain, where the base flow carries its wake."""
    grain = setup.geometry.grain
    if grain is None or placement is None:
        return []
    centre = np.array(placement.centre)
    velocity = setup.base_flow.velocity(centre[:, None], 0.0)[:, 0]
    speed = float(np.linalg.norm(velocity))
    if speed == 0.0:
        return []
    reach = WAKE if setup.scene.time is None else WAKE_IN_TIME
    steps = np.arange(0.5, reach, 0.5 * WAKE_CELL)
    points = centre + grain.size * steps[:, None] * velocity / speed
    return [Near(WAKE_CELL * grain.size, GROWTH, points=tuple(point(one) for one in points))]


def _along_grain(geometry: Geometry, order: int, stance: Stance, layer: float) -> list[Near]:
    """Cells at the grain, finer by `layer`, and in a narrow gap between it and what is next to it."""
    grain = geometry.grain
    if grain is None:
        return []
    size = layer * GRAIN_CELL_IN_SPACE[order] * grain.size
    edged = isinstance(grain, Box) and grain.edge_radius == 0.0
    near = [Near(EDGE_CELL * size if edged else size, GROWTH, boundary="body")]
    if stance.gap < 4.0 * size and stance.gap_ends is not None and stance.placement is not None:
        points = geometry.gap_points(stance.gap_ends, stance.placement)
        near.append(Near(GAP_CELL[order] * stance.gap, GAP_GROWTH, points=points, needed=True))
    return near


def _along_bed(setup: Setup, order: int, stance: Stance) -> list[Near]:
    """Cells along a bed with forms, larger where a planar far bed takes its place."""
    bed = setup.geometry.bed
    if not isinstance(bed, Terrain) or not np.isfinite(bed.feature):
        return []
    largest, away = BED_LARGEST * bed.feature, None
    if stance.placement is not None:
        meshed = _meshed(setup, stance.placement)
        level = math.inf if meshed is None else meshed.radius + meshed.passage
        away = Away(point(stance.placement.centre), BED_GROWTH, largest, level)
    size = min(BED_CELL[order] * bed.feature, largest)
    return [Near(size, GROWTH, boundary="bed", away=away, most=largest)]

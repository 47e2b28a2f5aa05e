"""The 3-D region that gmsh meshes, and its cell sizes: the box above a bed, less the grain."""

import math
from collections.abc import Iterator

import numpy as np

from ..geometry.placement import Placement
from ..geometry.space.beds import Plane, Terrain
from ..geometry.space.grains import Box
from ..meshes import Away, Grid, Near, PlacedSolid, Resolved, Sizes, SolidRegion
from ..setup.geometry import Geometry, Stance, point
from ..setup.numbers import speed_past_grain
from ..setup.setup import Setup
from .cells import FEWEST, layer_ends
from .discretisation import far_cells

# Cell sizes for mesh_size = 1 by order of the velocity (docs/contribute/defaults.md).
GRAIN_CELL = {2: 0.15, 3: 0.22, 4: 0.3}  # of the grain
BED_CELL = {2: 0.35, 3: 0.5, 4: 0.7}  # of the bed's smallest feature
GAP_CELL = {2: 0.8, 3: 1.5, 4: 1.8}  # of the gap between grain and bed, and of narrow passages
# The boundary layer of a held grain thins as Re^-1/2: from this Reynolds number on cells at the grain do, to this part.
LAYERED, THINNEST = 50.0, 0.2
EDGE_CELL = 0.5  # of the grain's cells, at sharp edges
# Cells behind a held grain with such a layer, how far from its centre, and how far in time, over the grain's size.
WAKE_CELL, WAKE, WAKE_IN_TIME = 0.25, 3.0, 6.0
PLANE_CELL = 0.2  # likewise, along a level bed that is resolved, near a grain
PROFILE_CELL = {2: 0.5, 3: 1.0, 4: 1.5}  # along the bed, in thicknesses of an oscillating layer
GROWTH, GAP_GROWTH = 0.3, 0.22  # of cell sizes with distance
BED_GROWTH = 0.15  # along a bed away from the grain, see `meshing`
GRID_GRADING = 0.2  # of the cells of an empty box, at walls over those in the middle
BED_LARGEST = (
    0.6  # of the bed's smallest feature, whatever mesh_size: larger cells do not follow its surface
)


def box_grid(setup: Setup, cell: float) -> Grid:
    """The grid of an empty box with cells of a mean size, finer next to walls; half of it if symmetric."""
    scene, domain, half = setup.scene, setup.scene.domain, setup.symmetric
    extents = ((domain.left, domain.right), setup.geometry.half, (domain.bottom, domain.ceiling))
    counts = [max(FEWEST[3], round((high - low) / cell)) for low, high in extents]
    gradings = (GRID_GRADING, GRID_GRADING if scene.sides == "wall" else 1.0, GRID_GRADING)
    ends = (
        layer_ends(n, grading, half and axis == 1)
        for axis, (n, grading) in enumerate(zip(counts, gradings, strict=True))
    )
    return Grid(extents, (*ends,), setup.sides.of_box(half), half)


def region(setup: Setup, placement: Placement | None) -> SolidRegion:
    """The domain above the bed, less the placed grain."""
    scene, names, domain = setup.scene, setup.sides, setup.scene.domain
    return SolidRegion(
        x=(domain.left, domain.right),
        y=domain.across,
        ceiling=setup.ceiling,
        bed=scene.bed_shape or Plane(origin_z=domain.bottom),
        holes={} if placement is None else {"body": PlacedSolid(scene.grain, placement)},
        sides=(names.left, names.right, "right", "left", names.top, names.bottom),
        symmetric=setup.symmetric,
        resolved=_meshed(setup, placement),
    )


def _meshed(setup: Setup, placement: Placement | None) -> Resolved | None:
    if setup.scene.moves:
        return None
    return setup.geometry.resolved_bed(placement, setup.base_flow.datum)


def cut_at_inflow(setup: Setup) -> bool:
    """Whether the inflow cuts bedforms, which are meshed there."""
    scene, placement = setup.scene, setup.scene.placement
    if (
        scene.gdim == 2
        or scene.bed_shape is None
        or placement is None
        or not np.isfinite(scene.bed_shape.feature)
    ):
        return False
    meshed = _meshed(setup, placement)
    nearest = np.array([[scene.domain.left, placement.centre[1]]])
    return meshed is None or bool(meshed.share(nearest)[0] < 1.0)


def sizes(setup: Setup, order: int, stance: Stance) -> Sizes:
    """Cell sizes for mesh_size = 1."""
    layer = thinner(setup)
    near = [*_along_grain(setup.geometry, order, stance, layer), *_along_bed(setup, order, stance)]
    if layer < 1.0:
        near.extend(_in_wake(setup, setup.scene.placement))
    layers = None
    if setup.is_averaged:
        from . import wall_cells

        near.extend(wall_cells.cells(setup, order, setup.scene.placement))
        if setup.walls.is_resolved:
            placement = setup.scene.placement
            near += [*_in_wake(setup, placement), *_at_plane_walls(setup, placement)]
            along = min(one.size for one in near if one.boundary)
            layers = wall_cells.layers(setup, order, along)
    far = far_cells(setup).largest_in_space(order)
    if setup.scene.flow.oscillates:
        placed, size = stance.placement, PROFILE_CELL[order] * setup.base_flow.layer
        away = None if placed is None else Away(point(placed.centre), BED_GROWTH, far)
        near.append(Near(size, GROWTH, boundary=setup.sides.bottom, away=away))
    return Sizes(far, tuple(near), gap_part=GAP_CELL[order], layers=layers)


def thinner(setup: Setup) -> float:
    """Factor by which the boundary layer of a held grain reduces the cells at it."""
    scene, base_flow = setup.scene, setup.base_flow
    if scene.grain is None or scene.moves or base_flow.creeping or setup.is_averaged:
        return 1.0
    reynolds = speed_past_grain(setup) * scene.grain.size / base_flow.viscosity
    return float(np.clip((LAYERED / max(reynolds, LAYERED)) ** 0.5, THINNEST, 1.0))


def _at_plane_walls(setup: Setup, placement: Placement | None) -> Iterator[Near]:
    from .wall_cells import LARGEST_ROW

    walls, bed, grain = setup.walls, setup.scene.bed_shape, setup.scene.grain
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
    grain = setup.scene.grain
    if grain is None or placement is None:
        return []
    centre = np.array(placement.centre)
    velocity = setup.base_flow.velocity(centre[:, None], 0.0)[:, 0]
    speed = float(np.linalg.norm(velocity))
    if speed == 0.0:
        return []
    reach = WAKE if setup.scene.time is None else WAKE_IN_TIME
    steps = np.arange(0.5, reach, 0.5 * WAKE_CELL)
    if setup.scene.flow.oscillates:
        steps = np.concatenate([-steps, steps])
    points = centre + grain.size * steps[:, None] * velocity / speed
    return [Near(WAKE_CELL * grain.size, GROWTH, points=tuple(point(one) for one in points))]


def _along_grain(geometry: Geometry, order: int, stance: Stance, layer: float) -> list[Near]:
    grain = geometry.scene.grain
    if grain is None:
        return []
    size = layer * GRAIN_CELL[order] * grain.size
    edged = isinstance(grain, Box) and grain.edge_radius == 0.0
    near = [Near(EDGE_CELL * size if edged else size, GROWTH, boundary="body")]
    if stance.gap < 4.0 * size and stance.gap_ends is not None and stance.placement is not None:
        points = geometry.gap_points(stance.gap_ends, stance.placement)
        near.append(Near(GAP_CELL[order] * stance.gap, GAP_GROWTH, points=points, needed=True))
    return near


def _along_bed(setup: Setup, order: int, stance: Stance) -> list[Near]:
    bed = setup.scene.bed_shape
    if not isinstance(bed, Terrain) or not np.isfinite(bed.feature):
        return []
    largest, away = BED_LARGEST * bed.feature, None
    if stance.placement is not None:
        meshed = _meshed(setup, stance.placement)
        level = math.inf if meshed is None else meshed.radius + meshed.passage
        away = Away(point(stance.placement.centre), BED_GROWTH, largest, level)
    size = min(BED_CELL[order] * bed.feature, largest)
    return [Near(size, GROWTH, boundary="bed", away=away, most=largest)]

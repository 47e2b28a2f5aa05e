"""The region that gmsh meshes, from the geometry of a scene: where everything is, and how finely it is meshed."""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..geometry.placement import Placement
from ..geometry.plane.curves import Curve, Line
from ..meshes import Away, Grid, Near, Region, Sizes, SolidRegion, graded_ends
from . import meshing_in_space as in_space
from .boundary_layer import GRAIN_CELL
from .cells import CLOSED, FAR_CELL, FEWEST, corners
from .flow_setup import Setup
from .layout import Layout
from .plan import Plan
from .scene_geometry import Geometry, Stance, point

# Cell sizes for mesh_size = 1 by order of the velocity, chosen so that the orders err alike
# (docs/contribute/defaults.md).
BED_CELL = {2: 0.15, 3: 0.25, 4: 0.35}  # of the bed's smallest feature
GAP_CELL = {2: 0.5, 3: 0.75, 4: 1.0}  # of the gap between grain and bed
CORNER_CELL = 0.3  # of the grain's cells, at its corners
GROWTH, GAP_GROWTH = 0.25, 0.18  # of cell sizes with distance
# Along a bed away from the grain: how fast cells grow with the distance from it, and up to which part of the bed's
# smallest feature. There only the drag of the bed as a whole matters (docs/contribute/defaults.md).
BED_GROWTH, BED_LARGEST = 0.05, 0.6
# At an inflow given by formulas: which part of the discharge a cell's interpolation may miss, of a reattachment length
# behind a step at Re 800 eight times as much; the least cell over the usual one; parts of a cell; instants.
MISSED, FINEST, UNEVEN, INFLOW_SAMPLES = 1e-4, 1e-3, 0.382, 9
# Along the bed below the mean profile of a log-law flow, in thicknesses of its layer next to the bed.
PROFILE_CELL = {2: 0.5, 3: 1.0, 4: 1.5}
GRID_GRADING = 0.05  # of the cells of an empty box: spacing at walls over that in the middle


def lay_out(setup: Setup, plan: Plan, moved: Placement | None = None) -> Layout:
    """Place the grain, where the scene has it or where it has `moved`, and decide cell sizes. Not collective."""
    if setup.is_averaged and setup.walls.plane:
        from .wall_cells import channel_grid

        return _grid_layout(setup, plan, channel_grid(setup, plan.order, plan.mesh_size))
    if setup.scene.is_empty_box:
        return _grid_layout(setup, plan, _box(setup, plan.mesh_size * setup.far_cells.largest))
    if setup.scene.closes_contacts and moved is None:
        return _closed_layout(setup, plan)
    stance = _stance(setup, moved)
    if setup.geometry.gdim == 3:
        region, sizes = (
            in_space.region(setup, stance.placement),
            in_space.sizes(setup, plan.order, stance),
        )
        return _layout(setup, plan, stance, region, sizes)
    holes = {} if stance.placement is None else {"body": _outline(setup.geometry, stance.placement)}
    domain = setup.geometry.domain
    bottom = _bottom(setup.geometry, ((domain.left, domain.right),))
    planar = Region(bottom, setup.ceiling, holes, setup.sides.around)
    finer = _finer(setup, plan.order, holes.get("body", ()), stance)
    return _layout(setup, plan, stance, planar, _sizes(setup, plan.order, finer))


def _layout(
    setup: Setup, plan: Plan, stance: Stance, shape: Region | SolidRegion, sizes: Sizes
) -> Layout:
    """The layout of a region that is meshed freely."""
    return Layout(
        shape,
        sizes.scaled(plan.mesh_size),
        plan.geometry_order,
        *(stance.resting, stance.placement, stance.gap, stance.gap_ends),
        setup.scene.numerics.max_cells,
    )


def _grid_layout(setup: Setup, plan: Plan, grid: Grid) -> Layout:
    """The layout of a grid, in which there is no grain."""
    return Layout(grid, Sizes(1.0), plan.geometry_order, max_cells=setup.scene.numerics.max_cells)


def _closed_layout(setup: Setup, plan: Plan) -> Layout:
    """The layout where the space next to the contacts of a resting grain is closed."""
    geometry = setup.geometry
    closing, domain, resting = geometry.closing, geometry.domain, geometry.placement
    lines = (closing.left, closing.right)
    bottom = _bottom(
        geometry, ((domain.left, lines[0].start[0]), (lines[1].start[0], domain.right))
    )
    standing = {"body": closing.outline} | {
        name: (line,) for name, line in zip(CLOSED, lines, strict=True)
    }
    region = Region(bottom, setup.ceiling, {}, setup.sides.around, standing)
    ends = tuple(end for line in lines for end in (line.start, line.end))
    finer = (
        *_finer(setup, plan.order, closing.outline, Stance(resting, resting)),
        Near(GAP_CELL[plan.order] * closing.width, GAP_GROWTH, points=ends, needed=True),
    )
    stance = Stance(resting, resting, closing.width, (closing.left.start, closing.left.end))
    return replace(
        _layout(setup, plan, stance, region, _sizes(setup, plan.order, finer)), closing=closing
    )


def _stance(setup: Setup, moved: Placement | None) -> Stance:
    """The grain's placement, in the scene or after it has `moved`, and its nearest boundary."""
    stance = setup.geometry.stance if moved is None else Stance(moved, moved)
    if not setup.geometry.moves or stance.placement is None:
        return stance
    near = setup.surroundings.clearance(stance.placement)
    ends = setup.geometry.halved(near.on_grain), setup.geometry.halved(near.on_other)
    return replace(stance, gap=near.distance, gap_ends=ends)


def _outline(geometry: Geometry, placement: Placement) -> tuple[Curve, ...]:
    return tuple(curve.moved(placement) for curve in geometry.grain.drawn())


def _bottom(geometry: Geometry, reaches: tuple[tuple[float, float], ...]) -> tuple[Curve, ...]:
    """The lower side along stretches of the abscissa: the bed, or a straight line."""
    domain, bed = geometry.domain, geometry.bed
    if bed is None:
        return (Line((domain.left, domain.bottom), (domain.right, domain.bottom)),)
    return tuple(curve for reach in reaches for curve in bed.curves(*reach))


def _sizes(setup: Setup, order: int, finer: tuple[Near, ...]) -> Sizes:
    layers = None
    if setup.is_averaged:
        from .wall_cells import layers as at_walls

        layers = at_walls(setup, order, math.inf)
    return Sizes(FAR_CELL[order] * setup.geometry.domain.height, finer, layers=layers)


def _finer(
    setup: Setup, order: int, outline: tuple[Curve, ...], stance: Stance
) -> tuple[Near, ...]:
    """Where cells are smaller than away from everything."""
    geometry = setup.geometry
    near = [
        *_along_grain(geometry, order, outline, stance),
        *_along_bed(geometry, order, stance, setup.is_averaged),
    ]
    if setup.base_flow.flow.kind == "log-law":
        layer = setup.base_flow.mean_profile.layer
        near.append(Near(PROFILE_CELL[order] * layer, GROWTH, boundary=setup.sides.bottom))
    if setup.is_averaged:
        from .wall_cells import cells

        placement = stance.placement if geometry.moves else geometry.placement
        near.extend(cells(setup, order, placement))
    if setup.base_flow.flow.kind == "expression":
        near.extend(_at_inflow(setup, order))
    if setup.base_flow.flow.kind == "lid":
        domain = geometry.domain
        upper = ((domain.left, domain.ceiling), (domain.right, domain.ceiling))
        near.append(Near(0.1 * FAR_CELL[order] * domain.height, GROWTH, points=upper))
    return tuple(near)


def _along_grain(
    geometry: Geometry, order: int, outline: tuple[Curve, ...], stance: Stance
) -> list[Near]:
    """Cells at the grain, at its corners, and in a narrow gap between it and what is next to it."""
    if geometry.grain is None:
        return []
    size = GRAIN_CELL[order] * geometry.grain.size
    near = [Near(size, GROWTH, boundary="body")]
    if sharp := corners(outline, outline[1:] + outline[:1]):
        near.append(Near(CORNER_CELL * size, GROWTH, points=sharp))
    if stance.gap < 4 * size and stance.gap_ends is not None and stance.placement is not None:
        points = geometry.gap_points(stance.gap_ends, stance.placement)
        near.append(Near(GAP_CELL[order] * stance.gap, GAP_GROWTH, points=points, needed=True))
    return near


def _along_bed(geometry: Geometry, order: int, stance: Stance, layered: bool) -> list[Near]:
    """Cells along a bed with forms."""
    bed = geometry.bed
    if bed is None or not np.isfinite(bed.feature):
        return []
    away = None
    # With wall layers the drag of the forms makes the flow, and they are meshed alike all along.
    if stance.placement is not None and not layered:
        away = Away(point(stance.placement.centre), BED_GROWTH, BED_LARGEST * bed.feature)
    return [Near(BED_CELL[order] * bed.feature, GROWTH, boundary="bed", away=away)]


def _at_inflow(setup: Setup, order: int) -> Iterator[Near]:
    """Cells at the inflow where a formula for the velocity changes within one of the usual size, as at a kink."""
    domain, scene = setup.geometry.domain, setup.scene
    low, high = setup.ceiling - setup.base_flow.depth, setup.ceiling
    times = np.linspace(0.0, scene.time.end, INFLOW_SAMPLES) if scene.time is not None else [0.0]

    def velocities(heights: np.ndarray) -> np.ndarray:
        """Velocities (times, 2, n) at heights (n,)."""
        points = setup.base_flow.column((domain.left, low), heights)
        return np.array([setup.base_flow.entering(points, float(t)) for t in times])

    size = FAR_CELL[order] * domain.height
    nodes, places = np.linspace(0.0, 1.0, order + 1), (np.arange(50) + 0.5) / 50
    shapes = np.linalg.solve(np.vander(nodes).T, np.vander(places, order + 1).T)
    whole = np.abs(velocities(low + (high - low) * places)).mean(axis=2).max() * (high - low)
    waiting = list(pairwise(np.linspace(low, high, max(2, math.ceil((high - low) / size)) + 1)))
    while waiting:
        start, end = waiting.pop()
        length = end - start
        missed = velocities(start + length * places) - velocities(start + length * nodes) @ shapes
        if length < size:
            yield Near(length, GROWTH, points=((domain.left, 0.5 * (start + end)),))
        if np.abs(missed).mean(axis=2).max() * length > MISSED * whole and length > FINEST * size:
            # Not in halves, at whose ends a kink would hide.
            middle = start + UNEVEN * length
            waiting += [(start, middle), (middle, end)]


def _box(setup: Setup, cell: float) -> Grid:
    """The grid of an empty box, with cells of a size."""
    domain = setup.geometry.domain
    if setup.geometry.gdim == 3:
        return in_space.box_grid(setup.geometry, setup.sides, cell)
    sides = (domain.length, domain.height)
    ends = tuple(graded_ends(max(FEWEST[2], round(side / cell)), GRID_GRADING) for side in sides)
    extents = (domain.left, domain.right), (domain.bottom, domain.ceiling)
    return Grid(extents, ends, setup.sides.of_rectangle)

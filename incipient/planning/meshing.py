"""The region that gmsh meshes, and its cell sizes."""

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from ..geometry.placement import Placement
from ..geometry.plane.closing import Closing
from ..geometry.plane.curves import Curve, Line
from ..meshes import Away, Grid, Near, Region, Sizes, graded_ends
from ..scene import Scene
from ..setup.geometry import Geometry, Stance, point
from ..setup.numbers import time_of_change
from ..setup.setup import Setup
from . import meshing_in_space as in_space
from .cells import CLOSED, FAR_CELL, FEWEST, corners
from .discretisation import far_cells, velocity_order
from .layout import Layout
from .plan import Plan

# Cell sizes for mesh_size = 1 by order of the velocity, chosen so that the orders err alike
# (docs/contribute/defaults.md).
GRAIN_CELL = {2: 0.05, 3: 0.1, 4: 0.15}  # of the grain
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
# Along the bed below a base flow that bends next to it, in thicknesses of that layer.
PROFILE_CELL = {2: 0.5, 3: 1.0, 4: 1.5}
GRID_GRADING = 0.05  # of the cells of an empty box: spacing at walls over that in the middle


def lay_out(setup: Setup, plan: Plan, moved: Placement | None = None) -> Layout:
    """Place the grain, in the scene or where it has `moved`, and decide cell sizes."""
    scene, order = setup.scene, plan.order
    common = partial(Layout, geometry_order=plan.geometry_order, max_cells=scene.numerics.max_cells)
    if setup.is_averaged and setup.walls.plane:
        from .wall_cells import channel_grid

        return common(shape=channel_grid(setup, order, plan.mesh_size), sizes=Sizes(1.0))
    if scene.is_empty_box:
        cell = plan.mesh_size * far_cells(setup).largest
        return common(shape=_box(setup, cell), sizes=Sizes(1.0))
    closing = setup.geometry.closing if scene.closes_contacts and moved is None else None
    stance = _stance(setup, moved) if closing is None else _closed(setup, closing)
    if scene.gdim == 3:
        shape: Any = in_space.region(setup, stance.placement)
        sizes = in_space.sizes(setup, order, stance)
    else:
        shape, outline = _region(setup, stance.placement, closing)
        sizes = _sizes(setup, order, outline, stance, closing)
    sized = sizes.scaled(plan.mesh_size)
    return common(shape=shape, sizes=sized, closing=closing, **vars(stance))


def _closed(setup: Setup, closing: Closing) -> Stance:
    resting = setup.scene.placement
    return Stance(resting, resting, closing.width, (closing.left.start, closing.left.end))


def _region(
    setup: Setup, placement: Placement | None, closing: Closing | None
) -> tuple[Region, tuple[Curve, ...]]:
    scene, domain = setup.scene, setup.scene.domain
    reaches: tuple[tuple[float, float], ...] = ((domain.left, domain.right),)
    outline: tuple[Curve, ...] = ()
    holes, standing = dict[str, tuple[Curve, ...]](), dict[str, tuple[Curve, ...]]()
    if closing is not None:
        lines, outline = (closing.left, closing.right), closing.outline
        reaches = (domain.left, lines[0].start[0]), (lines[1].start[0], domain.right)
        standing = {"body": outline} | {
            name: (line,) for name, line in zip(CLOSED, lines, strict=True)
        }
    elif placement is not None:
        outline = tuple(curve.moved(placement) for curve in scene.grain.drawn())
        holes = {"body": outline}
    bottom: tuple[Curve, ...] = (Line((domain.left, domain.bottom), (domain.right, domain.bottom)),)
    if scene.bed_shape is not None:
        bottom = tuple(curve for reach in reaches for curve in scene.bed_shape.curves(*reach))
    return Region(bottom, setup.ceiling, holes, setup.sides.around, standing), outline


def _stance(setup: Setup, moved: Placement | None) -> Stance:
    stance = setup.geometry.stance if moved is None else Stance(moved, moved)
    if not setup.scene.moves or stance.placement is None:
        return stance
    near = setup.surroundings.clearance(stance.placement)
    ends = setup.geometry.halved(near.on_grain), setup.geometry.halved(near.on_other)
    return replace(stance, gap=near.distance, gap_ends=ends)


def _sizes(
    setup: Setup,
    order: int,
    outline: tuple[Curve, ...],
    stance: Stance,
    closing: Closing | None,
) -> Sizes:
    scene, domain, layers = setup.scene, setup.scene.domain, None
    far = FAR_CELL[order] * domain.height
    open_gap = stance if closing is None else Stance(stance.resting, stance.placement)
    near = [
        *_along_grain(setup.geometry, order, outline, open_gap),
        *_along_bed(scene, order, stance),
    ]
    if math.isfinite(layer := setup.base_flow.layer):
        near.append(Near(PROFILE_CELL[order] * layer, GROWTH, boundary=setup.sides.bottom))
    if setup.is_averaged:
        from . import wall_cells

        placement = stance.placement if scene.moves else scene.placement
        near.extend(wall_cells.cells(setup, order, placement))
        layers = wall_cells.layers(setup, order, math.inf)
    if scene.flow.by_formulas:
        near.extend(_at_inflow(setup, order))
    if scene.flow.moves_top:
        upper = ((domain.left, domain.ceiling), (domain.right, domain.ceiling))
        near.append(Near(0.1 * FAR_CELL[order] * domain.height, GROWTH, points=upper))
    if closing is not None:
        ends = tuple(
            end for line in (closing.left, closing.right) for end in (line.start, line.end)
        )
        near.append(Near(GAP_CELL[order] * closing.width, GAP_GROWTH, points=ends, needed=True))
    return Sizes(far, tuple(near), layers=layers)


def _along_grain(
    geometry: Geometry, order: int, outline: tuple[Curve, ...], stance: Stance
) -> list[Near]:
    grain = geometry.scene.grain
    if grain is None:
        return []
    size = GRAIN_CELL[order] * grain.size
    near = [Near(size, GROWTH, boundary="body")]
    if sharp := corners(outline, outline[1:] + outline[:1]):
        near.append(Near(CORNER_CELL * size, GROWTH, points=sharp))
    if stance.gap < 4 * size and stance.gap_ends is not None and stance.placement is not None:
        points = geometry.gap_points(stance.gap_ends, stance.placement)
        near.append(Near(GAP_CELL[order] * stance.gap, GAP_GROWTH, points=points, needed=True))
    return near


def _along_bed(scene: Scene, order: int, stance: Stance) -> list[Near]:
    bed = scene.bed_shape
    if bed is None or not np.isfinite(bed.feature):
        return []
    away = None
    # With wall layers the drag of the forms makes the flow, and they are meshed alike all along.
    if stance.placement is not None and not scene.is_averaged:
        away = Away(point(stance.placement.centre), BED_GROWTH, BED_LARGEST * bed.feature)
    return [Near(BED_CELL[order] * bed.feature, GROWTH, boundary="bed", away=away)]


def _at_inflow(setup: Setup, order: int) -> Iterator[Near]:
    domain, scene = setup.scene.domain, setup.scene
    low, high = setup.ceiling - setup.base_flow.depth, setup.ceiling
    times = np.linspace(0.0, scene.time.end, INFLOW_SAMPLES) if scene.time is not None else [0.0]

    def velocities(heights: np.ndarray) -> np.ndarray:
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
    domain = setup.scene.domain
    if setup.scene.gdim == 3:
        return in_space.box_grid(setup, cell)
    sides = (domain.length, domain.height)
    ends = tuple(graded_ends(max(FEWEST[2], round(side / cell)), GRID_GRADING) for side in sides)
    extents = (domain.left, domain.right), (domain.bottom, domain.ceiling)
    return Grid(extents, ends, setup.sides.of_rectangle)


def is_resolved(setup: Setup) -> bool:
    """Whether a cell at the grain, of second order, is within the boundary layer of an unsteady flow.

    The layer has the thickness sqrt(nu t): t is the time since the start or, if shorter, the times in which the flow
    changes or passes the grain. With higher orders as many nodes are within it.
    """
    scene, grain, viscosity = setup.scene, setup.scene.grain, setup.base_flow.viscosity
    if scene.time is None or grain is None:
        return True
    reynolds, change = setup.numbers.grain_reynolds, time_of_change(setup.base_flow, scene.time)
    times = [scene.time.end]
    if change is not None:
        times.append(change)
    if reynolds and not setup.base_flow.creeping:
        times.append(grain.size**2 / (viscosity * reynolds))
    order = velocity_order(setup)[0]
    cell = GRAIN_CELL[order]
    if scene.gdim == 3:
        cell = in_space.thinner(setup) * in_space.GRAIN_CELL[order]
    between_nodes = scene.numerics.mesh_size * cell * grain.size / order
    return 2.0 * between_nodes <= math.sqrt(viscosity * min(times))

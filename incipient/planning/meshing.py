"""The region or grid that gmsh meshes, with its cell sizes."""

import math
from dataclasses import replace

import numpy as np

from ..geometry.placement import Placement
from ..geometry.plane.closing import Closing
from ..geometry.plane.curves import Curve, Line
from ..geometry.space.beds import Plane
from ..meshes import Grid, PlacedSolid, Region, Sizes, SolidRegion, graded_ends
from ..setup.geometry import CLOSED, Stance
from ..setup.setup import Setup, time_of_change
from . import cells
from .discretisation import FEWEST, far_cell, velocity_order
from .layout import Layout
from .plan import Plan

# Of the cells of an empty box: spacing at walls over that in the middle.
GRID_GRADING = {2: 0.05, 3: 0.2}


def lay_out(setup: Setup, plan: Plan, moved: Placement | None = None) -> Layout:
    """Place the grain, in the scene or where it has `moved`, and decide cell sizes."""
    scene, order, stance, closing = setup.scene, plan.order, Stance(), None
    shape: Region | SolidRegion | Grid
    sizes = Sizes(1.0)
    if setup.is_averaged and setup.walls.plane:
        from .wall_cells import channel_grid

        shape = channel_grid(setup, order, plan.mesh_size)
    elif scene.is_empty_box:
        shape = _box(setup, plan.mesh_size * far_cell(scene, order))
    else:
        closing = setup.geometry.closing if scene.closes_contacts and moved is None else None
        stance = _stance(setup, moved, closing)
        outline: tuple[Curve, ...] = ()
        if scene.gdim == 3:
            shape = _solid_region(setup, stance.placement)
        else:
            shape, outline = _region(setup, stance.placement, closing)
        sizes = cells.sizes(setup, order, stance, outline, closing)
        if setup.is_averaged:
            from .wall_cells import with_walls

            sizes = with_walls(sizes, setup, order, stance.placement)
        sizes = sizes.scaled(plan.mesh_size)
    order, most = plan.geometry_order, scene.numerics.max_cells
    return Layout(
        **vars(stance),
        shape=shape,
        sizes=sizes,
        geometry_order=order,
        max_cells=most,
        closing=closing,
    )


def _stance(setup: Setup, moved: Placement | None, closing: Closing | None) -> Stance:
    if closing is not None:
        resting, ends = setup.scene.placement, (closing.left.start, closing.left.end)
        return Stance(resting, resting, closing.width, ends)
    stance = setup.geometry.stance if moved is None else Stance(moved, moved)
    if not setup.scene.moves or stance.placement is None:
        return stance
    near = setup.surroundings.clearance(stance.placement)
    ends = setup.geometry.halved(near.on_grain), setup.geometry.halved(near.on_other)
    return replace(stance, gap=near.distance, gap_ends=ends)


def _region(
    setup: Setup, placement: Placement | None, closing: Closing | None
) -> tuple[Region, tuple[Curve, ...]]:
    """The region of a 2-D scene, and the grain's outline within it."""
    scene, domain = setup.scene, setup.scene.domain
    reaches: tuple[tuple[float, float], ...] = ((domain.left, domain.right),)
    outline: tuple[Curve, ...] = ()
    holes, standing = dict[str, tuple[Curve, ...]](), dict[str, tuple[Curve, ...]]()
    if closing is not None:
        left, right, outline = closing.left, closing.right, closing.outline
        reaches = (domain.left, left.start[0]), (right.start[0], domain.right)
        standing = {"body": outline, CLOSED[0]: (left,), CLOSED[1]: (right,)}
    elif placement is not None:
        outline = tuple(curve.moved(placement) for curve in scene.grain.chain.curves)
        holes = {"body": outline}
    bottom: tuple[Curve, ...] = (Line((domain.left, domain.bottom), (domain.right, domain.bottom)),)
    if scene.bed_shape is not None:
        bottom = tuple(curve for reach in reaches for curve in scene.bed_shape.curves(*reach))
    return Region(bottom, setup.ceiling, holes, setup.sides.around, standing), outline


def _solid_region(setup: Setup, placement: Placement | None) -> SolidRegion:
    """The 3-D domain above the bed, less the placed grain."""
    scene, names, domain = setup.scene, setup.sides, setup.scene.domain
    return SolidRegion(
        x=(domain.left, domain.right),
        y=domain.across,
        ceiling=setup.ceiling,
        bed=scene.bed_shape or Plane(origin_z=domain.bottom),
        holes={} if placement is None else {"body": PlacedSolid(scene.grain, placement)},
        sides=(names.left, names.right, "right", "left", names.top, names.bottom),
        symmetric=setup.symmetric,
        resolved=cells.meshed_bed(setup, placement),
    )


def _box(setup: Setup, cell: float) -> Grid:
    """The grid of an empty box with cells of a mean size, finer next to walls; half of it if symmetric."""
    scene, domain, gdim, half = setup.scene, setup.scene.domain, setup.scene.gdim, setup.symmetric
    across = (setup.geometry.half,) if gdim == 3 else ()
    extents = (domain.left, domain.right), *across, (domain.bottom, domain.ceiling)
    counts = [max(FEWEST[gdim], round((high - low) / cell)) for low, high in extents]
    if gdim == 2:
        ends = [graded_ends(count, GRID_GRADING[2]) for count in counts]
    else:
        gradings = [GRID_GRADING[3], GRID_GRADING[3] if scene.sides == "wall" else 1.0] * 2
        ends = list(map(layer_ends, counts, gradings, (False, half, False)))
    return Grid(extents, tuple(ends), setup.sides.of_grid, half)


def layer_ends(layers: int, grading: float, half: bool) -> tuple[float, ...]:
    """Ends of layers across the width, as fractions of it: layers grow evenly from the sides.

    grading: thickness next to sides over that in the middle; 1: uniform
    half:    the first layer lies at the plane of symmetry
    """
    middles = (np.arange(layers) + 0.5) / layers
    away = 1.0 - middles if half else 2.0 * np.minimum(middles, 1.0 - middles)
    ends = np.cumsum(grading + (1.0 - grading) * away)
    return (*map(float, ends[:-1] / ends[-1]), 1.0)


def is_resolved(setup: Setup) -> bool:
    """Whether a cell at the grain, of second order, is within the boundary layer of an unsteady flow.

    The layer has the thickness sqrt(nu t): t is the time since the start or, if shorter, the times in which the flow
    changes or passes the grain. With higher orders as many nodes are within it.
    """
    scene, grain, viscosity = setup.scene, setup.scene.grain, setup.scene.viscosity
    if scene.time is None or grain is None:
        return True
    reynolds, change = setup.numbers.grain_reynolds, time_of_change(setup.base_flow)
    passing = grain.size**2 / (viscosity * reynolds) if reynolds else None
    times = scene.time.end, change, None if setup.base_flow.creeping else passing
    order = velocity_order(setup)[0]
    cell = cells.thinner(setup) * cells.GRAIN_CELL[scene.gdim][order]
    between_nodes = scene.numerics.mesh_size * cell * grain.size / order
    return 2.0 * between_nodes <= math.sqrt(viscosity * min(t for t in times if t is not None))

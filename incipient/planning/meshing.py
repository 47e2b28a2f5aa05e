"""Where everything is and how finely it is meshed: the scene and its plan turned into a drawing for gmsh."""

from __future__ import annotations

import math

import numpy as np

from ..arrays import Point
from ..geometry.placement import Placement
from ..geometry.plane.curves import Curve, Line
from ..installed import memory_of_libraries
from ..meshes import Away, BoxGrid, Grid, Near, Region, Sizes, SolidGrid, SolidRegion
from ..scene import Scene
from .cells import CLOSED, FAR_CELL, FEWEST, corners, largest_cell, side_names
from .clearance import ceiling, surroundings
from .effects import EffectName, moves
from .layout import Layout, closed, placed, point
from .meshing_in_space import count_in_space, lay_out_in_space
from .plan import Estimate, Plan

# Cell sizes for mesh_size = 1 by order of the velocity, chosen so that the orders err alike (docs/numerics.md).
GRAIN_CELL = {2: 0.05, 3: 0.1, 4: 0.15}  # of the grain's size, at its surface
BED_CELL = {2: 0.15, 3: 0.25, 4: 0.35}  # of the bed's smallest feature
GAP_CELL = {2: 0.5, 3: 0.75, 4: 1.0}  # of the gap between grain and bed
CORNER_CELL = 0.3  # of the grain's cells, at its corners
GROWTH, GAP_GROWTH = 0.25, 0.18  # of cell sizes with distance
# Along a bed away from the grain: how fast cells grow with the distance from it, and up to which part of the bed's
# smallest feature. There only the drag of the bed as a whole matters (docs/numerics.md).
BED_GROWTH, BED_LARGEST = 0.05, 0.6
# Along the bed below the mean profile of a turbulent stream, in thicknesses of its layer next to the bed.
PROFILE_CELL = {2: 0.5, 3: 1.0, 4: 1.5}
MEMORY_GROWTH = 194.0  # bytes per n log2 n of n unknowns; fitted, see docs/performance.md


def lay_out(scene: Scene, plan: Plan, moved: Placement | None = None) -> Layout:
    """Place the grain, where the scene has it or where it has `moved`, and decide cell sizes. Not collective."""
    most = scene.numerics.max_cells
    if plan.has(EffectName.TURBULENCE):
        from . import turbulence

        if turbulence.is_plane(scene):
            channel = turbulence.grid(scene, plan.order, plan.mesh_size)
            return Layout(channel, Sizes(1.0), plan.geometry_order, max_cells=most)
    if scene.gdim == 3:
        return lay_out_in_space(scene, plan, moved)
    if scene.is_empty_box:
        return Layout(_grid(scene, plan), Sizes(1.0), plan.geometry_order, max_cells=most)
    if scene.closes_contacts and moved is None:
        return _lay_out_closed(scene, plan)
    resting, placement, gap, ends = placed(scene) if moved is None else (moved, moved, np.inf, None)
    if moves(scene) and placement is not None:
        near = surroundings(scene).clearance(placement)
        gap, ends = near.distance, (near.on_grain, near.on_other)
    holes = {}
    if scene.grain is not None and placement is not None:
        holes["body"] = tuple(curve.moved(placement) for curve in scene.grain.drawn())
    region = Region(_bottom(scene), ceiling(scene), holes, side_names(scene))
    finer = _near(scene, plan, holes.get("body", ()), placement, gap, ends)
    sizes = Sizes(FAR_CELL[plan.order] * scene.domain.height, finer).scaled(plan.mesh_size)
    return Layout(region, sizes, plan.geometry_order, resting, placement, gap, ends, most)


def _lay_out_closed(scene: Scene, plan: Plan) -> Layout:
    """The layout where the space next to the contacts of a resting grain is closed."""
    made, domain, bed, resting = closed(scene), scene.domain, scene.bed_shape, scene.placement
    bottom = (
        *bed.curves(domain.left, made.left.start[0]),
        *bed.curves(made.right.start[0], domain.right),
    )
    lines = (made.left, made.right)
    standing = {"body": made.outline} | {name: (line,) for name, line in zip(CLOSED, lines, strict=True)}
    region = Region(bottom, ceiling(scene), {}, side_names(scene), standing)
    size = GAP_CELL[plan.order] * made.width
    ends = tuple(end for line in lines for end in (line.start, line.end))
    finer = (
        *_near(scene, plan, made.outline, resting, np.inf, None),
        Near(size, GAP_GROWTH, points=ends, needed=True),
    )
    sizes = Sizes(FAR_CELL[plan.order] * domain.height, finer).scaled(plan.mesh_size)
    most, across = scene.numerics.max_cells, (made.left.start, made.left.end)
    return Layout(region, sizes, plan.geometry_order, resting, resting, made.width, across, most, made)


def _bottom(scene: Scene) -> tuple[Curve, ...]:
    domain, bed = scene.domain, scene.bed_shape
    if bed is None:
        return (Line((domain.left, domain.bottom), (domain.right, domain.bottom)),)
    return bed.curves(domain.left, domain.right)


def _near(
    scene: Scene,
    plan: Plan,
    outline: tuple[Curve, ...],
    placement: Placement | None,
    gap: float,
    ends: tuple[Point, Point] | None,
) -> tuple[Near, ...]:
    """Where cells are smaller than away from everything."""
    near, grain, bed = [], scene.grain, scene.bed_shape
    if grain is not None:
        size = GRAIN_CELL[plan.order] * grain.size
        near.append(Near(size, GROWTH, boundary="body"))
        if sharp := corners(outline, outline[1:] + outline[:1]):
            near.append(Near(CORNER_CELL * size, GROWTH, points=sharp))
        if gap < 4 * size and ends is not None:
            points = _gap_points(scene, plan, ends)
            near.append(Near(GAP_CELL[plan.order] * gap, GAP_GROWTH, points=points, needed=True))
    if bed is not None and np.isfinite(bed.feature):
        size, away = BED_CELL[plan.order] * bed.feature, None
        # With turbulence the drag of the forms makes the stream, and they are meshed alike all along.
        if placement is not None and not scene.is_turbulent:
            away = Away(point(placement.centre), BED_GROWTH, BED_LARGEST * bed.feature)
        near.append(Near(size, GROWTH, boundary="bed", away=away))
    if scene.flow.kind == "log-law":
        from .mean_profile import mean_profile

        layer = mean_profile(scene).layer
        near.append(Near(PROFILE_CELL[plan.order] * layer, GROWTH, boundary=side_names(scene)[0]))
    if scene.is_turbulent:
        from .turbulence import cells

        near.extend(cells(scene, plan.order, placement if moves(scene) else scene.placement))
    if scene.flow.kind == "lid":
        domain = scene.domain
        upper = ((domain.left, domain.ceiling), (domain.right, domain.ceiling))
        near.append(Near(0.1 * FAR_CELL[plan.order] * domain.height, GROWTH, points=upper))
    return tuple(near)


def _gap_points(scene: Scene, plan: Plan, ends: tuple[Point, Point]) -> tuple[Point, ...]:
    """Where grain and bed nearly touch: the narrowest place, and every contact of a resting grain."""
    if not scene.rests:
        return ends if moves(scene) else (ends[0],)
    from ..geometry.touching import touching

    grain, bed, resting = scene.grain, scene.bed_shape, scene.placement
    assert grain is not None and bed is not None and resting is not None
    contacts = touching(grain, resting, bed, scene.contact_tolerance)
    return tuple(dict.fromkeys([ends[0], *(point(x) for x in contacts.points[:, :2])]))


def _grid(scene: Scene, plan: Plan) -> Grid:
    domain, cell = scene.domain, plan.mesh_size * largest_cell(scene)
    columns, rows = (max(FEWEST[2], round(side / cell)) for side in (domain.length, domain.height))
    return Grid(
        (domain.left, domain.bottom), domain.length, domain.height, columns, rows, sides=side_names(scene)
    )


def count(
    layout: Layout, order: int, dual: bool = False, solver: str = "direct", wider: Layout | None = None
) -> Estimate:
    """Cells, unknowns and memory of the flow on the layout's mesh, by making it. Not collective.

    dual:   whether the errors of a steady flow are estimated as well, with elements of one order more (see `has_dual`)
    solver: of the linear systems, a name in `fluid.solvers.SOLVERS`
    wider:  of a run for the error bars that is made while the flow is kept; in space
    """
    if isinstance(layout.shape, SolidRegion | SolidGrid | BoxGrid):
        return count_in_space(layout, order, dual, solver, wider)
    with layout.gmsh_model() as model:
        _, tags, nodes = model.mesh.getElements(2)
        cells = sum(len(t) for t in tags)
        per_cell = (layout.geometry_order + 1) * (layout.geometry_order + 2) // 2
        corners = np.concatenate([n.reshape(-1, per_cell)[:, :3] for n in nodes])
    vertices = len(np.unique(corners))
    # Euler's formula with one closed outline per hole.
    holes = len(layout.shape.holes) if isinstance(layout.shape, Region) else 0
    edges = vertices + cells - 1 + holes
    unknowns = [
        2 * _lagrange(k, vertices, edges, cells) + _lagrange(k - 1, vertices, edges, cells)
        for k in range(order, order + 1 + dual)
    ]
    return Estimate(cells, unknowns[0], memory(*unknowns))


def has_dual(scene: Scene) -> bool:
    """Whether a scene's error bars take a dual solution beside the flow. Not collective."""
    held = scene.body is not None and scene.time is None and not scene.is_turbulent
    return scene.numerics.error_bars and held


def memory(*unknowns: int) -> float:
    """MiB for systems of so many unknowns that are there at once. Not collective.

    The sparse factors of a planar mesh of n unknowns have about c n log n entries (George 1973); c was
    fitted to measured peaks, the libraries' share was measured (docs/performance.md).
    """
    entries = sum(n * math.log2(n) for n in unknowns)
    return memory_of_libraries() + MEMORY_GROWTH * entries / 2**20


def _lagrange(order: int, vertices: int, edges: int, cells: int) -> int:
    return vertices + (order - 1) * edges + (order - 1) * (order - 2) // 2 * cells

"""Where everything is in space and how finely it is meshed: the box above a bed, less the grain."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..geometry.placement import Placement
from ..geometry.space.cylinder import Cylinder
from ..geometry.space.polyhedra import Box
from ..geometry.space.terrain import Plane, Terrain
from ..installed import memory_of_libraries
from ..meshes import Away, BoxGrid, Near, PlacedSolid, Sizes, SolidGrid, SolidRegion
from ..meshes.solid_region import SYMMETRY
from ..scene import Scene
from .cells import FEWEST, largest_cell, largest_cell_in_space, layer_ends, side_names
from .clearance import ceiling, surroundings
from .effects import moves
from .layout import Layout, Place, halved, placed, point
from .linear import LOWEST_ORDER
from .meshed_bed import resolved_bed
from .plan import Estimate, Plan

# Cell sizes for mesh_size = 1 by order of the velocity (docs/space.md).
GRAIN_CELL = {2: 0.15, 3: 0.22, 4: 0.3}  # of the grain's size, at its surface
BED_CELL = {2: 0.35, 3: 0.5, 4: 0.7}  # of the bed's smallest feature
GAP_CELL = {2: 0.8, 3: 1.5, 4: 1.8}  # of the gap between grain and bed, and of narrow passages
EDGE_CELL = 0.5  # of the grain's cells, at sharp edges
GROWTH, GAP_GROWTH = 0.3, 0.22  # of cell sizes with distance
BED_GROWTH = 0.15  # along a bed away from the grain, see `meshing`
GRID_GRADING = 0.2  # of the cells of an empty box, at walls over those in the middle
BED_LARGEST = 0.6  # of the bed's smallest feature, whatever mesh_size: larger cells do not follow its surface
# Bytes per n^(4/3) of n unknowns of sparse factors; per unknown of the solver by blocks, of a higher order that is
# corrected by two levels without a matrix, and, of order two, of a flow on the mesh moved; fitted (docs/space.md).
OF_FACTORS, OF_BLOCKS, OF_CORRECTIONS, OF_MOVED = 450.0, 3000.0, 900.0, 1600.0
DENSER = 1600.0  # bytes per unknown by which matrices of order three, by blocks, are denser
# Factors of higher orders over those of order two, by measured peaks of a lid-driven cube (docs/space.md).
FULLER = {2: 1.0, 3: 1.33, 4: 1.65}
OF_EDDIES = (
    2500.0  # bytes per unknown of the flow by k and epsilon, and what solves them and the flow with them
)
# MiB of a free surface and bytes per unknown of it and what it displaces; bytes per unknown of the steady flow from
# which a run below one starts; fitted.
OF_SURFACE, OF_RISING, OF_START = 14.0, 350.0, 900.0


def lay_out_in_space(scene: Scene, plan: Plan, moved: Placement | None = None) -> Layout:
    """Place the grain, where the scene has it or where it has `moved`, and decide cell sizes. Not collective."""
    if scene.is_empty_box:
        grid = box_grid(scene, plan.mesh_size * largest_cell(scene))
        return Layout(grid, Sizes(1.0), plan.geometry_order, max_cells=scene.numerics.max_cells)
    resting, placement, gap, ends = placed(scene) if moved is None else (moved, moved, np.inf, None)
    moving = moves(scene)
    if moving and placement is not None:
        near = surroundings(scene).clearance(placement)
        gap, ends = near.distance, (halved(scene, near.on_grain), halved(scene, near.on_other))
    region = _region(scene, placement, moving)
    far = largest_cell_in_space(scene, plan.order)
    sizes = Sizes(far, tuple(_near(scene, plan, placement, gap, ends)), gap_part=GAP_CELL[plan.order])
    most = scene.numerics.max_cells
    sizes = sizes.scaled(plan.mesh_size)
    return Layout(region, sizes, plan.geometry_order, resting, placement, gap, ends, most)


def box_grid(scene: Scene, cell: float) -> BoxGrid:
    """The grid of an empty box with cells of a size on average, finer next to its walls; half of it if symmetric."""
    domain, half, sides = scene.domain, scene.symmetric, side_names(scene)
    across = (domain.middle, domain.across[1]) if half else domain.across
    extents = ((domain.left, domain.right), across, (domain.bottom, domain.ceiling))
    counts = [max(FEWEST[3], round((high - low) / cell)) for low, high in extents]
    gradings = (GRID_GRADING, GRID_GRADING if scene.sides == "wall" else 1.0, GRID_GRADING)
    ends = (
        layer_ends(n, grading, half and axis == 1)
        for axis, (n, grading) in enumerate(zip(counts, gradings, strict=True))
    )
    names = (sides[3], sides[1], SYMMETRY if half else "right", "left", sides[0], sides[2])
    return BoxGrid(extents, (*ends,), names, half)


def _region(scene: Scene, placement: Placement | None, moving: bool) -> SolidRegion:
    domain = scene.domain
    bottom, right, top, left = side_names(scene)
    holes = {} if placement is None else {"body": PlacedSolid(scene.grain, placement)}
    return SolidRegion(
        x=(domain.left, domain.right),
        y=domain.across,
        ceiling=ceiling(scene),
        bed=scene.bed_shape or Plane(origin_z=domain.bottom),
        holes=holes,
        sides=(left, right, "right", "left", top, bottom),
        symmetric=scene.symmetric,
        # The bed stays as it is when a grain goes on: wherever that may come to it is meshed.
        resolved=None if moving else resolved_bed(scene, placement),
    )


def _near(
    scene: Scene, plan: Plan, placement: Placement | None, gap: float, ends: tuple[Place, Place] | None
) -> list[Near]:
    """Where cells are smaller than away from everything."""
    near, grain, bed = [], scene.grain, scene.bed_shape
    if grain is not None:
        size = GRAIN_CELL[plan.order] * grain.size
        edged = isinstance(grain, Box) and grain.edge_radius == 0.0
        near.append(Near(EDGE_CELL * size if edged else size, GROWTH, boundary="body"))
        if gap < 4.0 * size and ends is not None:
            points = _gap_points(scene, ends)
            near.append(Near(GAP_CELL[plan.order] * gap, GAP_GROWTH, points=points, needed=True))
    if isinstance(bed, Terrain) and np.isfinite(bed.feature):
        largest, away = BED_LARGEST * bed.feature, None
        size = min(BED_CELL[plan.order] * bed.feature, largest)
        if placement is not None:
            away = Away(point(placement.centre), BED_GROWTH, largest)
        near.append(Near(size, GROWTH, boundary="bed", away=away, most=largest))
    if scene.is_turbulent:
        from .turbulence import cells

        near.extend(cells(scene, plan.order, scene.placement))
    return near


def _gap_points(scene: Scene, ends: tuple[Place, Place]) -> tuple[Place, ...]:
    """Where grain and bed nearly touch: the narrowest place, and every contact of a resting grain."""
    if not scene.rests:
        return (ends[0],)
    from ..geometry.touching import touching

    assert scene.placement is not None
    contacts = touching(scene.grain, scene.placement, scene.bed_shape, scene.contact_tolerance)
    return tuple(dict.fromkeys([ends[0], *(point(x) for x in contacts.points)]))


def count_in_space(
    layout: Layout, order: int, dual: bool = False, solver: str = "direct", wider: Layout | None = None
) -> Estimate:
    """Cells, unknowns and memory of the flow on the layout's mesh, by making it. Not collective.

    dual:   whether the errors of a steady flow are estimated as well
    solver: of the linear systems, a name of a `linear.Method`
    wider:  of a run for the error bars that is made while the flow is kept
    """
    cells, unknowns = _counted(layout)
    memory = memory_in_space(solver, unknowns, order, dual)
    if wider is not None:
        beside = memory_in_space(solver, _counted(wider)[1], order, False) - memory_of_libraries()
        memory = max(memory, memory_in_space(solver, unknowns, order, False) + beside)
    return Estimate(cells, unknowns(order), memory)


def _counted(layout: Layout) -> tuple[int, Callable[[int], int]]:
    """Cells of the layout's mesh, and unknowns on it by order of the velocity, by making it."""
    assert isinstance(layout.shape, SolidRegion | SolidGrid | BoxGrid)
    with layout.gmsh_model() as model:
        _, tags, nodes = model.mesh.getElements(3)
        cells = sum(len(t) for t in tags)
        per_cell = {1: 4, 2: 10}[layout.geometry_order]
        corners = np.concatenate([n.reshape(-1, per_cell)[:, :4] for n in nodes])
        _, tags, _ = model.mesh.getElements(2)
        outside = sum(len(t) for t in tags)
    vertices = len(np.unique(corners))
    faces = (4 * cells + outside) // 2
    edges = vertices + faces - cells - euler_number(layout.shape)
    numbers = vertices, edges, faces, cells
    return cells, lambda k: 3 * lagrange(k, *numbers) + lagrange(k - 1, *numbers)


def euler_number(region: SolidRegion | SolidGrid | BoxGrid) -> int:
    """Euler's number of a region: a whole grain is a cavity, half a grain a dent, a cylinder a tunnel."""
    if isinstance(region, SolidGrid | BoxGrid):
        return 1
    across = sum(isinstance(hole.solid, Cylinder) for hole in region.holes.values())
    return 1 - across + (0 if region.symmetric else len(region.holes) - across)


def lagrange(order: int, vertices: int, edges: int, faces: int, cells: int) -> int:
    """Nodes of continuous elements of an order on tetrahedra."""
    inner = (order - 1) * (order - 2)
    return vertices + (order - 1) * edges + inner // 2 * faces + inner * (order - 3) // 6 * cells


def memory_in_space(solver: str, unknowns: Callable[[int], int], order: int, dual: bool) -> float:
    """MiB that a flow of an order takes by a solver, and its error bars if `dual`. Not collective.

    Sparse factors of a mesh in space of n unknowns have about c n^(4/3) entries (George 1973), an iterative method
    takes memory in proportion to n; both were fitted to measured peaks. `unknowns` counts those of any order.
    """
    if solver == "direct":
        size = (
            OF_FACTORS
            * FULLER[order]
            * sum(unknowns(k) ** (4.0 / 3.0) for k in range(order, order + 1 + dual))
        )
    elif solver == "two-level":
        of_two = OF_BLOCKS + OF_MOVED * dual
        size = of_two * unknowns(LOWEST_ORDER) + OF_CORRECTIONS * unknowns(order)
    else:
        of_order = OF_BLOCKS + DENSER * (order > LOWEST_ORDER)
        size = of_order * unknowns(order) + (OF_CORRECTIONS * unknowns(order + 1) if dual else 0.0)
    return memory_of_libraries() + size / 2**20


def memory_of_eddies(scene: Scene, unknowns: int) -> float:
    """MiB that k and epsilon, and blocks that are the Jacobian's, add to those of a flow in space. Not collective."""
    return OF_EDDIES * unknowns / 2**20 if scene.gdim == 3 and scene.is_turbulent else 0.0


def memory_of_surface(scene: Scene, unknowns: int) -> float:
    """MiB that a free surface in space adds to those of a flow with so many unknowns. Not collective."""
    if scene.gdim == 2 or not scene.has_surface:
        return 0.0
    started = scene.time is not None and scene.time.start != "rest"
    return OF_SURFACE + unknowns * (OF_RISING + OF_START * started) / 2**20

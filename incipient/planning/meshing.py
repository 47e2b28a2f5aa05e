"""The geometry of a scene with its cell sizes, ready for gmsh; cells, unknowns and memory of its mesh."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import unordered_keys
from ..errors import SceneError
from ..geometry.placement import Placement
from ..installed import memory_of_libraries, required
from ..meshes import Grid, PlacedSolid, Region, SizeField, Sizes, SolidRegion, graded_ends
from ..meshes.size_map import expected_cells
from ..setup.geometry import CLOSED, Stance
from ..setup.setup import Setup, time_of_change
from . import sizes as cells
from .discretisation import FEWEST, LOWEST_ORDER, far_cell, velocity_order
from .plan import Estimate, Plan

if TYPE_CHECKING:
    from ..meshes.simplices import Simplices

# Of the cells of an empty box: spacing at walls over that in the middle.
GRID_GRADING = {2: 0.05, 3: 0.2}
STEEPEST = 0.35  # growth of coarse cells with distance
# Memory of n unknowns: bytes per n log2 n of LU factors in 2-D, per n^(4/3) in 3-D (George 1973, SIAM J. Numer. Anal.
# 10, 345), per unknown of the order that is assembled by blocks, and of a higher order without a matrix. Measured
# peaks are within a quarter (tests/unit/test_meshing_in_space.py).
MEMORY_GROWTH, OF_FACTORS, OF_BLOCKS, OF_CORRECTIONS = 194.0, 600.0, 3600.0, 900.0


@dataclass(frozen=True, kw_only=True)
class Layout(Stance):
    """A scene's geometry with the grain placed.

    max_cells: expected triangles, in 3-D tetrahedra, above which no mesh is made
    """

    shape: Region | SolidRegion | Grid
    sizes: Sizes
    geometry_order: int
    max_cells: float
    gdim: int

    def mesh(self) -> Simplices:
        """The mesh, on one rank only.

        Raises:
            MeshError: the geometry cannot be meshed.
            SceneError: too many cells are expected.
            MissingError: gmsh, or a library that it needs, is not installed.
        """
        self._require_few_cells()
        with required():
            from ..meshes.model import meshed
        return meshed(self.shape, self.sizes, self.geometry_order)

    def _require_few_cells(self) -> None:
        parts = expected_cells(self.shape, self.sizes)
        expected, most = sum(parts.values()), max(parts, key=lambda name: parts[name])
        if not expected <= self.max_cells:
            of_contact = self.resting is not self.placement and most.startswith("narrow places")
            smallest = "contact.gap" if of_contact else "numerics.mesh_size or the smallest length"
            enough = math.ceil(float(f"{1.1 * expected:.2g}"))
            raise SceneError(
                f"numerics.max_cells: a mesh of about {expected:.2g} cells is expected, most for the {most}, more than "
                f"{self.max_cells:g}; enlarge {smallest}, or allow them with --set numerics.max_cells={enough}"
            )


def coarse_sizes(factor: float, field: SizeField | None, layout: Layout) -> Layout:
    """Default cell sizes times `factor`, except in gaps and where `field` prescribes sizes."""
    return replace(layout, sizes=replace(layout.sizes.coarsened(factor, STEEPEST), field=field))


def lay_out(setup: Setup, plan: Plan, moved: Placement | None = None) -> Layout:
    """Place the grain, in the scene or where it has `moved`, and decide cell sizes."""
    scene, order = setup.scene, plan.order
    stance = setup.stance if moved is None else setup.stance_at(moved)
    shape: Region | SolidRegion | Grid
    if scene.is_averaged and setup.walls.plane:
        shape, sizes = cells.channel_grid(setup, order, plan.mesh_size), Sizes(1.0)
    elif scene.is_empty_box:
        shape, sizes = _box(setup, plan.mesh_size * far_cell(scene, order)), Sizes(1.0)
    else:
        shape = (
            _region(setup, stance) if scene.gdim == 2 else _solid_region(setup, stance.placement)
        )
        outline = shape.inner.get("body", ()) if isinstance(shape, Region) else ()
        sizes = cells.sizes(setup, order, stance, outline).scaled(plan.mesh_size)
    return Layout(
        **vars(stance),
        shape=shape,
        sizes=sizes,
        geometry_order=plan.geometry_order,
        max_cells=scene.numerics.max_cells,
        gdim=scene.gdim,
    )


def _region(setup: Setup, stance: Stance) -> Region:
    """The region of a 2-D scene; a grain whose contacts are closed stands on its bottom."""
    bed, domain, names = setup.scene.bed_shape, setup.scene.domain, setup.sides
    around = names.bottom, names.right, names.top, names.left
    if closing := stance.closing:
        left, right = closing.left, closing.right
        bottom = bed.curves(domain.left, left.start[0]) + bed.curves(right.start[0], domain.right)
        standing = {"body": closing.outline, CLOSED[0]: (left,), CLOSED[1]: (right,)}
        return Region(bottom, setup.ceiling, sides=around, standing=standing)
    holes = {}
    if placement := stance.placement:
        holes["body"] = tuple(curve.moved(placement) for curve in setup.scene.grain.chain.curves)
    return Region(bed.curves(domain.left, domain.right), setup.ceiling, holes, around)


def _solid_region(setup: Setup, placement: Placement | None) -> SolidRegion:
    """The 3-D domain above the bed, less the placed grain."""
    scene, names, domain = setup.scene, setup.sides, setup.scene.domain
    return SolidRegion(
        x=(domain.left, domain.right),
        y=domain.across,
        ceiling=setup.ceiling,
        bed=scene.bed_shape,
        holes={} if placement is None else {"body": PlacedSolid(scene.grain, placement)},
        sides=(names.left, names.right, "right", "left", names.top, names.bottom),
        symmetric=setup.symmetric,
        resolved=setup.resolved_bed(placement),
    )


def _box(setup: Setup, cell: float) -> Grid:
    """The grid of an empty box with cells of a mean size, finer next to walls; half of it if symmetric."""
    scene, domain, gdim, half = setup.scene, setup.scene.domain, setup.scene.gdim, setup.symmetric
    across = (setup.half,) if gdim == 3 else ()
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


# -- expense --------------------------------------------------------------------------------------


def count(
    layout: Layout,
    order: int,
    dual: bool = False,
    solver: str = "direct",
    wider: Layout | None = None,
) -> Estimate:
    """Cells, unknowns and memory of the flow on the layout's mesh.

    dual:   whether errors of a steady flow are estimated in elements of the next-higher order
    solver: name of a `linear.Method`; in 2-D it is direct
    wider:  of a run for the error bars while the flow stays in memory; in 3-D
    """
    cells, unknowns = _counted(layout)
    needed = [memory(layout.gdim, solver, unknowns, order, dual)]
    if wider is not None:
        beside = memory(3, solver, _counted(wider)[1], order, False) - memory_of_libraries()
        needed.append(memory(3, solver, unknowns, order, False) + beside)
    return Estimate(cells, unknowns(order), max(needed))


def _counted(layout: Layout) -> tuple[int, Callable[[int], int]]:
    """Cells, and the unknowns of Taylor-Hood elements by the order of the velocity."""
    cells, corners = layout.mesh().cells[:, : layout.gdim + 1], range(layout.gdim + 1)
    counts = []
    for number in corners[1:]:
        simplices = np.vstack([cells[:, some] for some in combinations(corners, number)])
        counts.append(len(np.unique(unordered_keys(simplices, int(cells.max()) + 1))))
    counts.append(len(cells))

    def nodes(order: int) -> int:
        """Nodes of Lagrange elements: within vertices, edges, faces and cells."""
        return sum(math.comb(order - 1, of) * count for of, count in enumerate(counts))

    return len(cells), lambda k: layout.gdim * nodes(k) + nodes(k - 1)


def memory(gdim: int, solver: str, unknowns: Callable[[int], int], order: int, dual: bool) -> float:
    """MiB of a flow with a solver, and of its error bars if `dual`."""
    orders = range(order, order + 1 + dual)
    if gdim == 2:
        size = MEMORY_GROWTH * sum(unknowns(k) * math.log2(unknowns(k)) for k in orders)
    elif solver == "direct":
        size = OF_FACTORS * sum(unknowns(k) ** (4.0 / 3.0) for k in orders)
    else:
        assembled = LOWEST_ORDER if solver == "two-level" else order
        highest = order if solver == "two-level" else order + dual
        size = OF_BLOCKS * unknowns(assembled)
        size += OF_CORRECTIONS * unknowns(highest) if highest > assembled else 0.0
    return memory_of_libraries() + size / 2**20


def memory_of_parts(setup: Setup, unknowns: int) -> float:
    """MiB that a turbulence model adds to a 3-D flow."""
    added = setup.scene.is_averaged and setup.scene.gdim == 3
    # Bytes per unknown, measured as the others are.
    return 17000.0 * unknowns / 2**20 if added else 0.0

"""Cells and unknowns, counted on the mesh that will be used, and memory."""

import math
from collections.abc import Callable
from itertools import combinations

import numpy as np

from ..arrays import Integers, unordered_keys
from ..installed import memory_of_libraries
from ..setup.setup import Setup
from .discretisation import LOWEST_ORDER, by_order
from .layout import Layout
from .plan import Estimate

# Bytes per n log2 n of n unknowns; fitted, see docs/validation/performance.md.
MEMORY_GROWTH = 194.0
# Bytes per n^(4/3) of n unknowns of sparse factors; per unknown of the solver by blocks, of a higher order that is
# corrected by two levels without a matrix, and, of order two, of a flow on the mesh moved; fitted
# (docs/contribute/defaults.md).
OF_FACTORS, OF_BLOCKS, OF_CORRECTIONS, OF_MOVED = 450.0, 3000.0, 900.0, 1600.0
DENSER = 1600.0  # extra bytes per unknown of third-order matrices, by blocks
# Factorisations of higher orders over second-order ones, by peaks of a lid-driven cube (docs/contribute/defaults.md).
FULLER = by_order(1.0, 1.33, 1.65)
# MiB of a free surface and bytes per unknown of it and what it displaces; bytes per unknown of the steady flow from
# which a run below one starts; fitted.
OF_SURFACE, OF_RISING, OF_START = 14.0, 350.0, 900.0
# Bytes per unknown of a 3-D flow, of both quantities of a model of turbulence and what solves them together with the
# flow: 2.3 GB of 105,000 unknowns past a grain of a random bed (docs/contribute/defaults.md).
OF_TURBULENCE = 17000.0


def count(
    layout: Layout,
    order: int,
    dual: bool = False,
    solver: str = "direct",
    wider: Layout | None = None,
) -> Estimate:
    """Cells, unknowns and memory of the flow on the layout's mesh.

    dual:   whether errors of a steady flow are estimated in elements of the next-higher order (see `has_dual`)
    solver: name of a `linear.Method`; in 2-D it is direct
    wider:  of a run for the error bars while the flow stays in memory; in 3-D
    """
    cells, unknowns = _counted(layout)
    needed = memory(layout.gdim, solver, unknowns, order, dual)
    if wider is not None:
        beside = memory(3, solver, _counted(wider)[1], order, False) - memory_of_libraries()
        needed = max(needed, memory(3, solver, unknowns, order, False) + beside)
    return Estimate(cells, unknowns(order), needed)


def has_dual(setup: Setup) -> bool:
    """Whether a scene's error bars need a dual solution."""
    scene = setup.scene
    held = scene.body is not None and scene.time is None and not scene.is_averaged
    return scene.numerics.error_bars and held


def _counted(layout: Layout) -> tuple[int, Callable[[int], int]]:
    gdim = layout.gdim
    corners = layout.mesh().cells[:, : gdim + 1]
    vertices, edges, faces = (_distinct(corners, number) for number in range(1, 4))
    inner = len(corners) if gdim == 3 else 0
    return len(corners), lambda k: sum(
        times * lagrange(order, vertices, edges, faces, inner)
        for times, order in ((gdim, k), (1, k - 1))
    )


def _distinct(cells: Integers, number: int) -> int:
    rows = np.concatenate(
        [cells[:, list(some)] for some in combinations(range(cells.shape[1]), number)]
    )
    return len(np.unique(unordered_keys(rows, int(cells.max()) + 1)))


def lagrange(order: int, vertices: int, edges: int, faces: int, cells: int) -> int:
    """Nodes of continuous elements of an order on tetrahedra; in 2-D on triangles, `faces` without `cells`."""
    inner = (order - 1) * (order - 2)
    return vertices + (order - 1) * edges + inner // 2 * faces + inner * (order - 3) // 6 * cells


def memory(gdim: int, solver: str, unknowns: Callable[[int], int], order: int, dual: bool) -> float:
    """MiB of a flow with a solver, and of its error bars if `dual`.

    Sparse factors of n unknowns have about c n log n entries in 2-D, c n^(4/3) in 3-D (George 1973); the memory of an
    iterative method is proportional to n. They were fitted to measured peaks (docs/validation/performance.md).
    """
    orders = range(order, order + 1 + dual)
    if gdim == 2:
        size = MEMORY_GROWTH * sum(unknowns(k) * math.log2(unknowns(k)) for k in orders)
    elif solver == "direct":
        size = OF_FACTORS * FULLER[order] * sum(unknowns(k) ** (4.0 / 3.0) for k in orders)
    elif solver == "two-level":
        of_two = OF_BLOCKS + OF_MOVED * dual
        size = of_two * unknowns(LOWEST_ORDER) + OF_CORRECTIONS * unknowns(order)
    else:
        of_order = OF_BLOCKS + DENSER * (order > LOWEST_ORDER)
        size = of_order * unknowns(order) + (OF_CORRECTIONS * unknowns(order + 1) if dual else 0.0)
    return memory_of_libraries() + size / 2**20


def memory_of_parts(setup: Setup, unknowns: int) -> float:
    """MiB that a free surface or a turbulence model adds to a 3-D flow."""
    scene = setup.scene
    if scene.gdim == 2:
        return 0.0
    turbulence = OF_TURBULENCE * unknowns / 2**20 if scene.is_averaged else 0.0
    if not scene.has_surface:
        return turbulence
    started = scene.time is not None and scene.time.start != "rest"
    return OF_SURFACE + unknowns * (OF_RISING + OF_START * started) / 2**20

"""Cells and unknowns, counted on the mesh that will be used, and memory."""

import math
from collections.abc import Callable
from itertools import combinations

import numpy as np

from ..arrays import Integers, unordered_keys
from ..installed import memory_of_libraries
from ..setup.setup import Setup
from .discretisation import LOWEST_ORDER
from .layout import Layout
from .plan import Estimate

# Memory of n unknowns: bytes per n log2 n of LU factors in 2-D, per n^(4/3) in 3-D (George 1973, SIAM J. Numer. Anal.
# 10, 345), per unknown of the order that is assembled by blocks, of a higher order without a matrix, and of a 3-D
# flow with a model of turbulence. Measured peaks are within a quarter (tests/unit/test_meshing_in_space.py).
MEMORY_GROWTH, OF_FACTORS, OF_BLOCKS, OF_CORRECTIONS = 194.0, 600.0, 3600.0, 900.0
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
    added = setup.is_averaged and setup.scene.gdim == 3
    return OF_TURBULENCE * unknowns / 2**20 if added else 0.0

"""The order and the cells of the next mesh of steady flow, from the error on the one before.

Nothing here solves: what a run to an accuracy will come to is predicted with it, too.
"""

from __future__ import annotations

from ..accuracy.coarse_runs import MODEL_MESH

ORDERS = (2, 3, 4)
# Per vertex of a large mesh, by the dimension and the order.
UNKNOWNS = {2: {2: 9, 3: 22, 4: 41}, 3: {2: 25, 3: 89, 4: 219}}
GAIN = 0.1  # what one order more is expected to leave of the error on the same mesh
COARSEST, COARSEST_UPWINDED = (
    4.0,
    MODEL_MESH,
)  # the first mesh: its cells relative to those by default
AIM = 0.6  # of the accuracy, so that the mesh expected to reach it does
MOST_MESHES = 12
# What is left of an estimated error on cells as much smaller as those are on which corrected loads are compared
# (`dual.COARSER_CELLS`): 1.5^-4.
COMPARED = 0.2
# Error of a corrected load over that estimated of the load itself, until two meshes tell it: 0.25 on 25,000 unknowns
# (sphere on a plane, G d^2/nu = 200, make certified).
OF_CORRECTED = 0.25


def highest_order(gdim: int, inertia: bool) -> int:
    """The highest order that is tried: in space with inertia two, which the block preconditioner is made for."""
    return 2 if gdim == 3 and inertia else ORDERS[-1]


def coarsest(gdim: int, inertia: bool) -> float:
    """Cells of the first mesh relative to those by default; where they are upwinded it is that of the coarse runs.

    Errors on larger ones mislead there.
    """
    return COARSEST_UPWINDED if gdim == 3 and inertia else COARSEST


def cheapest_order(order: int, excess: float, gdim: int = 2, highest: int = ORDERS[-1]) -> int:
    """The order, not below the given one, nor else above the highest, that is expected to need the fewest unknowns.

    excess: the error in elements of the given order over the accuracy asked for. One order more on the same mesh is
    expected to leave a tenth; what is then too much needs (error / accuracy)^(d/2k) times the unknowns in d dimensions.
    """

    def unknowns(k: int) -> float:
        """Unknowns expected with elements of order k, relative."""
        return UNKNOWNS[gdim][k] * max(1.0, excess * GAIN ** (k - order)) ** (0.5 * gdim / k)

    return min((k for k in ORDERS if order <= k <= max(order, highest)), key=unknowns)


def next_order(
    order: int, excess: float, gdim: int = 2, highest: int = ORDERS[-1]
) -> tuple[int, float]:
    """The order of the next mesh, and what its elements would leave on this one over the error aimed at.

    excess: the error on this mesh, in elements of `order`, over the accuracy asked for
    """
    higher = cheapest_order(order, excess / AIM, gdim, highest)
    return higher, excess / AIM * GAIN ** (higher - order)


def left_for_corrected(excess: float, of_corrected: float) -> float:
    """What is to be left of the estimated error on the next mesh, where corrected loads of two meshes are compared.

    A corrected load is known as well as that on the mesh before. If that on this mesh should be good enough, a next one
    with cells so much smaller shows it; else the next one is such that the one after it will.

    excess: the estimated error of the load as computed over the accuracy asked for
    of_corrected: error of the corrected load on this mesh over that estimated
    """
    return max(AIM / excess, min(COMPARED, AIM / (of_corrected * excess)))

"""Order, cells and time step of the next run, from the error of the previous one.

In unsteady flow with steps dt and cells h the error is e_t (dt/dt_0)^q + e_h (h/h_0)^s, with the orders q of the steps
and s of loads (`terms.order_in_space`), and the work is proportional to h^-p / dt. The work for a given total error is
least (Lagrange) with e_t : e_h = 1/q : p/s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..planning.discretisation import FAR_CELL, LEVEL, order_of
from ..planning.effects import inertia
from ..results.adaptation import Trial
from ..scene import Scene
from ..scene.numerics import MESH_SIZES, OF_SURFACE, ORDERS, Numerics
from ..setup.setup import Setup
from .coarse_runs import (
    FEWEST_STEPS,
    LONGEST_STEP,
    MODEL_MESH,
    changed,
    order_in_time,
)
from .terms import COARSEST_IN_SPACE, is_stream, order_in_space

AIM = 0.6  # fraction of the accuracy aimed at, as a margin
MOST_MESHES, MOST_RUNS = 12, 6  # steady, unsteady
GAIN = 0.1  # expected fraction of the error that the next-higher order leaves on the same mesh
# Cells of the first mesh over the default, not coarsened with upwinding; in unsteady flow also the steps.
COARSEST, COARSEST_UPWINDED, COARSEST_IN_TIME, LONGEST = 4.0, MODEL_MESH, 8.0**0.5, 8.0
# Work at one `numerics.mesh_size` over that of second order, and its power of the inverse cell size (`make bench`: 0.8
# to 1.7, 2 for uniform cells); the choice depends little on it.
WORK, WORK_POWER = {2: 1.0, 3: 1.3, 4: 1.7}, 1.5
SHORTEST, FINEST = (
    1 / 16,
    1 / 4,
)  # least factors in one step: estimates are poor for much finer runs
HIGHEST_OF_SURFACE = (
    3  # order of the velocity above which the order of the elevation, that of the cells, stays
)


# -- steady -------------------------------------------------------------------------------------------------


def highest_order(scene: Scene) -> int:
    """The highest order tried: 2 in 3-D with inertia, because of the block preconditioner."""
    return 2 if scene.gdim == 3 and inertia(Setup(scene)).present else ORDERS[-1]


def includes_all(numerics: Numerics) -> bool:
    """Whether an accuracy includes errors of gap and domain."""
    return numerics.accuracy == "verdict" or numerics.accuracy_includes == "all"


def coarsest(scene: Scene) -> float:
    """Cells of the first mesh relative to the default. In 3-D it is also moved to other gaps and domains."""
    fine = scene.gdim == 3 and (includes_all(scene.numerics) or inertia(Setup(scene)).present)
    return COARSEST_UPWINDED if fine else COARSEST


def first_size(scene: Scene, failures: int = 0) -> float:
    """`numerics.mesh_size` of the first mesh of a mean flow, after failures."""
    most = COARSEST_IN_SPACE if scene.resolves_uneven_walls else MESH_SIZES[1]
    return min(0.5**failures * COARSEST * scene.numerics.mesh_size, most)


def unknowns_per_vertex(gdim: int, order: int) -> int:
    """Unknowns of velocity and pressure per vertex of a large mesh of simplices."""
    return int(gdim * order**gdim + (order - 1) ** gdim)


def next_order(
    order: int, excess: float, gdim: int = 2, highest: int = ORDERS[-1]
) -> tuple[int, float]:
    """The order, not below the given one, with the fewest expected unknowns, and its error on this mesh over the aim.

    The next-higher order is expected to leave a tenth of the error; a remaining `excess`, the error over the aim,
    multiplies the unknowns by (error / aim)^(d/2k) in d dimensions.
    """

    def unknowns(k: int) -> float:
        return unknowns_per_vertex(gdim, k) * max(1.0, excess * GAIN ** (k - order)) ** (
            0.5 * gdim / k
        )

    best = min((k for k in ORDERS if order <= k <= max(order, highest)), key=unknowns)
    return best, excess * GAIN ** (best - order)


# -- unsteady ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Refined:
    """The next unsteady run: steps, cells and work relative to the last one, and the order."""

    shorter: float
    finer: float
    order: int
    work: float


def refined(scene: Scene, trial: Trial, left: float) -> Refined:
    """The refinement of an unsteady scene that is expected to leave a fraction of its error."""
    q, order = order_in_time(scene), order_of(scene)
    of_step, of_mesh = trial.of_step, trial.of_mesh
    if of_step is None or of_mesh is None or not math.isfinite(of_step + of_mesh):
        return halved(order)
    highest = HIGHEST_OF_SURFACE if scene.accuracy_of in OF_SURFACE else ORDERS[-1]
    # The error of a safety factor may exceed the sum of its parts.
    aim = left * (of_step + of_mesh)
    best = cheapest(of_step, of_mesh, aim, order, q, max(highest, order))
    if best.shorter < SHORTEST or best.finer < FINEST:
        return refined(scene, trial, left**0.5)
    return best


def halved(order: int) -> Refined:
    """Half the steps and cells smaller by the square root of 2, for an error of unknown origin."""
    return _with_work(0.5, 0.5**0.5, order, order)


def cheapest(
    of_step: float, of_mesh: float, aim: float, order: int, q: int, highest: int = ORDERS[-1]
) -> Refined:
    """Steps, cells and order for an error of `aim` with the least work; none coarser than before."""

    def with_order(higher: int) -> Refined:
        s = float(order_in_space(higher))
        to_step = aim / q / (1.0 / q + WORK_POWER / s)
        if of_step < to_step:
            to_step = of_step
        elif of_mesh < aim - to_step:
            to_step = aim - of_mesh
        shorter, finer = _ratio(to_step, of_step, q), _ratio(aim - to_step, of_mesh, s)
        return _with_work(shorter, finer, order, higher)

    return min((with_order(k) for k in ORDERS if order <= k <= highest), key=lambda each: each.work)


def _with_work(shorter: float, finer: float, order: int, higher: int) -> Refined:
    work = finer**-WORK_POWER / shorter * WORK[higher] / WORK[order]
    return Refined(shorter, finer, higher, work)


def _ratio(wanted: float, now: float, power: float) -> float:
    return (wanted / now) ** (1.0 / power) if now > wanted else 1.0


def first(scene: Scene) -> Scene:
    """The first unsteady scene of a search: a coarse mesh, and a few long steps.

    Below a free surface the inflow zone, at least one cell long, has the same length on all meshes.
    """
    assert scene.time is not None
    longer, cells = LONGEST, COARSEST_IN_TIME
    while longer > 1.0 and longer * scene.time.step > scene.time.end / FEWEST_STEPS:
        longer /= 2.0
    if is_stream(scene):
        size = FAR_CELL[scene.gdim][min(order_of(scene) + 1, ORDERS[-1])] * scene.numerics.mesh_size
        cells = float(np.clip(LEVEL / size, 1.0, cells))
    return _resized(scene, cells, longer)


def finer(scene: Scene, wanted: Refined) -> Scene:
    """The refined unsteady scene."""
    assert scene.time is not None
    shorter, steps = wanted.shorter, scene.time.end / scene.time.step
    if scene.time.tolerance is None and shorter < 1.0:
        # Even, and for larger numbers such that the longer steps of a comparison end at the same time.
        multiple = LONGEST_STEP if steps / shorter > LONGEST_STEP * FEWEST_STEPS else 2.0
        shorter = steps / (multiple * math.ceil(steps / shorter / multiple * (1.0 - 1e-9)))
    return changed(_resized(scene, wanted.finer, shorter), numerics={"order": wanted.order})


def _resized(scene: Scene, cells: float, steps: float) -> Scene:
    assert scene.time is not None
    time = {"step": steps * scene.time.step}
    if scene.time.tolerance is not None:
        time["tolerance"] = scene.time.tolerance * steps ** (order_in_time(scene) + 1)
    mesh_size = min(float(f"{cells * scene.numerics.mesh_size:.12g}"), MESH_SIZES[1])
    return changed(scene, numerics={"mesh_size": mesh_size}, time=time)

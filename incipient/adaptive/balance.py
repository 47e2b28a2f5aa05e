"""Time step, cell size and order with which flow in time is as accurate as asked for the least work.

With steps dt and cells h the error is e_t (dt/dt_0)^q + e_h (h/h_0)^s, q the order of the time steps and s that of
loads in the size of cells (`discretisation.order_in_space`); the work goes as 1/dt and as h^-p. Where the errors add
up to E, the least work has (Lagrange)

    e_t : e_h = 1/q : p/s,

so that an error that costs little to lessen is lessened most. Nothing here solves: what a run to an accuracy will
come to is predicted with it, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..accuracy.coarse_runs import HIGHEST_ORDER, LONGEST_STEP, changed, order_in_time
from ..accuracy.discretisation import order_in_space
from ..accuracy.waves import is_stream
from ..planning.cells import FAR_CELL, FAR_CELL_IN_SPACE
from ..planning.flow_setup import order_of
from ..planning.open_channel import LEVEL
from ..results.adaptation import Trial
from ..scene import Scene
from ..scene.numerics import OF_SURFACE

ORDERS = (2, 3, 4)
# Work on cells of one `numerics.mesh_size`, where the orders err alike, relative to that in elements of order two
# (measured, docs/accuracy.md).
WORK = {2: 1.0, 3: 1.3, 4: 1.7}
# With which power of the inverse cell size the work grows (measured: 0.8 to 1.7, two on meshes that do not grow away
# from the grain); what is best hangs little on it.
WORK_POWER = 1.5
# At most so much finer at once: estimates by a coarse run are poor for a much finer one.
SHORTEST, FINEST = 1 / 16, 1 / 4
# Cells and steps of the first run, relative to those that the scene says.
COARSEST_MESH, LONGEST = 8.0**0.5, 8.0
FEWEST_STEPS = 8
MOST_RUNS = 6
HIGHEST_OF_SURFACE = (
    3  # order of the velocity beyond which that of the elevation, which is the cells', stays
)
AIM = 0.7  # of the accuracy, so that the run expected to reach it does


@dataclass(frozen=True)
class Parts:
    """Contributions of time step and mesh to a relative error."""

    step: float
    mesh: float


@dataclass(frozen=True)
class Powers:
    """Powers q of the step in the error and p of the inverse cell size in the work, as above."""

    step: float
    work: float = WORK_POWER


@dataclass(frozen=True)
class Refined:
    """The next run: steps, cells and work relative to the last one, and the order of the elements.

    enough: whether the accuracy is expected to be reached so; otherwise it is a part of the way there
    """

    shorter: float
    finer: float
    order: int
    work: float
    enough: bool = True

    def keeps_mesh(self, order: int) -> bool:
        """Whether the mesh, and the order of the elements on it, stay."""
        return self.finer == 1.0 and self.order == order


def cheapest(
    parts: Parts, asked: float, order: int, powers: Powers, highest: int = ORDERS[-1]
) -> Refined:
    """Steps, cells and an order not below the given one for an error of `asked` with the least work.

    Neither steps nor cells become larger. parts: the errors now, together more than asked for
    highest: order above which none is taken, unless it is the given one
    """
    found = (
        _refined(parts, asked, order, k, powers)
        for k in ORDERS
        if order <= k <= max(highest, order)
    )
    wanted = min(found, key=lambda refined: refined.work)
    while wanted.shorter < SHORTEST or wanted.finer < FINEST:
        wanted = milder(wanted)
    return wanted


def halved(order: int, powers: Powers) -> Refined:
    """Steps half as long and cells smaller by the root of two, for an error of unknown origin."""
    return _with_work(0.5, 0.5**0.5, order, order, powers)


def milder(refined: Refined) -> Refined:
    """A refinement by half as much, in the logarithms of steps and cells."""
    shorter, finer = refined.shorter**0.5, refined.finer**0.5
    return replace(refined, shorter=shorter, finer=finer, work=refined.work**0.5, enough=False)


def _refined(parts: Parts, asked: float, order: int, higher: int, powers: Powers) -> Refined:
    """The refinement in elements of order `higher`, at least `order`, that of the run with these errors."""
    q, s = powers.step, float(order_in_space(higher))
    to_step = asked * (1.0 / q) / (1.0 / q + powers.work / s)
    if parts.step < to_step:
        to_step = parts.step
    elif parts.mesh < asked - to_step:
        to_step = asked - parts.mesh
    shorter, finer = _ratio(to_step, parts.step, q), _ratio(asked - to_step, parts.mesh, s)
    return _with_work(shorter, finer, order, higher, powers)


def _with_work(shorter: float, finer: float, order: int, higher: int, powers: Powers) -> Refined:
    return Refined(
        shorter, finer, higher, finer**-powers.work / shorter * WORK[higher] / WORK[order]
    )


def _ratio(wanted: float, now: float, power: float) -> float:
    return (wanted / now) ** (1.0 / power) if now > wanted else 1.0


def refined(scene: Scene, trial: Trial, aim: float) -> Refined:
    """The refinement of a scene in time that is expected to reach a relative error. Not collective."""
    powers = Powers(order_in_time(scene))
    order, of_step, of_mesh = order_of(scene).number, trial.of_step, trial.of_mesh
    if of_step is None or of_mesh is None or not math.isfinite(of_step + of_mesh):
        return halved(order, powers)
    # A safety factor may err more than its parts together.
    more = max(1.0, (trial.estimate or 0.0) / (of_step + of_mesh))
    highest = HIGHEST_OF_SURFACE if scene.accuracy_of in OF_SURFACE else HIGHEST_ORDER
    return cheapest(Parts(more * of_step, more * of_mesh), aim, order, powers, highest)


def first(scene: Scene) -> Scene:
    """The first scene of a search in time: a coarse mesh, and steps as long as leaves a few of them."""
    assert scene.time is not None
    longer = LONGEST
    while longer > 1.0 and longer * scene.time.step > scene.time.end / FEWEST_STEPS:
        longer /= 2.0
    return _resized(scene, _coarsest(scene), longer)


def _coarsest(scene: Scene) -> float:
    """Size of the cells of the first run relative to those of the scene.

    Where a stream enters below a free surface they are so small that the zone at the inflow, one cell at the least, is
    as long on all meshes, those of one order more included: else its length errs, which the comparison does not tell.
    """
    if not is_stream(scene):
        return COARSEST_MESH
    sizes = FAR_CELL if scene.gdim == 2 else FAR_CELL_IN_SPACE
    suitable = LEVEL / (
        sizes[min(order_of(scene).number + 1, HIGHEST_ORDER)] * scene.numerics.mesh_size
    )
    return float(np.clip(suitable, 1.0, COARSEST_MESH))


def finer(scene: Scene, wanted: Refined) -> Scene:
    """The scene in time refined: shorter steps, a finer mesh, another order."""
    assert scene.time is not None
    shorter = wanted.shorter
    if scene.time.tolerance is None and shorter < 1.0:
        steps = scene.time.end / scene.time.step / shorter
        # Even, and from some number on such that the longer steps of a comparison end where these do.
        multiple = LONGEST_STEP if steps > LONGEST_STEP * FEWEST_STEPS else 2.0
        shorter = (
            scene.time.end
            / scene.time.step
            / (multiple * math.ceil(steps / multiple * (1.0 - 1e-9)))
        )
    return changed(_resized(scene, wanted.finer, shorter), numerics={"order": wanted.order})


def _resized(scene: Scene, cells: float, steps: float) -> Scene:
    """The scene with cells and steps enlarged by factors; the tolerance of adaptive steps follows."""
    assert scene.time is not None
    time = {"step": steps * scene.time.step}
    if scene.time.tolerance is not None:
        time["tolerance"] = scene.time.tolerance * steps ** (order_in_time(scene) + 1)
    mesh_size = min(float(f"{cells * scene.numerics.mesh_size:.12g}"), 100.0)
    return changed(scene, numerics={"mesh_size": mesh_size}, time=time)

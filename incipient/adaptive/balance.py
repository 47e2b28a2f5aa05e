"""Time step, cell size and order with which flow in time is as accurate as asked for the least work.

With steps dt and cells h the error is e_t (dt/dt_0)^q + e_h (h/h_0)^s, q the order of the time steps and s that of
loads in the size of cells (`discretisation.order_in_space`); the work goes as 1/dt and as h^-p. Where the errors add
up to E, the least work has (Lagrange)

    e_t : e_h = 1/q : p/s,

so that an error that costs little to lessen is lessened most. Pure numbers: nothing here knows of a mesh.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..accuracy.discretisation import order_in_space

ORDERS = (2, 3, 4)
# Work on cells of one `numerics.mesh_size`, where the orders err alike, relative to that in elements of order two
# (measured, docs/accuracy.md).
WORK = {2: 1.0, 3: 1.3, 4: 1.7}
# With which power of the inverse cell size the work grows (measured: 0.8 to 1.7, two on meshes that do not grow away
# from the grain); what is best hangs little on it.
WORK_POWER = 1.5
# At most so much finer at once: what a coarse run tells of the error of a much finer one is not worth much.
SHORTEST, FINEST = 1 / 16, 1 / 4


@dataclass(frozen=True)
class Parts:
    """What step and mesh each contribute to a relative error."""

    step: float
    mesh: float


@dataclass(frozen=True)
class Powers:
    """How the error goes with the step, and the work with the cell size: q and p above."""

    step: float
    work: float = WORK_POWER


@dataclass(frozen=True)
class Refined:
    """Steps and cells relative to before, the order of the elements, and the work relative to before.

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


def cheapest(parts: Parts, asked: float, order: int, powers: Powers, highest: int = ORDERS[-1]) -> Refined:
    """Steps, cells and an order not below the given one for an error of `asked` with the least work.

    Neither steps nor cells become larger. parts: the errors now, together more than asked for
    highest: order above which none is taken, unless it is the given one
    """
    found = (_refined(parts, asked, order, k, powers) for k in ORDERS if order <= k <= max(highest, order))
    wanted = min(found, key=lambda refined: refined.work)
    while wanted.shorter < SHORTEST or wanted.finer < FINEST:
        wanted = milder(wanted)
    return wanted


def halved(order: int, powers: Powers) -> Refined:
    """Steps half as long and cells smaller by the root of two: where it is not known what errs."""
    return _with_work(0.5, 0.5**0.5, order, order, powers)


def milder(refined: Refined) -> Refined:
    """Half of the way there, in the logarithms."""
    shorter, finer = refined.shorter**0.5, refined.finer**0.5
    return replace(refined, shorter=shorter, finer=finer, work=refined.work**0.5, enough=False)


def _refined(parts: Parts, asked: float, order: int, higher: int, powers: Powers) -> Refined:
    """Where all is done in elements of an order `higher` than that of the run whose errors these are, or of that."""
    q, s = powers.step, float(order_in_space(higher))
    to_step = asked * (1.0 / q) / (1.0 / q + powers.work / s)
    if parts.step < to_step:
        to_step = parts.step
    elif parts.mesh < asked - to_step:
        to_step = asked - parts.mesh
    shorter, finer = _ratio(to_step, parts.step, q), _ratio(asked - to_step, parts.mesh, s)
    return _with_work(shorter, finer, order, higher, powers)


def _with_work(shorter: float, finer: float, order: int, higher: int, powers: Powers) -> Refined:
    return Refined(shorter, finer, higher, finer**-powers.work / shorter * WORK[higher] / WORK[order])


def _ratio(wanted: float, now: float, power: float) -> float:
    return (wanted / now) ** (1.0 / power) if now > wanted else 1.0

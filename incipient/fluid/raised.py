"""Flows in elements of a higher order that stand on the same flow in elements of a lower one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace

from ..mesh.domain import Domain
from .conditions import Condition
from .flow import Fluid
from .model import FlowModel
from .solvers import Direct

LOWEST_ORDER = 2


def made(
    domain: Domain, model: FlowModel, conditions: Sequence[Condition], reynolds: float
) -> Fluid:
    """The fluid of a model, and that of order two where its systems are solved by two levels. Collective.

    The latter is `Fluid.coarse`, is freed with it, and counts for the same statistics.
    """
    if model.solver != "two-level":
        return Fluid(domain, model, conditions, reynolds)
    coarse = Fluid(domain, replace(model, order=LOWEST_ORDER, solver="block"), conditions, reynolds)
    with ExitStack() as on_failure:
        on_failure.push(coarse)
        fluid = Fluid(domain, model, conditions, reynolds, coarse)
        on_failure.pop_all()
    fluid.solver.statistics = coarse.solver.statistics
    fluid.holding(coarse)
    return fluid


@contextmanager
def lowered(fluid: Fluid) -> Iterator[Fluid]:
    """The flow of order two of a fluid, or a temporary one, with the fluid's state. Collective."""
    if fluid.coarse is not None:
        fluid.coarse.interpolate(fluid)
        yield fluid.coarse
        return
    with fluid.at_order(LOWEST_ORDER) as coarse:
        coarse.interpolate(fluid)
        yield coarse
        fluid.solver.statistics.add(coarse.solver.statistics)


def enriched(fluid: Fluid) -> Fluid:
    """A copy of a solved flow in elements of the next-higher order; the caller destroys it before that. Collective.

    Where the flow's solver iterates, it helps that of the copy. The copy's Jacobian then is upwinded as the flow is,
    its residual not at all: what is left of it is what the flow's elements cannot see, and what upwinding changed.
    """
    order, model = fluid.model.order, fluid.model
    if isinstance(fluid.solver, Direct):
        return fluid.at_order(order + 1)
    model = replace(model, order=order + 1, upwind_order=model.upwind_order or order, exact=True)
    return Fluid(fluid.domain, model, fluid.conditions, fluid.reynolds, fluid.coarse or fluid)

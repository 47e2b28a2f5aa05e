"""The effects of a run: their terms and their output quantities."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from ..planning.effects import Decision, EffectName, accuracy_asked
from ..planning.plan import Plan
from ..results.kinds import FLOW, LOADS, VERDICT
from ..results.left_out import Omission
from ..results.loads import Forces, Torques
from ..results.quantity import OutputQuantity
from ..setup.setup import Setup
from . import omitted
from .moving_grain import QUANTITIES as OF_PATH
from .turbulence import QUANTITIES as QUANTITIES

if TYPE_CHECKING:
    from ..fluid import FlowModel
    from ..simulation.state import Run


@dataclass(frozen=True, eq=False)
class Solved:
    """Computed flow with omitted effects; loads and verdict may be missing."""

    run: Run
    force: Forces | None
    torque: Torques | None
    verdict: dict[str, Any] | None


@dataclass(frozen=True)
class Effect:
    """What one physical effect adds to a run, by default nothing; `planning.effects` decides on it.

    quantities: output quantities of a run with the effect
    terms:      the flow model with the effect's terms, of the unsteady flow or its steady start
    left_out:   estimated changes by the omitted effect; collective
    """

    name: EffectName
    quantities: tuple[OutputQuantity, ...] = ()
    terms: Callable[[FlowModel, Setup, Plan, bool], FlowModel] = lambda model, *others: model
    left_out: Callable[[Solved, Decision], Iterator[Omission]] = lambda *others: iter(())


def add_base_flow(model: FlowModel, setup: Setup, plan: Plan, unsteady: bool) -> FlowModel:
    """The force of the fluctuations of a turbulent base flow on its mean profile."""
    return replace(model, body_force=setup.base_flow.body_force)


def add_convection(model: FlowModel, setup: Setup, plan: Plan, unsteady: bool) -> FlowModel:
    """Stabilised convection, upwinded in the steady start of unsteady flow."""
    start = plan.has(EffectName.UNSTEADINESS) and not unsteady
    upwind = plan.stabilisation.upwind or (start and plan.solver.name == "block")
    stabilised = plan.stabilisation.present and not upwind
    return replace(model, inertia=True, stabilisation=stabilised, upwind=upwind)


def add_rate_of_change(model: FlowModel, setup: Setup, plan: Plan, unsteady: bool) -> FlowModel:
    """The rate of change of unsteady flow, with the force of a gust."""
    if not unsteady:
        return model
    from ..setup.driving_force import driven

    force = driven(setup.base_flow, setup.scene.grain)
    return replace(model, unsteady=True, convection=plan.convection, driven=force)


def add_mesh_motion(model: FlowModel, setup: Setup, plan: Plan, unsteady: bool) -> FlowModel:
    """The velocity of the mesh, in unsteady flow."""
    return replace(model, moving_mesh=unsteady)


def _largest_of_cells(run: Run) -> float:
    from ..fluid.derived import measured_cell_reynolds

    return measured_cell_reynolds(run.fluid)


CELL_REYNOLDS = OutputQuantity(
    "measured_cell_reynolds",
    "largest Reynolds number of a cell",
    heading="other numbers",
    measure=_largest_of_cells,
)


# In the order of plans and results.
EFFECTS: tuple[Effect, ...] = (
    Effect(
        EffectName.INERTIA,
        (CELL_REYNOLDS,),
        add_convection,
        left_out=omitted.without_inertia,
    ),
    Effect(
        EffectName.UNSTEADINESS, terms=add_rate_of_change, left_out=omitted.without_unsteadiness
    ),
    Effect(EffectName.TRACTION, LOADS),
    Effect(EffectName.GRAVITY, left_out=omitted.without_gravity),
    Effect(EffectName.CONTACT, VERDICT, left_out=omitted.without_contact),
    Effect(EffectName.FLOW, FLOW, add_base_flow),
    Effect(EffectName.MOVING_MESH, terms=add_mesh_motion),
    Effect(EffectName.FREE_BODY, OF_PATH, left_out=omitted.without_motion),
    Effect(EffectName.FREE_SURFACE, left_out=omitted.without_free_surface),
    Effect(EffectName.TURBULENCE, QUANTITIES, left_out=omitted.without_turbulence),
)


def quantities(plan: Plan | None = None) -> tuple[OutputQuantity, ...]:
    """Output quantities of the effects in a plan, or of all effects."""
    present = (effect for effect in EFFECTS if plan is None or plan.has(effect.name))
    return tuple(one for effect in present for one in effect.quantities)


def omissions(solved: Solved) -> tuple[Omission, ...]:
    """Omitted effects that the scene has, with their estimated changes. Collective."""
    plan, accuracy = solved.run.plan, accuracy_asked(solved.run.scene.numerics)
    decided = {decision.name: decision for decision in plan.effects if not decision.present}
    return tuple(
        replace(one, exceeds=one.exceeds if one.relative is None else one.relative > accuracy)
        for effect in EFFECTS
        if effect.name in decided
        for one in effect.left_out(solved, decided[effect.name])
    )

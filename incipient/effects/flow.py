"""Terms of the flow, and what it changes to leave inertia or the rate of change out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from ..planning.effects import Decision, EffectName, shedding
from ..planning.plan import Plan
from ..results.left_out import Omission
from ..results.quantity import OutputQuantity
from ..setup.setup import Setup
from .effect import Solved
from .run_part import Solving

if TYPE_CHECKING:
    from ..fluid import FlowModel


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


def _largest_of_cells(run: Solving) -> float:
    from ..fluid.derived import measured_cell_reynolds

    return measured_cell_reynolds(run.fluid)


CELL_REYNOLDS = OutputQuantity(
    "measured_cell_reynolds",
    "largest Reynolds number of a cell",
    heading="other numbers",
    measure=_largest_of_cells,
)


def without_inertia(solved: Solved, decision: Decision) -> Iterator[Omission]:
    """Dual-weighted convection, or Oseen's term without error bars."""
    if decision.expected == 0.0:
        return
    remedy = "set fluid.inertia = true and effects.inertia = true"
    if not solved.run.scene.numerics.error_bars:
        how = "at most, from Oseen's term"
        yield Omission(decision.name, decision.expected, how, False, remedy)
        return
    from ..forms.terms import convection
    from .missing_term import weighted

    where = solved.run.fluid.reference_map
    yield weighted(solved, decision.name, lambda v, w: convection(v, v, w, where), remedy)


def without_unsteadiness(solved: Solved, decision: Decision) -> Iterator[Omission]:
    """Risk of vortex shedding, or the dual-weighted time derivative of quasi-steady flow."""
    run, name = solved.run, decision.name
    if run.scene.time is None:
        if risk := shedding(Setup(run.scene)):
            yield Omission(name, None, risk, True, "add a section [time]")
        return
    remedy, transient = 'set effects.unsteadiness = "auto"', run.time_stepper
    if not run.scene.numerics.error_bars or transient is None or not transient.past:
        how = "history force, pressure gradient and added mass, leading terms"
        yield Omission(name, decision.expected, how, False, remedy)
        return
    from ..forms.terms import inertia
    from .missing_term import weighted

    before, rate, fluid = transient.past[0], run.fluid.velocity, run.fluid
    values, length = fluid.state.x.array - before.state, fluid.time - before.time
    rate.x.array[:] = values[fluid.space.velocity_map] / length
    yield weighted(solved, name, lambda v, w: inertia(rate, w, fluid.reference_map), remedy)

"""Steady flow of a run at any speed, and its loads."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ..arrays import Floats
from ..planning.discretisation import of_steady, stabilisation_of
from .build import probe_of
from .loads import load_on_grain
from .state import Run

if TYPE_CHECKING:
    from ..coupled.turbulent_flow import TurbulentFlow
    from ..fluid import Fluid

# Reynolds number above which continuation begins at a fraction.
LARGE = 500.0
# Smallest relative step of the continuation between two flows.
SMALLEST_SHARE = 0.02


def solve_steadily(run: Run, fluid: Fluid, **way: float) -> None:
    """Solve for the steady flow of the run's scene; `way`: arguments of `fluid.solve_steady`.

    Collective; raises ConvergenceError.
    """
    from ..fluid import solve_steady

    numerics = run.scene.numerics
    tolerance = of_steady(numerics.tolerance, fluid.coarse is not None)
    # Start with the full Reynolds number unless it is large.
    whole = fluid.reynolds * run.setup.base_flow.mean_speed * run.scene.domain.height
    share = min(1.0, LARGE / whole) if run.plan.has("inertia") else 1.0
    with run.stage("flow"):
        watch = run.corrections.of_steady(run.voice.iterate)
        reports = solve_steady(
            fluid, tolerance, numerics.max_iterations, first_share=share, watch=watch, **way
        )
    run.accounts.iterations.update(
        continuation=len(reports), newton=sum(report.iterations for report in reports)
    )


def solve_with_turbulence(
    run: Run,
    fluid: Fluid,
    turbulence: TurbulentFlow | None,
    near: Run | None = None,
    factor: float = 1.0,
    start: float = 0.0,
) -> None:
    """Solve for the steady flow of a fluid, with its turbulence if any. Collective; raises ConvergenceError.

    near: a run of a similar scene, with whose turbulent flow the iteration begins.
    factor: of the scene's speed, which a fluid without turbulence already has. start: factor of the present state, if
        continued.
    """
    if turbulence is None:
        way = {"reached": start / factor, "smallest_step": SMALLEST_SHARE} if start else {}
        solve_steadily(run, fluid, **way)
        return
    before = None if start or near is None else near.turbulence
    if before is not None:
        turbulence.begin_near(before)
    turbulence.solve(run, factor, onwards=before is not None or start > 0.0)


def loads_at(run: Run, factor: float, start: float = 0.0, near: Run | None = None) -> Floats:
    """Force and torque (6,) in the steady flow times a factor, at the same viscosity. Collective.

    In units of that flow only the Reynolds number changes, and forces scale with the factor
    squared. `start`: factor of the present state, if continued; `near`: see `solve_with_turbulence`.

    Raises ConvergenceError; the fluid keeps the last converged flow.
    """
    if run.turbulence is None:
        make_as_fast(run, factor)
    solve_with_turbulence(run, run.fluid, run.turbulence, near, factor, start)
    return load_on_grain(run, factor)


def unit_of(run: Run, speed: float) -> float:
    """Loads at a speed over those of the computed flow; close to one except in Stokes flow."""
    return speed * run.fluid.reynolds / run.plan.reynolds


def make_as_fast(run: Run, factor: float) -> None:
    """Set the fluid's equations and conditions, not its state, to the flow times a factor. Collective."""
    from ..fluid import Fluid

    before, model = run.fluid, run.fluid.model
    stabilisation = stabilisation_of(run.setup, model.inertia, factor)
    stabilised = stabilisation.present and not stabilisation.upwind
    if stabilised != model.stabilisation:
        model = replace(model, stabilisation=stabilised)
        fluid = Fluid(run.domain, model, before.conditions, before.reynolds)
        fluid.state.x.array[:] = before.state.x.array
        run.take_fluid(fluid, probe_of(fluid, run.layout))
    run.fluid.reynolds = factor * run.plan.reynolds
    if run.setup.base_flow_at(0.0).datum != run.setup.base_flow.datum:
        from ..planning.conditions import conditions

        run.fluid.let_in(conditions(run.setup, speed=factor))

"""The steady flow of a run, also of a faster base flow, and the loads in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from ..effects.run_part import RunPart
from ..planning.conditions import conditions
from ..planning.effects import EffectName
from ..planning.stabilisation import stabilisation_of
from ..planning.tolerance import of_steady
from ..results.loads import Forces, Torques
from .build import probe_of
from .loads import loads
from .state import Run

if TYPE_CHECKING:
    from ..fluid import Fluid

# Reynolds number of the whole flow from which the continuation begins with a share of it.
LARGE = 200.0
# Smallest share of the way from one flow to a faster one that is tried.
SMALLEST_SHARE = 0.02


def solve_steadily(run: Run, fluid: Fluid, **way: float) -> None:
    """Find the steady flow of a fluid, the run's own or another one for its scene. Collective; raises ConvergenceError.

    `way` may name what `fluid.solve_steady` takes besides.
    """
    from ..fluid import solve_steady

    numerics = run.scene.numerics
    tolerance = of_steady(numerics.tolerance, fluid.coarse is not None)
    # The continuation starts at once, unless the Reynolds number of the whole flow is large.
    whole = fluid.reynolds * run.setup.base_flow.mean_speed * run.scene.domain.height
    share = min(1.0, LARGE / whole) if run.plan.has(EffectName.INERTIA) else 1.0
    with run.stage("flow"), run.corrections.begun():
        watch = run.corrections.watched_by(run.voice.iterate)
        steps = solve_steady(
            fluid, tolerance, numerics.max_iterations, first_share=share, watch=watch, **way
        )
        run.corrections.book_steady(steps)
    run.accounts.count(
        continuation=len(steps), newton=sum(step.report.iterations for step in steps)
    )


def solve_with_parts(run: Run, fluid: Fluid, parts: Sequence[RunPart]) -> None:
    """Find the steady flow of a fluid with the parts that it depends on. Collective; raises ConvergenceError."""
    if not any(part.solve(run) for part in parts):
        solve_steadily(run, fluid)


def loads_at(run: Run, factor: float, start: float = 0.0) -> tuple[Forces, Torques]:
    """Solve steadily with the flow faster by a factor at the same viscosity; the loads then. Collective.

    In units of the faster flow only the Reynolds number changes, so the mesh, the forms and the last
    solution serve again; forces go back to scene units with the factor squared. `start` is the factor of
    the flow that the state is that of, if it is one to continue from.

    Raises:
        ConvergenceError: the fluid then holds the last converged flow, at its Reynolds number.
    """
    if any(part.solve(run, factor, onwards=start > 0.0) for part in run.parts):
        return loads(run, surface=False, speed=factor)
    make_as_fast(run, factor)
    way = {"reached": start / factor, "smallest_step": SMALLEST_SHARE} if start else {}
    solve_steadily(run, run.fluid, **way)
    return loads(run, surface=False, speed=factor)


def make_as_fast(run: Run, factor: float) -> None:
    """Make the fluid's equations and conditions those of the flow faster by a factor, not its state. Collective."""
    _stabilise(run, factor)
    run.fluid.reynolds = factor * run.plan.reynolds
    if run.setup.base_flow_at(0.0).datum != run.setup.base_flow.datum:
        run.fluid.let_in(conditions(run.setup, speed=factor))


def _stabilise(run: Run, factor: float) -> None:
    """Continue with a fluid whose convection is stabilised, or not, as for the flow faster by a factor. Collective."""
    from ..fluid import Fluid

    before, model = run.fluid, run.fluid.model
    found = stabilisation_of(run.setup, model.inertia, factor)
    wanted = found.present and not found.upwind
    if wanted == model.stabilisation:
        return
    fluid = Fluid(
        run.domain, replace(model, stabilisation=wanted), before.conditions, before.reynolds
    )
    fluid.state.x.array[:] = before.state.x.array
    run.take_fluid(fluid, probe_of(fluid, run.layout))

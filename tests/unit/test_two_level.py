"""Corrections by two levels: they solve the discrete flow of one order more, and a first one tells its forces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import ufl
from domains import ball_in_box
from test_block import stream

from incipient import compat
from incipient.accuracy.dual import GoalErrors
from incipient.coupled.tractions import TractionProbe
from incipient.errors import ConvergenceError
from incipient.fluid import FlowModel, Fluid, Prescribed, no_slip, solve_steady
from incipient.fluid.flow import enriched
from incipient.fluid.solvers import TwoLevel, two_level

CENTRE = (0.6, 0.5, 0.5)
REYNOLDS = 5.0


def around_a_ball(inertia: bool, cell: float = 0.6) -> Fluid:
    """In a closed box, whose pressure has no level; cells are curved."""
    conditions = [Prescribed("outer", stream), no_slip("body")]
    model = FlowModel(inertia=inertia, upwind=inertia, solver="block")
    return Fluid(ball_in_box(cell), model, conditions, REYNOLDS)


def load_of(fluid: Fluid) -> np.ndarray:
    found = TractionProbe(fluid, "body", CENTRE).resultant()
    return np.concatenate([found.force, found.torque])


@pytest.mark.parametrize("inertia", [True, False])
def test_a_first_correction_tells_the_load_of_one_order_more(inertia: bool) -> None:
    """Three corrections make the assembled residual of that order vanish: the action is not asked for it.

    Each leaves at most a twentieth of a residual, and Newton's method the square of what was wrong. The weighted
    residual with the solution of the transposed system is the same error once more. Bounds: what is left of the
    first residual is a twentieth, whose share of the load is not known beforehand.
    """
    with around_a_ball(inertia) as fluid:
        assert fluid.solve(1e-8).converged
        with GoalErrors(fluid, "body", CENTRE) as goals:
            finer = goals.finer
            assert isinstance(finer.solver, TwoLevel) and finer.space.order == 3
            estimate = np.concatenate([goals.force, goals.torque])
            along_it = estimate / np.linalg.norm(estimate)
            by_shares = goals.shares(along_it).sum()
            before = size_of_residual(finer, goals._before)
            for _ in range(2):
                finer.correct()
            assert size_of_residual(finer, finer.state.x.array) < 2e-3 * before
            error = load_of(fluid) - load_of(finer)
        assert np.linalg.norm(estimate - error) < 0.2 * np.linalg.norm(error)
        assert by_shares == pytest.approx(along_it @ error, rel=0.05)


def size_of_residual(fluid: Fluid, state: np.ndarray) -> float:
    """Of the equations where no condition holds."""
    now = fluid.state.x.array.copy()
    fluid.state.x.array[:] = state
    residual = fluid.residual()
    fluid.state.x.array[:] = now
    return float(np.linalg.norm(residual[~fluid._equations().owned_held()]))


def test_flow_of_higher_order_is_that_of_the_direct_solver() -> None:
    """In creeping flow, from the flow of order two beside it, whose loads are left as they were."""
    conditions = [Prescribed("outer", stream), no_slip("body")]
    domain, model = ball_in_box(0.6), FlowModel(inertia=False, order=3, solver="two-level")
    with (
        Fluid(domain, model, conditions, REYNOLDS) as fluid,
        Fluid(domain, replace(model, solver="direct"), conditions, REYNOLDS) as direct,
    ):
        assert isinstance(fluid.solver, TwoLevel) and fluid.coarse is not None
        (*_, last) = solve_steady(fluid, 1e-7)
        direct.solve(1e-10)
        assert last.report.converged and last.order == 3
        assert np.abs(load_of(fluid) - load_of(direct)).max() < 1e-5 * np.abs(load_of(direct)).max()
        assert fluid.coarse.space.order == 2 and load_of(fluid.coarse)[0] != load_of(fluid)[0]
        fluid.reynolds = 0.5 * REYNOLDS
        assert fluid.coarse.reynolds == 0.5 * REYNOLDS


def test_upwinding_leaves_the_residual_of_a_correction() -> None:
    """What it changes then is part of the estimate; at this speed the cells' Peclet numbers are above one."""
    with around_a_ball(inertia=True) as fluid:
        fluid.reynolds = 1e3
        with enriched(fluid) as finer:
            places = finer.space.velocity_map
            finer.state.x.array[places] = np.linspace(1.0, 2.0, len(places))
            w, q = ufl.TestFunctions(finer.space.mixed)
            plain, upwinded = (
                finer.assembled(compat.form(finer.residual_form(w, q, upwind=upwind)))
                for upwind in (False, True)
            )
            found = finer.residual()
    size = np.linalg.norm(found)
    assert (
        np.linalg.norm(found - plain) < 1e-12 * size
        and np.linalg.norm(found - upwinded) > 1e-3 * size
    )


def test_what_is_not_found_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """The estimate then is not there, and the flow's bars say so."""
    monkeypatch.setattr(two_level, "MOST_CYCLES", 1)
    with around_a_ball(inertia=False) as fluid:
        fluid.solve(1e-8)
        with pytest.raises(
            ConvergenceError, match="a higher order did not converge in 5 iterations"
        ):
            GoalErrors(fluid, "body", CENTRE)


@pytest.mark.parametrize("transposed", [False, True])
def test_forces_of_pressures_are_those_of_the_action(transposed: bool) -> None:
    """With upwinding, at the state taken last; the matrix spares an action at each step of the smoother."""
    with around_a_ball(inertia=True) as fluid:
        fluid.reynolds = 1e3
        with enriched(fluid) as finer:
            solver = finer.solver
            assert isinstance(solver, TwoLevel)
            places, held = finer.space.velocity_map, finer._equations().owned_held()
            finer.state.x.array[places] = np.linspace(1.0, 2.0, len(places))
            pressures = np.zeros(len(held))
            pressures[finer.space.pressure_map] = np.sin(np.arange(len(finer.space.pressure_map)))
            pressures[held] = 0.0
            velocities = np.setdiff1d(places, np.flatnonzero(held))
            for factor in (1.0, -0.5):
                finer.state.x.array[places] *= factor
                solver._pressure_force.renew()
                exact = solver._times(pressures, transposed)[velocities]
                found = solver._pressure_force.times(pressures, transposed)[velocities]
                assert found == pytest.approx(exact, abs=1e-10 * np.abs(exact).max())

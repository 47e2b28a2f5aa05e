"""The iterative solver by blocks gives what the direct one gives, in a number of iterations that stays."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from domains import SIDES, ball_in_box, unit_box
from petsc4py import PETSc

from incipient import compat
from incipient.errors import ConvergenceError
from incipient.fluid import (
    Condition,
    FlowModel,
    Fluid,
    Open,
    Prescribed,
    Slip,
    no_slip,
    solve_steady,
)
from incipient.fluid.projection import Projection
from incipient.fluid.space import boundary_blocks
from incipient.fluid.transient import Transient
from incipient.mesh.domain import Domain

RTOL = 1e-10
STOKES = FlowModel(inertia=False)


def stream(x: np.ndarray, t: float) -> np.ndarray:
    return np.vstack([np.sin(2 * x[1]) + x[2], x[0] ** 2, 0 * x[0]])


def lid(x: np.ndarray, t: float) -> np.ndarray:
    return np.vstack([16 * x[0] * (1 - x[0]), 0 * x[0], 0 * x[0]])


def channel(gdim: int) -> list[Condition]:
    """An open channel between planes through which nothing flows, each along another axis."""
    sides = [Slip("top", axis=1), *([Slip("back", axis=2)] if gdim == 3 else [])]
    walls = [no_slip("bottom"), *([no_slip("front")] if gdim == 3 else [])]
    return [Open("right"), *sides, Prescribed("left", stream), *walls]


def box(gdim: int) -> list[Condition]:
    """A closed box driven by its lid: the pressure has no level of its own."""
    return [*(no_slip(name) for name in SIDES[: 2 * gdim] if name != "top"), Prescribed("top", lid)]


def without_level(fluid: Fluid, state: np.ndarray) -> np.ndarray:
    """The state with a mean pressure of zero where only its differences count."""
    places = fluid.space.pressure_map
    found = state.copy()
    if fluid.constraints.closed:
        found[places] -= found[places].mean()
    return found


def wall_motion(fluid: Fluid) -> np.ndarray:
    """A state that is a translation of the bottom along itself: it lets nothing through."""
    blocks = boundary_blocks(fluid.space.velocity, fluid.domain.facets_of("bottom"))
    values = np.zeros_like(fluid.state.x.array)
    values[fluid.space.velocity_map.reshape(-1, fluid.space.gdim)[blocks, 0]] = 1.0
    return values


def solved(
    domain: Domain, model: FlowModel, conditions: list[Condition], reynolds: float = 10.0
) -> tuple[np.ndarray, np.ndarray]:
    """The flow and a dual solution, pressures without a level."""
    with Fluid(domain, model, conditions, reynolds) as fluid:
        assert fluid.solve(RTOL).converged
        fluid.correct()  # by the Jacobian of the solution
        dual = fluid.dual(wall_motion(fluid))
        return without_level(fluid, fluid.state.x.array), without_level(fluid, dual)


def block(model: FlowModel) -> FlowModel:
    return replace(model, solver="block")


@pytest.mark.parametrize("gdim", [2, 3])
@pytest.mark.parametrize("conditions", [channel, box])
def test_steady_flow_with_inertia_and_its_dual_are_those_of_the_direct_solver(
    conditions: Any, gdim: int
) -> None:
    """The transposed operator convects the other way; differences as in Stokes flow."""
    domain, model = unit_box(gdim, 6 if gdim == 2 else 3), FlowModel(upwind=True)
    direct, blocks = (solved(domain, m, conditions(gdim), 20.0) for m in (model, block(model)))
    for one, other, tolerance in zip(direct, blocks, (1e-8, 1e-6), strict=True):
        assert other == pytest.approx(one, abs=tolerance * np.abs(one).max())


@pytest.mark.parametrize("convection", ["implicit", "extrapolated"])
@pytest.mark.parametrize("conditions", [channel, box])
def test_steps_in_time_are_those_of_the_direct_solver(conditions: Any, convection: str) -> None:
    """Three steps to a tolerance of 1e-9 each, in space."""
    found = []
    for solver in ("direct", "block"):
        model = FlowModel(unsteady=True, convection=convection, solver=solver)
        with Fluid(unit_box(3, 3), model, conditions(3), reynolds=20.0) as fluid:
            for _ in Transient(fluid, tolerance=1e-9).march(0.3, 0.1):
                pass
            found.append(without_level(fluid, fluid.state.x.array))
    for one in found[1:]:
        assert one == pytest.approx(found[0], abs=1e-6 * np.abs(found[0]).max())


def test_a_step_whose_linear_system_is_not_solved_is_taken_shorter() -> None:
    """Of a step in which the flow crosses 30 cells GMRES solves no system within its iterations."""
    model = FlowModel(unsteady=True, convection="extrapolated", solver="block")
    with Fluid(unit_box(3, 3), model, channel(3), reynolds=1000.0) as fluid:
        transient = Transient(fluid, tolerance=1e-4)
        transient.advance(0.1)
        taken = transient.advance(10.0)
        assert taken.rejected > 0 and taken.length == pytest.approx(10.0 * 0.5**taken.rejected)
        assert fluid.time == pytest.approx(0.1 + taken.length)


@pytest.mark.parametrize("conditions", [channel, box])
def test_the_projection_is_that_of_the_direct_solver(conditions: Any) -> None:
    """Of a velocity with divergence onto those without; a closed box has no pinned pressure."""
    found = []
    for solver in ("direct", "block"):
        with Fluid(
            unit_box(3, 3), FlowModel(inertia=False, solver=solver), conditions(3), 10.0
        ) as fluid:
            fluid.constraints.update(0.0)
            x = fluid.constraints.points
            bump = np.prod(x * (1 - x), axis=1)
            fluid.state.x.array[fluid.space.velocity_map.reshape(-1, 3)[:, 0]] = bump
            with Projection(fluid) as projection:
                projection.apply()
            found.append(fluid.velocity.x.array.copy())
    assert found[1] == pytest.approx(found[0], abs=1e-9)


def test_iterations_with_inertia_grow_little_with_the_mesh() -> None:
    """The commutator's error at walls lets them grow, by half at most on halved cells (docs/contribute/defaults.md)."""
    model = block(FlowModel(upwind=True))
    coarse, fine = (iterations(unit_box(3, n), model, channel(3)) for n in (3, 6))
    assert fine <= 1.5 * coarse


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("gdim", [2, 3])
@pytest.mark.parametrize("conditions", [channel, box])
def test_stokes_flow_and_its_dual_are_those_of_the_direct_solver(
    conditions: Any, gdim: int, order: int
) -> None:
    """Differences: residuals of 1e-11 and 1e-9 times the condition of these matrices, below 1e3."""
    domain = unit_box(gdim, 6 if gdim == 2 else 5 - order)
    direct = solved(domain, FlowModel(inertia=False, order=order), conditions(gdim))
    blocks = solved(domain, FlowModel(inertia=False, order=order, solver="block"), conditions(gdim))
    for one, other, tolerance in zip(direct, blocks, (1e-8, 1e-6), strict=True):
        assert other == pytest.approx(one, abs=tolerance * np.abs(one).max())


def iterations(domain: Domain, model: FlowModel, conditions: list[Condition]) -> int:
    with Fluid(domain, model, conditions, reynolds=10.0) as fluid:
        fluid.solve(1e-7)
        return fluid.solver.statistics.krylov_iterations


def test_iterations_for_stokes_flow_do_not_grow_with_the_mesh() -> None:
    """From 1.4 to 8.6 thousand unknowns; the bound of 20% is that of larger meshes, see docs/contribute/defaults.md."""
    coarse, fine = (iterations(unit_box(3, n), block(STOKES), channel(3)) for n in (4, 8))
    assert fine <= 1.2 * coarse


def test_iterations_for_stokes_flow_do_not_depend_on_its_viscosity() -> None:
    """The unknown pressure scales with it; the residual's tolerance counts momentum and volume together."""
    found = []
    for reynolds in (0.1, 10.0):
        with Fluid(unit_box(2, 8), block(STOKES), box(2), reynolds) as fluid:
            fluid.solve(RTOL)
            found.append(fluid.solver.statistics.krylov_iterations)
    assert abs(found[0] - found[1]) <= 2


def test_the_prepared_operators_serve_while_the_matrix_stays() -> None:
    with Fluid(unit_box(2, 6), block(STOKES), channel(2), reynolds=10.0) as fluid:
        fluid.solve(RTOL)
        fluid.dual(wall_motion(fluid))
        fluid.solve(RTOL)
        assert fluid.solver.statistics.factorisations == 1
        assert fluid.solver.statistics.solves == 3


def test_conditions_are_met_to_the_last_digit() -> None:
    with Fluid(unit_box(3, 3), block(STOKES), channel(3), reynolds=10.0) as fluid:
        fluid.solve(1e-4)
        values = fluid.velocity.x.array.reshape(-1, 3)
        places = fluid.constraints.points
        inflow = boundary_blocks(fluid.space.velocity, fluid.domain.facets_of("left"))
        inside = inflow[
            (places[inflow, 1:] > 1e-9).all(axis=1) & (places[inflow, 1:] < 1 - 1e-9).all(axis=1)
        ]
        assert values[inside] == pytest.approx(stream(places[inside].T, 0.0).T, abs=1e-14)


def test_not_a_number_is_an_error() -> None:
    with Fluid(unit_box(2, 4), block(STOKES), channel(2), reynolds=10.0) as fluid:
        fluid.state.x.array[:] = np.nan
        with pytest.raises(ConvergenceError, match="is not finite"):
            fluid.solve(RTOL)


@pytest.mark.parametrize("solver", ["direct", "block"])
def test_a_matrix_that_is_not_finite_fails_the_step_alone(solver: str) -> None:
    """A shorter one may have a matrix: the step is refused, and no error leaves the solution."""
    model = FlowModel(unsteady=True, solver=solver)
    with Fluid(unit_box(2, 2), model, channel(2), reynolds=20.0) as fluid:
        fluid.rate[0].value = np.inf
        report = fluid.solve(1e-6)
        assert not report.converged and "is not finite" in report.failure


@pytest.fixture
def one_iteration() -> Iterator[None]:
    """An option of the user's that lets GMRES do one iteration, which is not enough."""
    options = PETSc.Options()
    options["fluid_ksp_max_it"] = 1
    yield
    options.delValue("fluid_ksp_max_it")


@pytest.mark.usefixtures("one_iteration")
def test_options_of_the_user_hold() -> None:
    """The error names PETSc's reason; in a closed box there is no LU factorisation instead."""
    with (
        Fluid(unit_box(2, 4), block(STOKES), box(2), reynolds=10.0) as fluid,
        pytest.raises(ConvergenceError, match=r"not solved in 1 iterations \(PETSc's reason -3\)"),
    ):
        fluid.solve(RTOL)


@pytest.mark.usefixtures("one_iteration")
def test_a_transposed_system_names_its_own_iterations() -> None:
    """Of the solver of the transpose, while that of the flow has done none."""
    model = FlowModel(upwind=True, solver="block")
    with Fluid(unit_box(2, 4), model, box(2), reynolds=10.0) as fluid:
        compat.matrix_of(fluid._jacobian, fluid.constraints.dirichlet, fluid._matrix)
        with pytest.raises(
            ConvergenceError, match=r"not solved in 1 iterations \(PETSc's reason -3\)"
        ):
            fluid.dual(wall_motion(fluid))


@pytest.mark.usefixtures("one_iteration")
def test_a_steady_flow_that_gmres_does_not_solve_is_solved_by_factors() -> None:
    domain, conditions = unit_box(2, 4), channel(2)
    direct, blocks = (solved(domain, m, conditions, 20.0) for m in (STOKES, block(STOKES)))
    for one, other in zip(direct, blocks, strict=True):
        assert other == pytest.approx(one, abs=1e-9 * np.abs(one).max())


def test_curved_cells_and_a_body() -> None:
    domain = ball_in_box(0.6)
    conditions = [
        Prescribed("outer", lambda x, t: np.vstack([x[1], 0 * x[0], 0 * x[0]])),
        no_slip("body"),
    ]
    found = []
    for solver in ("direct", "block"):
        with Fluid(
            domain, FlowModel(inertia=False, solver=solver), conditions, reynolds=5.0
        ) as fluid:
            fluid.solve(RTOL)
            found.append(without_level(fluid, fluid.state.x.array))
    assert found[1] == pytest.approx(found[0], abs=1e-8 * np.abs(found[0]).max())


@pytest.mark.parametrize("solver", ["direct", "block"])
def test_a_wrong_pressure_is_no_converged_flow(solver: str) -> None:
    """Twice the pressure of a solved flow: its velocity needs no correction, the pressure one of its own size."""
    with Fluid(unit_box(3, 3), FlowModel(upwind=True, solver=solver), channel(3), 1.0) as fluid:
        assert fluid.solve(1e-10).converged
        fluid.state.x.array[fluid.space.pressure_map] *= 2.0
        assert 0.3 < fluid.correction(True, 1e-10) < 1.1
        assert fluid.correction(True, 1e-10) < 1e-8


def test_from_creeping_flow_to_inertia_at_once() -> None:
    """Its pressure falls by a factor of 1e7 on the way: with the old one the linear system is not solved."""
    with Fluid(unit_box(3, 3), FlowModel(solver="block"), box(3), 1e-6) as fluid:
        solve_steady(fluid, 1e-6)
        fluid.reynolds = 10.0
        (step,) = solve_steady(fluid, 1e-6, reached=1e-7)
    assert step.share == 1.0 and step.report.iterations <= 4

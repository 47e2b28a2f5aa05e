"""Linear solvers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import ufl
from domains import SIDES, ball_in_box, unit_box
from petsc4py import PETSc

from incipient import compat
from incipient.accuracy.dual import goal_errors
from incipient.coupled.remeshing import Projection
from incipient.coupled.tractions import TractionProbe
from incipient.errors import ConvergenceError, UnsolvedError
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
from incipient.fluid.conditions import Constraints
from incipient.fluid.flow import enriched
from incipient.fluid.solvers import Direct, TwoLevel, direct, two_level
from incipient.fluid.space import taylor_hood
from incipient.fluid.transient import Transient
from incipient.mesh.domain import Domain
from incipient.simulation.omitted import with_factors_of_steady_flow

# Direct solution with kept factors, and mass matrices.


ROWS = 40


def sparse(entries: np.ndarray) -> Any:
    matrix = PETSc.Mat().createAIJ(entries.shape, nnz=ROWS, comm=PETSc.COMM_SELF)
    matrix.setValues(range(ROWS), range(ROWS), entries)
    matrix.assemble()
    return matrix


def random_entries(seed: int) -> np.ndarray:
    """Unsymmetric and well conditioned."""
    return np.random.default_rng(seed).standard_normal((ROWS, ROWS)) + 20 * np.eye(ROWS)


def refill(matrix: Any, entries: np.ndarray) -> None:
    matrix.setValues(range(ROWS), range(ROWS), entries)
    matrix.assemble()


def solved(solver: Direct, b: np.ndarray, **how: Any) -> np.ndarray:
    right, x = solver.matrix.createVecLeft(), solver.matrix.createVecRight()
    right.setArray(b)
    solver.solve(right, x, **({"rtol": 1e-12} | how))
    return x.array.copy()


def test_factors_are_renewed_on_demand_and_where_they_have_aged() -> None:
    """A matrix unlike the factorised one: GMRES fails or is slow, and the next solve factorises."""
    A, b = random_entries(1), np.ones(ROWS)
    solver = Direct(sparse(A), patience=3)
    solved(solver, b)
    refill(solver.matrix, 2 * A)
    assert solved(solver, b, fresh=True) == pytest.approx(np.linalg.solve(2 * A, b), rel=1e-10)
    # Fresh factors need one iteration, perhaps one more for round-off.
    assert solver.statistics["factorisations"] == 2 and solver.statistics["krylov_iterations"] <= 4
    unlike = random_entries(2) - 35 * np.eye(ROWS)
    refill(solver.matrix, unlike)
    for _ in range(2):
        assert solved(solver, b) == pytest.approx(np.linalg.solve(unlike, b), rel=1e-8)
    assert solver.statistics["factorisations"] == 3 and solver.statistics["solves"] == 4


@pytest.mark.parametrize("transposed", [False, True])
@pytest.mark.parametrize("renewed", [False, True])
def test_solves_the_matrix_as_it_is_now_to_the_tolerance(transposed: bool, renewed: bool) -> None:
    """Straight and transposed, also where the matrix has changed since its factors were made."""
    A, b = random_entries(1), np.arange(1.0, ROWS + 1)
    solver = Direct(sparse(A))
    solver.prepare()
    if renewed:
        A = A + 0.01 * random_entries(2)
        refill(solver.matrix, A)
    x = solved(solver, b, rtol=1e-11, transposed=transposed)
    left = b - (A.T if transposed else A) @ x
    assert np.linalg.norm(left) <= 1e-11 * np.linalg.norm(b)
    assert solver.statistics["factorisations"] == 1
    assert (solver.statistics["krylov_iterations"] > 1) is renewed


def test_one_pressure_is_pinned_wherever_a_domain_lies() -> None:
    """Of a closed box at 1e10, where coordinates to nine digits are those of one place."""
    domain = unit_box(2, 2)
    domain.mesh.geometry.x[:, :2] += 1e10
    walls = [no_slip(name) for name in domain.names]
    pinned = Constraints(domain, taylor_hood(domain.mesh, 2), walls).dirichlet[-1]
    assert len(pinned.dof_indices()[0]) == 1


OVERFLOWN = "is not finite, its numbers have overflowed: use a smaller"


@pytest.mark.parametrize(
    ("entry", "right", "patience", "told"),
    [
        (0.0, 1.0, 8, "could not be factorised, it is singular: use another"),
        (1.0, np.nan, 8, OVERFLOWN),  # neither a coarser mesh nor more ranks help against it
        (np.nan, 1.0, 8, OVERFLOWN),
        # A residual of zero is out of reach of new factors, and GMRES is allowed no iterations.
        (1.0, 1.0, 0, "was not solved in 0 iterations"),
    ],
)
def test_what_is_not_solved_is_an_error_that_leaves_the_solver_in_order(
    entry: float, right: float, patience: int, told: str
) -> None:
    A, b = random_entries(1), np.ones(ROWS)
    spoilt = A * np.where(np.arange(ROWS) == 3, entry, 1.0)[:, None]
    solver = Direct(sparse(spoilt), patience=patience)
    with pytest.raises(UnsolvedError, match=told):
        solved(solver, right * b, rtol=1e-12 if patience else 0.0)
    refill(solver.matrix, A)
    solver.patience = 8
    assert solved(solver, b) == pytest.approx(np.linalg.solve(A, b), rel=1e-10)


def test_more_workspace_when_the_first_was_too_small(monkeypatch: pytest.MonkeyPatch) -> None:
    """MUMPS reports error -9 when its workspace, here cut to a hundredth, is too small."""
    if not PETSc.Sys.hasExternalPackage("mumps"):
        pytest.skip("needs MUMPS")
    attempts = [{"mat_mumps_icntl_14": percent} for percent in (-99, 200)]
    monkeypatch.setattr(direct, "ATTEMPTS", attempts)
    A, b = random_entries(1), np.ones(ROWS)
    solver = Direct(sparse(A))
    assert solved(solver, b) == pytest.approx(np.linalg.solve(A, b), rel=1e-10)
    assert solver.statistics["factorisations"] == 2


# The iterative solver by blocks gives what the direct one gives, in a number of iterations that stays.


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
    result = state.copy()
    if fluid.constraints.closed:
        result[places] -= result[places].mean()
    return result


def wall_motion(fluid: Fluid) -> np.ndarray:
    """A state that is a translation of the bottom along itself: it lets nothing through."""
    blocks = compat.nodes_on(fluid.space.velocity, fluid.domain.facets_of("bottom"))
    values = np.zeros_like(fluid.state.x.array)
    values[fluid.space.velocity_map.reshape(-1, fluid.space.gdim)[blocks, 0]] = 1.0
    return values


def steady(fluid: Fluid) -> list[np.ndarray]:
    """The flow and a dual solution, pressures without a level."""
    assert fluid.solve(RTOL).converged
    fluid.correct()  # by the Jacobian of the solution
    dual = fluid.dual(wall_motion(fluid))
    return [without_level(fluid, one) for one in (fluid.state.x.array, dual)]


def marched(fluid: Fluid) -> list[np.ndarray]:
    """The flow after three steps to a tolerance of 1e-9 each."""
    assert len(list(Transient(fluid, tolerance=1e-9).march(0.3, 0.1))) == 3
    return [without_level(fluid, fluid.state.x.array)]


def weighing(fluid: Fluid) -> list[np.ndarray]:
    """The dual solution of the steady equations of an unsteady flow, which weighs a missing term."""
    Transient(fluid, tolerance=1e-9).advance(0.1)
    with_factors_of_steady_flow(fluid)
    return [without_level(fluid, fluid.dual(wall_motion(fluid)))]


def projected(fluid: Fluid) -> list[np.ndarray]:
    """A velocity with divergence, onto those without; a closed box has no pinned pressure."""
    fluid.constraints.update(0.0)
    x = fluid.constraints.points
    fluid.state.x.array[fluid.space.unknowns_at_nodes[:, 0]] = np.prod(x * (1 - x), axis=1)
    with Projection(fluid) as projection:
        projection.apply()
    return [fluid.velocity.x.array.copy()]


def block(model: FlowModel) -> FlowModel:
    return replace(model, solver="block")


UNSTEADY = FlowModel(unsteady=True)


@pytest.mark.parametrize(
    ("gdim", "cells", "model", "reynolds", "act", "tolerances"),
    [
        # The transposed operator convects the other way. Differences: residuals of 1e-11 and 1e-9 times the condition
        # of these matrices, below 1e3.
        (2, 6, FlowModel(upwind=True), 20.0, steady, (1e-8, 1e-6)),
        (3, 3, FlowModel(upwind=True), 20.0, steady, (1e-8, 1e-6)),
        (2, 6, STOKES, 10.0, steady, (1e-8, 1e-6)),
        (2, 6, replace(STOKES, order=3), 10.0, steady, (1e-8, 1e-6)),
        (3, 3, STOKES, 10.0, steady, (1e-8, 1e-6)),
        (3, 2, replace(STOKES, order=3), 10.0, steady, (1e-8, 1e-6)),
        (3, 3, UNSTEADY, 20.0, marched, (1e-6,)),
        (3, 3, replace(UNSTEADY, convection="extrapolated"), 20.0, marched, (1e-6,)),
        (3, 3, replace(STOKES, unsteady=True), 10.0, weighing, (1e-6,)),
        (3, 3, STOKES, 10.0, projected, (1e-8,)),
    ],
)
@pytest.mark.parametrize("conditions", [channel, box])
def test_the_flow_is_that_of_the_direct_solver(
    conditions: Any,
    gdim: int,
    cells: int,
    model: FlowModel,
    reynolds: float,
    act: Callable[[Fluid], list[np.ndarray]],
    tolerances: tuple[float, ...],
) -> None:
    """To tolerances relative to the largest entry."""
    domain, result = unit_box(gdim, cells), []
    for one in (model, block(model)):
        with Fluid(domain, one, conditions(gdim), reynolds) as fluid:
            result.append(act(fluid))
    for exact, by_blocks, tolerance in zip(*result, tolerances, strict=True):
        assert by_blocks == pytest.approx(exact, abs=tolerance * np.abs(exact).max())


def test_a_step_whose_linear_system_is_not_solved_is_taken_shorter() -> None:
    """Of a step in which the flow crosses 30 cells GMRES solves no system within its iterations."""
    model = FlowModel(unsteady=True, convection="extrapolated", solver="block")
    with Fluid(unit_box(3, 3), model, channel(3), reynolds=1000.0) as fluid:
        transient = Transient(fluid, tolerance=1e-4)
        transient.advance(0.1)
        taken = transient.advance(10.0)
        assert taken.rejected > 0 and taken.length == pytest.approx(10.0 * 0.5**taken.rejected)
        assert fluid.time == pytest.approx(0.1 + taken.length)


def iterations(
    domain: Domain, model: FlowModel, conditions: list[Condition], reynolds: float
) -> int:
    with Fluid(domain, block(model), conditions, reynolds) as fluid:
        fluid.solve(1e-7)
        return fluid.solver.statistics["krylov_iterations"]


@pytest.mark.parametrize(
    ("model", "counts", "growth"), [(FlowModel(upwind=True), (3, 6), 1.55), (STOKES, (4, 8), 1.2)]
)
def test_iterations_grow_little_with_the_mesh(
    model: FlowModel, counts: tuple[int, int], growth: float
) -> None:
    """The commutator's error at walls lets them grow with inertia: 37 and 56 (docs/contribute/defaults.md).

    For Stokes flow, from 1.4 to 8.6 thousand unknowns, the bound is that of larger meshes.
    """
    coarse, fine = (iterations(unit_box(3, n), model, channel(3), 10.0) for n in counts)
    assert fine <= growth * coarse


def test_iterations_for_stokes_flow_do_not_depend_on_its_viscosity() -> None:
    """The unknown pressure scales with it; the residual's tolerance counts momentum and volume together."""
    slow, fast = (iterations(unit_box(2, 8), STOKES, box(2), reynolds) for reynolds in (0.1, 10.0))
    assert abs(slow - fast) <= 2


def test_the_prepared_operators_serve_while_the_matrix_stays_and_conditions_are_met() -> None:
    with Fluid(unit_box(2, 6), block(STOKES), channel(2), reynolds=10.0) as fluid:
        fluid.solve(RTOL)
        fluid.dual(wall_motion(fluid))
        fluid.solve(RTOL)
        assert fluid.solver.statistics["factorisations"] == 1
        assert fluid.solver.statistics["solves"] == 3
        places, values = fluid.constraints.points, fluid.velocity.x.array.reshape(-1, 2)
        inside = (places[:, 0] < 1e-9) & (np.abs(places[:, 1] - 0.5) < 0.49)
        assert values[inside] == pytest.approx(stream(places[inside].T, 0.0)[:2].T, abs=1e-14)


@pytest.mark.parametrize("solver", ["direct", "block"])
def test_a_matrix_that_is_not_finite_fails_the_step_alone(solver: str) -> None:
    """A shorter one may have a matrix: the step is refused, and no error leaves the solution."""
    model = FlowModel(unsteady=True, solver=solver)
    with Fluid(unit_box(2, 2), model, channel(2), reynolds=20.0) as fluid:
        fluid.rate[0].value = np.inf
        report = fluid.solve(1e-6)
        assert not report.converged and "is not finite" in report.failure


@contextmanager
def options(**chosen: Any) -> Iterator[None]:
    """The user's options for the solver of the flow."""
    given = PETSc.Options("fluid_")
    for name, value in chosen.items():
        given[name] = value
    try:
        yield
    finally:
        for name in chosen:
            given.delValue(name)


@pytest.mark.parametrize("transposed", [False, True])
def test_options_of_the_user_hold(transposed: bool) -> None:
    """One iteration of GMRES is not enough; the error names PETSc's reason, also of the transpose.

    Then the flow's solver has done no iteration.
    """
    model = block(FlowModel(upwind=True))
    with options(ksp_max_it=1), Fluid(unit_box(2, 4), model, box(2), reynolds=10.0) as fluid:
        compat.matrix_of(fluid._jacobian, fluid.constraints.dirichlet, fluid._matrix)
        right, left = fluid._matrix.createVecs()
        right.setArray(np.cos(np.arange(right.getLocalSize())))
        with pytest.raises(
            UnsolvedError, match=r"not solved in 1 iterations \(PETSc's reason -3\)"
        ):
            fluid.solver.solve(right, left, RTOL, transposed=transposed)


def test_factors_at_the_user_s_option_need_one_iteration_a_solution() -> None:
    """PETSc crashed where the option came in place of the blocks, whose type was set before."""
    if not PETSc.Sys.hasExternalPackage("mumps"):
        pytest.skip("needs MUMPS")
    with (
        options(pc_type="lu", pc_factor_mat_solver_type="mumps"),
        Fluid(unit_box(2, 4), block(STOKES), channel(2), reynolds=10.0) as fluid,
    ):
        assert fluid.solve(1e-9).converged
        statistics = fluid.solver.statistics
        assert statistics["krylov_iterations"] == statistics["solves"] == 1


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
        (report,) = solve_steady(fluid, 1e-6, reached=1e-7)
    assert fluid.reynolds == 10.0 and report.iterations <= 4


# Corrections by two levels: they solve the discrete flow of one order more, and a first one tells its forces.


CENTRE = (0.6, 0.5, 0.5)
REYNOLDS = 5.0


def around_a_ball(inertia: bool, cell: float = 0.6) -> Fluid:
    """In a closed box, whose pressure has no level; cells are curved."""
    conditions = [Prescribed("outer", stream), no_slip("body")]
    model = FlowModel(inertia=inertia, upwind=inertia, solver="block")
    return Fluid(ball_in_box(cell), model, conditions, REYNOLDS)


def load_of(fluid: Fluid) -> np.ndarray:
    result = TractionProbe(fluid, "body", CENTRE).resultant()
    return np.concatenate([result.force, result.torque])


@pytest.mark.parametrize("inertia", [True, False])
def test_a_first_correction_tells_the_load_of_one_order_more(inertia: bool) -> None:
    """Three corrections make the assembled residual of that order vanish: the action is not asked for it.

    Each leaves at most a twentieth of a residual, and Newton's method the square of what was wrong. The weighted
    residual with the solution of the transposed system is the same error once more. Bounds: what is left of the
    first residual is a twentieth, whose share of the load is not known beforehand.
    """
    with around_a_ball(inertia) as fluid:
        assert fluid.solve(1e-8).converged
        with goal_errors(fluid, "body", CENTRE) as goals:
            finer = goals.finer
            assert isinstance(finer.solver, TwoLevel) and finer.space.order == 3
            estimate = goals.error
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
        assert last.converged and fluid.space.order == 3
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
            result = finer.residual()
    size = np.linalg.norm(result)
    assert (
        np.linalg.norm(result - plain) < 1e-12 * size
        and np.linalg.norm(result - upwinded) > 1e-3 * size
    )


def test_what_is_not_found_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """The estimate then is not there, and the flow's bars say so."""
    monkeypatch.setattr(two_level, "MOST_CYCLES", 1)
    with around_a_ball(inertia=False) as fluid:
        fluid.solve(1e-8)
        why = "a higher order did not converge in 5 iterations"
        with pytest.raises(ConvergenceError, match=why), goal_errors(fluid, "body", CENTRE):
            pass

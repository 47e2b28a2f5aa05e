"""Direct solution with kept factors, and mass matrices."""

from __future__ import annotations

from typing import Any

import dolfinx
import numpy as np
import pytest
import ufl
from domains import unit_box
from petsc4py import PETSc

from incipient import compat, forms
from incipient.compat import petsc
from incipient.errors import ConvergenceError, UnsolvedError
from incipient.fluid import no_slip
from incipient.fluid.constraints import Constraints
from incipient.fluid.solvers import Direct, LinearSolver, direct
from incipient.fluid.space import taylor_hood
from incipient.forms import terms
from incipient.symmetric import solve_symmetric

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


def test_solves() -> None:
    A, b = random_entries(1), np.arange(1.0, ROWS + 1)
    assert solved(Direct(sparse(A)), b) == pytest.approx(np.linalg.solve(A, b), rel=1e-10)


def test_factors_serve_a_similar_matrix() -> None:
    A, b = random_entries(1), np.ones(ROWS)
    matrix = sparse(A)
    solver = Direct(matrix)
    solved(solver, b)
    nearby = A + 0.01 * random_entries(2)
    refill(matrix, nearby)
    assert solved(solver, b) == pytest.approx(np.linalg.solve(nearby, b), rel=1e-9)
    assert solver.statistics.factorisations == 1
    assert solver.statistics.solves == 2
    assert solver.statistics.krylov_iterations > 1


def test_fresh_factors_on_demand() -> None:
    A, b = random_entries(1), np.ones(ROWS)
    matrix = sparse(A)
    solver = Direct(matrix)
    solved(solver, b)
    refill(matrix, 2 * A)
    assert solved(solver, b, fresh=True) == pytest.approx(np.linalg.solve(2 * A, b), rel=1e-10)
    assert solver.statistics.factorisations == 2
    # Fresh factors need one iteration, perhaps one more for round-off.
    assert solver.statistics.krylov_iterations <= 4


def test_aged_factors_are_renewed() -> None:
    """A matrix unlike the factorised one: GMRES fails or is slow, and the next solve factorises."""
    b = np.ones(ROWS)
    matrix = sparse(random_entries(1))
    solver = Direct(matrix, patience=3)
    solved(solver, b)
    unlike = random_entries(2) - 35 * np.eye(ROWS)
    refill(matrix, unlike)
    for _ in range(2):
        assert solved(solver, b) == pytest.approx(np.linalg.solve(unlike, b), rel=1e-8)
    assert solver.statistics.factorisations == 2


@pytest.mark.parametrize("transposed", [False, True])
@pytest.mark.parametrize("renewed", [False, True])
def test_solves_the_matrix_as_it_is_now_to_the_tolerance(transposed: bool, renewed: bool) -> None:
    """Straight and transposed, also where the matrix has changed since its factors were made."""
    A, b = random_entries(1), np.arange(1.0, ROWS + 1)
    solver: LinearSolver = Direct(sparse(A))
    solver.prepare()
    if renewed:
        A = A + 0.01 * random_entries(2)
        refill(solver.matrix, A)
    right, x = solver.matrix.createVecLeft(), solver.matrix.createVecRight()
    right.setArray(b)
    solver.solve(right, x, rtol=1e-11, transposed=transposed)
    left = b - (A.T if transposed else A) @ x.array
    assert np.linalg.norm(left) <= 1e-11 * np.linalg.norm(b)
    assert solver.statistics.factorisations == 1
    assert (solver.statistics.krylov_iterations > 1) is renewed


def test_an_approximate_solution_is_that_of_the_matrix_last_prepared() -> None:
    A, b = random_entries(1), np.ones(ROWS)
    solver = Direct(sparse(A))
    solver.prepare()
    refill(solver.matrix, 2 * A)
    right, x = solver.matrix.createVecLeft(), solver.matrix.createVecRight()
    right.setArray(b)
    solver.approximate(right, x)
    assert x.array == pytest.approx(np.linalg.solve(A, b), rel=1e-10)


@pytest.mark.parametrize("level", [True, False])
def test_a_solver_of_singular_matrices_gets_the_pressure_without_a_level(level: bool) -> None:
    """In a closed box: the constant pressure then is in the null space of the Jacobian."""
    domain = unit_box(2, 2)
    space = taylor_hood(domain.mesh, 2)
    walls = [no_slip(name) for name in domain.names]
    held = Constraints(domain, space, walls, level=level).dirichlet
    (v, p), (w, q) = ufl.TrialFunctions(space.mixed), ufl.TestFunctions(space.mixed)
    at = forms.ReferenceMap.renewed(domain.gdim)
    form = terms.internal_force(v, p, w, 1.0, at) + terms.continuity(v, q, at)
    form = form * space.quadrature()
    matrix = petsc.assemble_matrix(compat.form(form), held)
    matrix.assemble()
    pressure, image = matrix.createVecRight(), matrix.createVecLeft()
    constant = np.zeros(space.unknowns)
    constant[space.pressure_map] = 1.0
    pressure.setArray(constant)
    matrix.mult(pressure, image)
    assert (image.norm() < 1e-13) is not level


def test_singular_matrix_is_an_error() -> None:
    A = random_entries(1)
    A[3] = 0.0
    with pytest.raises(UnsolvedError, match="could not be factorised, it is singular: use another"):
        solved(Direct(sparse(A)), np.ones(ROWS))


def test_not_a_number_is_an_error() -> None:
    """Neither a coarser mesh nor more ranks help against it, so that neither is advised."""
    b = np.ones(ROWS)
    b[0] = np.nan
    with pytest.raises(
        UnsolvedError, match="is not finite, its numbers have overflowed: use a smaller"
    ):
        solved(Direct(sparse(random_entries(1))), b)
    A = random_entries(1)
    A[2, 2] = np.nan
    with pytest.raises(
        UnsolvedError, match="is not finite, its numbers have overflowed: use a smaller"
    ):
        solved(Direct(sparse(A)), np.ones(ROWS))


def test_an_iteration_that_does_not_converge_says_so() -> None:
    """A residual of zero is out of reach of new factors, and GMRES is allowed no iterations."""
    solver = Direct(sparse(random_entries(1)), patience=0)
    with pytest.raises(UnsolvedError, match="was not solved in 0 iterations"):
        solved(solver, np.ones(ROWS), rtol=0.0)


def test_recovers_after_an_error() -> None:
    singular = random_entries(1)
    singular[3] = 0.0
    matrix = sparse(singular)
    solver = Direct(matrix)
    with pytest.raises(ConvergenceError):
        solved(solver, np.ones(ROWS))
    A = random_entries(1)
    refill(matrix, A)
    assert solved(solver, np.ones(ROWS)) == pytest.approx(
        np.linalg.solve(A, np.ones(ROWS)), rel=1e-10
    )


def test_more_workspace_when_the_first_was_too_small(monkeypatch: pytest.MonkeyPatch) -> None:
    """MUMPS reports error -9 when its workspace, here cut to a hundredth, is too small."""
    if not PETSc.Sys.hasExternalPackage("mumps"):
        pytest.skip("needs MUMPS")
    monkeypatch.setattr(direct, "ATTEMPTS", ((-99, 77), (200, 77)))
    A, b = random_entries(1), np.ones(ROWS)
    solver = Direct(sparse(A))
    assert solved(solver, b) == pytest.approx(np.linalg.solve(A, b), rel=1e-10)
    assert solver.statistics.factorisations == 2


def test_zero_right_hand_side() -> None:
    assert np.all(solved(Direct(sparse(random_entries(1))), np.zeros(ROWS)) == 0.0)


def mass_problem(measure: Any, space: Any, f: Any) -> tuple[Any, Any]:
    u, w = ufl.TrialFunction(space), ufl.TestFunction(space)
    mass = petsc.assemble_matrix(compat.form(ufl.inner(u, w) * measure))
    mass.assemble()
    return mass, petsc.assemble_vector(compat.form(ufl.inner(f, w) * measure))


def test_projection_onto_the_whole_domain() -> None:
    """A linear function is its own projection."""
    mesh = unit_box(2, 3).mesh
    space = compat.space(mesh, ("Lagrange", 2))
    x, into = ufl.SpatialCoordinate(mesh), dolfinx.fem.Function(space)
    solve_symmetric(*mass_problem(ufl.dx, space, 2 * x[0] - x[1]), into)
    points = space.tabulate_dof_coordinates()
    assert into.x.array == pytest.approx(2 * points[:, 0] - points[:, 1], abs=1e-10)


def test_projection_onto_a_boundary() -> None:
    """On the boundary the function itself, elsewhere zero."""
    domain = unit_box(2, 3)
    space = compat.space(domain.mesh, ("Lagrange", 2))
    x, into = ufl.SpatialCoordinate(domain.mesh), dolfinx.fem.Function(space)
    solve_symmetric(*mass_problem(domain.measure("left"), space, 1 + x[1]), into)
    points = space.tabulate_dof_coordinates()
    assert into.x.array == pytest.approx(
        np.where(points[:, 0] < 1e-9, 1 + points[:, 1], 0.0), abs=1e-10
    )

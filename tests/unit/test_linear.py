"""Direct solution with kept factors, and mass matrices."""

from __future__ import annotations

from typing import Any

import dolfinx
import numpy as np
import pytest
import ufl
from domains import unit_box
from petsc4py import PETSc

from incipient import compat
from incipient.compat import petsc
from incipient.errors import ConvergenceError
from incipient.fluid import linear
from incipient.fluid.linear import KeptFactorisation, solve_mass_matrix

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


def solved(solver: KeptFactorisation, b: np.ndarray, **how: Any) -> np.ndarray:
    right, x = solver.matrix.createVecLeft(), solver.matrix.createVecRight()
    right.setArray(b)
    solver.solve(right, x, **({"rtol": 1e-12} | how))
    return x.array.copy()


def test_solves() -> None:
    A, b = random_entries(1), np.arange(1.0, ROWS + 1)
    assert solved(KeptFactorisation(sparse(A)), b) == pytest.approx(np.linalg.solve(A, b), rel=1e-10)


def test_factors_serve_a_similar_matrix() -> None:
    A, b = random_entries(1), np.ones(ROWS)
    matrix = sparse(A)
    solver = KeptFactorisation(matrix)
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
    solver = KeptFactorisation(matrix)
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
    solver = KeptFactorisation(matrix, patience=3)
    solved(solver, b)
    unlike = random_entries(2) - 35 * np.eye(ROWS)
    refill(matrix, unlike)
    for _ in range(2):
        assert solved(solver, b) == pytest.approx(np.linalg.solve(unlike, b), rel=1e-8)
    assert solver.statistics.factorisations == 2


def test_singular_matrix_is_an_error() -> None:
    A = random_entries(1)
    A[3] = 0.0
    with pytest.raises(ConvergenceError, match="could not be factorised, it is singular: use another"):
        solved(KeptFactorisation(sparse(A)), np.ones(ROWS))


def test_not_a_number_is_an_error() -> None:
    """Neither a coarser mesh nor more ranks help against it, so that neither is advised."""
    b = np.ones(ROWS)
    b[0] = np.nan
    with pytest.raises(ConvergenceError, match="is not finite, its numbers have overflowed: use a smaller"):
        solved(KeptFactorisation(sparse(random_entries(1))), b)
    A = random_entries(1)
    A[2, 2] = np.nan
    with pytest.raises(ConvergenceError, match="is not finite, its numbers have overflowed: use a smaller"):
        solved(KeptFactorisation(sparse(A)), np.ones(ROWS))


def test_an_iteration_that_does_not_converge_says_so() -> None:
    """GMRES allowed no iterations does not reach its tolerance; the factors are not to blame."""
    solver = KeptFactorisation(sparse(random_entries(1)), patience=0)
    with pytest.raises(ConvergenceError, match="was not solved in 0 iterations with new factors"):
        solved(solver, np.ones(ROWS))


def test_recovers_after_an_error() -> None:
    singular = random_entries(1)
    singular[3] = 0.0
    matrix = sparse(singular)
    solver = KeptFactorisation(matrix)
    with pytest.raises(ConvergenceError):
        solved(solver, np.ones(ROWS))
    A = random_entries(1)
    refill(matrix, A)
    assert solved(solver, np.ones(ROWS)) == pytest.approx(np.linalg.solve(A, np.ones(ROWS)), rel=1e-10)


def test_more_workspace_when_the_first_was_too_small(monkeypatch: pytest.MonkeyPatch) -> None:
    """MUMPS reports error -9 when its workspace, here cut to a hundredth, is too small."""
    if not PETSc.Sys.hasExternalPackage("mumps"):
        pytest.skip("needs MUMPS")
    monkeypatch.setattr(linear, "WORKSPACES", (-99, 200))
    A, b = random_entries(1), np.ones(ROWS)
    solver = KeptFactorisation(sparse(A))
    assert solved(solver, b) == pytest.approx(np.linalg.solve(A, b), rel=1e-10)
    assert solver.statistics.factorisations == 2


def test_zero_right_hand_side() -> None:
    assert np.all(solved(KeptFactorisation(sparse(random_entries(1))), np.zeros(ROWS)) == 0.0)


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
    solve_mass_matrix(*mass_problem(ufl.dx, space, 2 * x[0] - x[1]), into)
    points = space.tabulate_dof_coordinates()
    assert into.x.array == pytest.approx(2 * points[:, 0] - points[:, 1], abs=1e-10)


def test_projection_onto_a_boundary() -> None:
    """On the boundary the function itself, elsewhere zero."""
    domain = unit_box(2, 3)
    space = compat.space(domain.mesh, ("Lagrange", 2))
    x, into = ufl.SpatialCoordinate(domain.mesh), dolfinx.fem.Function(space)
    solve_mass_matrix(*mass_problem(domain.measure("left"), space, 1 + x[1]), into)
    points = space.tabulate_dof_coordinates()
    assert into.x.array == pytest.approx(np.where(points[:, 0] < 1e-9, 1 + points[:, 1], 0.0), abs=1e-10)

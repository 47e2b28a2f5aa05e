"""Newton's method as most dolfinx scripts have it: assemble, factorise, solve, until the correction is small."""

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc
from petsc4py import PETSc


def newton(form, state, conditions, tolerance: float, most: int = 30):
    """Solve form = 0 for the state; returns the residual without conditions at the solution, and the iterations."""
    residual, jacobian = fem.form(form), fem.form(ufl.derivative(form, state))
    solver = PETSc.KSP().create(state.function_space.mesh.comm)
    solver.setType("preonly")
    solver.getPC().setType("lu")
    solver.getPC().setFactorSolverType("mumps")
    matrix, vector = petsc.create_matrix(jacobian), petsc.create_vector(residual)
    correction = matrix.createVecRight()
    iterations = 0
    while iterations < most:
        iterations += 1
        matrix.zeroEntries()
        petsc.assemble_matrix(matrix, jacobian, conditions)
        matrix.assemble()
        assemble(vector, residual)
        petsc.apply_lifting(vector, [jacobian], [conditions], [state.vector], -1.0)
        petsc.set_bc(vector, conditions, state.vector, -1.0)
        solver.setOperators(matrix)
        solver.solve(vector, correction)
        state.vector.axpy(-1.0, correction)
        size = correction.norm() / state.vector.norm()
        if not np.isfinite(size):
            raise RuntimeError("Newton's method diverged")
        if size < tolerance:
            break
    assemble(vector, residual)
    return vector, iterations


def assemble(vector, residual) -> None:
    with vector.localForm() as local:
        local.set(0.0)
    petsc.assemble_vector(vector, residual)

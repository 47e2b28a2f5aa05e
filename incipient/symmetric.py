"""Symmetric positive definite systems by conjugate gradients."""

from __future__ import annotations

from typing import Any

from petsc4py import PETSc

from .errors import ConvergenceError


def solve_symmetric(
    matrix: Any, right: Any, into: Any, rtol: float = 1e-12, multigrid: bool = False
) -> None:
    """Solve A u = b into a function; A and b are freed. Collective.

    A may be the mass matrix of a boundary: unknowns of its empty rows stay unchanged. `multigrid`, for Laplacians:
    precondition with hypre if PETSc has it. Raises ConvergenceError.
    """
    solution, solver = matrix.createVecRight(), PETSc.KSP().create(matrix.comm)
    solver.setOperators(matrix)
    solver.setType("cg")
    hypre = multigrid and PETSc.Sys.hasExternalPackage("hypre")
    solver.getPC().setType("hypre" if hypre else "jacobi")
    solver.setTolerances(rtol=rtol, atol=1e-300, max_it=10_000)
    solver.solve(right, solution)
    solved = solver.getConvergedReason() > 0
    into.x.array[: solution.getLocalSize()] = solution.array_r
    into.x.scatter_forward()
    for held in (matrix, right, solution, solver):
        held.destroy()
    if not solved:
        raise ConvergenceError(
            "a linear system with a symmetric matrix was not solved: use a smaller numerics.mesh_size"
        )

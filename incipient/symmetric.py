"""Solution of systems whose matrix is symmetric and positive, by conjugate gradients."""

from __future__ import annotations

from typing import Any

from petsc4py import PETSc

from .errors import ConvergenceError


def solve_symmetric(
    matrix: Any, right: Any, into: Any, rtol: float = 1e-12, multigrid: bool = False
) -> None:
    """Solve A u = b into a function; A and b are freed. Collective.

    A may be a mass matrix of a boundary: rows off it are empty, Jacobi takes one for their zero diagonal, and CG leaves
    them alone. With `multigrid`, for Laplacians, it is preconditioned by that where PETSc has hypre.

    Raises:
        ConvergenceError: it was not solved.
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

"""Solution with mass matrices, as of a projection onto a space of functions."""

from __future__ import annotations

from typing import Any

from petsc4py import PETSc


def solve_mass_matrix(mass: Any, right: Any, into: Any, rtol: float = 1e-12) -> None:
    """Solve M u = b for a mass matrix, whole or of a boundary only, into a function; M and b are freed. Collective."""
    solution = mass.createVecRight()
    solver = PETSc.KSP().create(mass.comm)
    solver.setOperators(mass)
    solver.setType("cg")
    # Rows off a boundary are empty; Jacobi takes one for their zero diagonal, and CG leaves them alone.
    solver.getPC().setType("jacobi")
    solver.setTolerances(rtol=rtol, atol=1e-300, max_it=1000)
    solver.solve(right, solution)
    into.x.array[: solution.getLocalSize()] = solution.array_r
    into.x.scatter_forward()
    for held in (mass, right, solution, solver):
        held.destroy()

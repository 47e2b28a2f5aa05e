"""Direct solution of the flow's linear systems, keeping factorisations for as long as they are useful."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc

from ..errors import ConvergenceError

# MUMPS's estimate of its own workspace is often too small for saddle points with pivoting: how much to add, in
# percent, at first and when that was not enough.
WORKSPACES = (200, 800)

SINGULAR = (-6, -10)  # MUMPS's errors for matrices that are singular in structure or in numbers
NOT_FINITE = (
    "the linear system of the flow is not finite, its numbers have overflowed: use a smaller fluid.reynolds or, with "
    "[time], a smaller time.step"
)


@dataclass
class LinearStatistics:
    """Counts of what the linear solver has done so far."""

    factorisations: int = 0
    solves: int = 0
    krylov_iterations: int = 0

    def add(self, other: LinearStatistics) -> None:
        """Count what another solver has done as well."""
        self.factorisations += other.factorisations
        self.solves += other.solves
        self.krylov_iterations += other.krylov_iterations


class KeptFactorisation:
    """Solves A x = b by LU, or by GMRES preconditioned with the LU of an earlier, similar A.

    `solve(..., fresh=True)` factorises; otherwise the kept factors precondition until more than
    `patience` iterations are needed. The symbolic factorisation is made once. PETSc options with the
    prefix ``fluid_`` override everything (``PETSC_OPTIONS="-fluid_pc_factor_mat_solver_type umfpack"``).
    """

    def __init__(self, matrix: Any, patience: int = 8):
        self.matrix, self.patience = matrix, patience
        self.statistics = LinearStatistics()
        self._aged = True
        self._solver = self._make(WORKSPACES[0])

    def _make(self, workspace: int) -> Any:
        solver = PETSc.KSP().create(self.matrix.comm)
        solver.setOptionsPrefix("fluid_")
        solver.setType("gmres")
        solver.setGMRESRestart(50)
        solver.setPCSide(PETSc.PC.Side.RIGHT)
        solver.setOperators(self.matrix)
        preconditioner = solver.getPC()
        preconditioner.setType("lu")
        if PETSc.Sys.hasExternalPackage("mumps"):
            preconditioner.setFactorSolverType("mumps")
            preconditioner.setFactorSetUpSolverType()
            preconditioner.getFactorMatrix().setMumpsIcntl(14, workspace)
        solver.setFromOptions()
        return solver

    def solve(self, b: Any, x: Any, rtol: float, fresh: bool = False) -> None:
        """Solve to a relative residual of `rtol`. Collective.

        Raises:
            ConvergenceError: the factorisation failed, also with more workspace, GMRES did not converge with new
                factors, or the system is not finite.
        """
        if fresh or self._aged:
            self._factorise()
        iterations = self._iterate(b, x, rtol)
        if iterations is None:
            self._factorise()
            iterations = self._iterate(b, x, rtol)
        if iterations is None:
            raise ConvergenceError(self._why_not_solved(b))
        self._aged = iterations > self.patience
        self.statistics.solves += 1
        self.statistics.krylov_iterations += iterations

    def factorise(self) -> None:
        """Make new factors of the matrix as it is now. Collective.

        Raises:
            ConvergenceError: the factorisation failed, also with more workspace.
        """
        self._factorise()
        self._aged = False

    def apply(self, b: Any, x: Any) -> None:
        """x = b solved with the factors at hand, whatever the matrix has become since. Collective."""
        self._solver.getPC().apply(b, x)
        self.statistics.solves += 1

    def apply_transposed(self, b: Any, x: Any) -> None:
        """x = b solved with the transposed factors at hand. Collective."""
        self._solver.getPC().applyTranspose(b, x)
        self.statistics.solves += 1

    def _iterate(self, b: Any, x: Any, rtol: float) -> int | None:
        """Number of iterations, or None if GMRES with the factors at hand does not converge."""
        self._solver.getPC().setReusePreconditioner(True)
        self._solver.setTolerances(rtol=rtol, atol=1e-50, max_it=4 * self.patience)
        self._solver.solve(b, x)
        return self._solver.getIterationNumber() if self._solver.getConvergedReason() > 0 else None

    def _factorise(self) -> None:
        self._aged = True
        for next_workspace in (*WORKSPACES[1:], WORKSPACES[0]):
            self._set_up()
            error = self._factor_error() if self._mumps else 0
            if error >= 0:
                return
            # PETSc never factorises again with an object of MUMPS that has failed once: take a new one.
            self._solver.destroy()
            self._solver = self._make(next_workspace)
        raise ConvergenceError(self._why_not_factorised(error))

    def _set_up(self) -> None:
        self._solver.getPC().setReusePreconditioner(False)
        self._solver.setOperators(self.matrix)
        self._solver.setUp()
        self.statistics.factorisations += 1

    @property
    def _mumps(self) -> bool:
        return self._solver.getPC().getFactorSolverType() == "mumps"

    def _factor_error(self) -> int:
        """MUMPS's INFOG(1): negative when the factorisation failed."""
        return self._solver.getPC().getFactorMatrix().getMumpsInfog(1)

    def _why_not_factorised(self, error: int) -> str:
        """What MUMPS says: not finite, singular, or short of memory. Collective."""
        if not np.isfinite(self.matrix.norm()):
            return NOT_FINITE
        rows = self.matrix.getLocalSize()[0]
        failed = f"the linear system of the flow ({rows} unknowns on this rank) could not be factorised"
        if error in SINGULAR:
            return f"{failed}, it is singular: use another numerics.mesh_size or numerics.order"
        remedy = "use a coarser mesh (numerics.mesh_size) or more ranks"
        return f"{failed}, the memory does not suffice (MUMPS's error {error}): {remedy}"

    def _why_not_solved(self, b: Any) -> str:
        """Why GMRES has not converged with new factors, from its reason. Collective."""
        if not np.isfinite(b.norm()) or not np.isfinite(self.matrix.norm()):
            return NOT_FINITE
        reason, count = self._solver.getConvergedReason(), self._solver.getIterationNumber()
        return (
            f"the linear system of the flow was not solved in {count} iterations with new factors (PETSc's reason "
            f"{reason}), it is nearly singular: use another numerics.mesh_size or, with [time], a smaller time.step"
        )

    def destroy(self) -> None:
        """Free PETSc's memory."""
        self._solver.destroy()


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

"""Direct linear solver of the flow, which reuses LU factorisations."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from ...errors import ConvergenceError, UnsolvedError
from ...installed import free_bytes
from .equations import Equations, LinearSolver, LinearStatistics

# Additional workspace in percent, since MUMPS underestimates it for saddle points with pivoting, and scaling ICNTL(8),
# at first (automatic) and after a failure: scenes of microns in metres, with viscosities of 1e-12 next to gradients of
# 1e-6, otherwise lack pivots.
ATTEMPTS = ((200, 77), (800, 8))

# LU memory in 3-D over n^(4/3): 1.9 GB at 95,000 second-order unknowns (docs/contribute/defaults.md).
LU_BYTES = 440.0
WIDEST = 1e12  # ratio of matrix entries beyond which memory is not the cause of failure
SINGULAR = (-6, -10)  # MUMPS's errors for structurally or numerically singular matrices
NOT_FINITE = (
    "the linear system of the flow is not finite, its numbers have overflowed: use a smaller fluid.reynolds or, with "
    "[time], a smaller time.step"
)


def bytes_of_factors(matrix: Any, part: float = 1.0) -> float:
    """Memory of the LU factorisation of a 3-D flow matrix, or of a part of it."""
    return float(part * LU_BYTES * matrix.getSize()[0] ** (4.0 / 3.0))


def fits(matrix: Any, part: float = 1.0) -> bool:
    """Whether such a factorisation fits into half of the free memory. Collective."""
    least = matrix.comm.tompi4py().allreduce(free_bytes(), MPI.MIN)
    return bool(bytes_of_factors(matrix, part) < 0.5 * least)


class Direct(LinearSolver):
    """LU factorisation of A, or GMRES preconditioned with that of an earlier, similar A.

    A factorisation is reused up to `patience` iterations. PETSc options with the prefix ``fluid_``
    take precedence.
    """

    regular: ClassVar[bool] = True

    def __init__(self, matrix: Any, equations: Equations | None = None, patience: int = 8):
        super().__init__()
        self.matrix, self.patience = matrix, patience
        self.statistics = LinearStatistics()
        self._aged, self._factored = True, -1
        self._solver = self._make(*ATTEMPTS[0])

    def _make(self, workspace: int, scaling: int) -> Any:
        solver = self.holding(PETSc.KSP().create(self.matrix.comm))
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
            preconditioner.getFactorMatrix().setMumpsIcntl(8, scaling)
        solver.setFromOptions()
        return solver

    def _solve(self, b: Any, x: Any, rtol: float, transposed: bool) -> None:
        if self._aged and not self._exact:
            self._factorise()
        iterations = self._iterate(b, x, rtol, transposed)
        if iterations is None:
            self._factorise()
            iterations = self._iterate(b, x, rtol, transposed)
        if iterations is None:
            raise UnsolvedError(self._why_not_solved(b))
        self._aged = iterations > self.patience
        self.statistics.solves += 1
        self.statistics.krylov_iterations += iterations

    @property
    def _exact(self) -> bool:
        return bool(self.matrix.stateGet() == self._factored)

    def _iterate(self, b: Any, x: Any, rtol: float, transposed: bool) -> int | None:
        if self._exact and self._applied(b, x, transposed) <= rtol * b.norm():
            return 1
        self._solver.setTolerances(rtol=rtol, atol=1e-50, max_it=4 * self.patience)
        (self._solver.solveTranspose if transposed else self._solver.solve)(b, x)
        return self._solver.getIterationNumber() if self._solver.getConvergedReason() > 0 else None

    def _applied(self, b: Any, x: Any, transposed: bool) -> float:
        preconditioner, left = self._solver.getPC(), b.duplicate()
        if transposed:
            preconditioner.applyTranspose(b, x)
            self.matrix.multTranspose(x, left)
        else:
            preconditioner.apply(b, x)
            self.matrix.mult(x, left)
        left.aypx(-1.0, b)
        size = float(left.norm())
        left.destroy()
        return size

    def prepare(self) -> None:
        """Factorise the present matrix. Raises UnsolvedError or ConvergenceError."""
        self._factorise()
        self._aged = False

    def approximate(self, b: Any, x: Any) -> None:
        self._solver.getPC().apply(b, x)
        self.statistics.solves += 1

    def _factorise(self) -> None:
        self._aged, self._factored = True, -1
        for following in (*ATTEMPTS[1:], ATTEMPTS[0]):
            self._set_up()
            factors = self._solver.getPC()
            # MUMPS's INFOG(1) is negative when the factorisation failed.
            mumps = factors.getFactorSolverType() == "mumps"
            error = factors.getFactorMatrix().getMumpsInfog(1) if mumps else 0
            if error >= 0:
                self._factored = self.matrix.stateGet()
                return
            # PETSc cannot reuse a MUMPS object after a failure.
            self.destroy()
            self._solver = self._make(*following)
        raise self._why_not_factorised(error)

    def _set_up(self) -> None:
        self._solver.getPC().setReusePreconditioner(False)
        self._solver.setOperators(self.matrix)
        self._solver.setUp()
        # Otherwise PETSc would refactorise a changed matrix.
        self._solver.getPC().setReusePreconditioner(True)
        self.statistics.factorisations += 1

    def _why_not_factorised(self, error: int) -> ConvergenceError:
        if not np.isfinite(self.matrix.norm()):
            return UnsolvedError(NOT_FINITE)
        rows = self.matrix.getLocalSize()[0]
        failed = (
            f"the linear system of the flow ({rows} unknowns on this rank) could not be factorised"
        )
        if error in SINGULAR:
            why = f"{failed}, it is singular: use another numerics.mesh_size or numerics.order"
            return UnsolvedError(why)
        if (apart := self._span()) > WIDEST:
            remedy = "choose units in which lengths and velocities are about 1"
            return ConvergenceError(
                f"{failed}, its numbers differ by a factor of {apart:.0e}: {remedy}"
            )
        remedy = "use a coarser mesh (numerics.mesh_size) or more ranks"
        why = f"{failed}, the memory does not suffice (MUMPS's error {error}): {remedy}"
        return ConvergenceError(why)

    def _span(self) -> float:
        """Ratio of the largest entry to the smallest non-zero diagonal entry. Collective."""
        diagonal = self.matrix.getDiagonal()
        sizes = np.abs(diagonal.array)
        least = self.matrix.comm.tompi4py().allreduce(
            sizes[sizes > 0.0].min(initial=np.inf), MPI.MIN
        )
        diagonal.destroy()
        return float(self.matrix.norm(PETSc.NormType.NORM_INFINITY) / least)

    def _why_not_solved(self, b: Any) -> str:
        if not np.isfinite(b.norm()) or not np.isfinite(self.matrix.norm()):
            return NOT_FINITE
        reason, count = self._solver.getConvergedReason(), self._solver.getIterationNumber()
        return (
            f"the linear system of the flow was not solved in {count} iterations with a new factorisation "
            f"(PETSc's reason {reason}), it is nearly singular: use another numerics.mesh_size or, with [time], a "
            "smaller time.step"
        )

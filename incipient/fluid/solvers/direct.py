"""Direct linear solver of the flow, which reuses LU factorisations."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from ...errors import ConvergenceError, UnsolvedError
from .equations import NOT_FINITE, Equations, LinearSolver
from .options import FLUID, WORKSPACE, defaults, krylov, lu

# Flexible: an exact factorisation is applied once.
GMRES = {"ksp_type": "fgmres", "ksp_gmres_restart": 50}
# MUMPS's workspace and scaling, at first (automatic) and after a failure: scenes of microns in metres, with viscosities
# of 1e-12 next to gradients of 1e-6, otherwise lack pivots.
ATTEMPTS = (
    {"mat_mumps_icntl_14": WORKSPACE, "mat_mumps_icntl_8": 77},
    {"mat_mumps_icntl_14": 800, "mat_mumps_icntl_8": 8},
)

WIDEST = 1e12  # ratio of matrix entries beyond which memory is not the cause of failure
SINGULAR = (-6, -10)  # MUMPS's errors for structurally or numerically singular matrices


class Direct(LinearSolver):
    """LU factorisation of A, or GMRES preconditioned with that of an earlier, similar A.

    A factorisation is reused up to `patience` iterations. PETSc options with the prefix ``fluid_``
    take precedence.
    """

    regular: ClassVar[bool] = True
    remedy: ClassVar[str] = (
        "with a new factorisation it is nearly singular, use another numerics.mesh_size or, with [time], a smaller "
        "time.step"
    )

    def __init__(self, matrix: Any, equations: Equations | None = None, patience: int = 8):
        super().__init__(matrix)
        self.patience = patience
        self._make(ATTEMPTS[0])

    def _make(self, chosen: dict[str, int]) -> None:
        self._options = lu("", chosen) | GMRES
        self._solver = self.holding(krylov(self.matrix, self._options))

    def _iterate(self, b: Any, x: Any, rtol: float, transposed: bool) -> int | None:
        self._solver.setTolerances(rtol=rtol, atol=1e-50, max_it=4 * self.patience)
        (self._solver.solveTranspose if transposed else self._solver.solve)(b, x)
        return self._solver.getIterationNumber() if self._solver.getConvergedReason() > 0 else None

    def _is_slow(self, iterations: int, rtol: float) -> bool:
        return iterations > self.patience

    def approximate(self, b: Any, x: Any) -> None:
        self._solver.getPC().apply(b, x)
        self.statistics["solves"] += 1

    def prepare(self) -> None:
        self._aged, self._prepared = True, -1
        for following in (*ATTEMPTS[1:], ATTEMPTS[0]):
            factors = self._solver.getPC()
            factors.setReusePreconditioner(False)
            self._solver.setOperators(self.matrix)
            with defaults(FLUID, self._options):
                self._solver.setUp()
            # Otherwise PETSc would refactorise a changed matrix.
            factors.setReusePreconditioner(True)
            self.statistics["factorisations"] += 1
            # MUMPS's INFOG(1) is negative when the factorisation failed.
            mumps = factors.getFactorSolverType() == "mumps"
            error = factors.getFactorMatrix().getMumpsInfog(1) if mumps else 0
            if error >= 0:
                self._aged, self._prepared = False, self.matrix.stateGet()
                return
            # PETSc cannot reuse a MUMPS object after a failure.
            self.destroy()
            self._make(following)
        raise self._why_not_factorised(error)

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
        diagonal = self.matrix.getDiagonal()
        sizes = np.abs(diagonal.array)
        diagonal.destroy()
        least = sizes[sizes > 0.0].min(initial=np.inf)
        least = self.matrix.comm.tompi4py().allreduce(least, MPI.MIN)
        apart = float(self.matrix.norm(PETSc.NormType.NORM_INFINITY) / least)
        if apart > WIDEST:
            remedy = (
                "choose units in which lengths and velocities are about 1, "
                "or a less extreme fluid.reynolds"
            )
            return ConvergenceError(
                f"{failed}, its numbers differ by a factor of {apart:.0e}: {remedy}"
            )
        remedy = "use a coarser mesh (numerics.mesh_size) or more ranks"
        why = f"{failed}, the memory does not suffice (MUMPS's error {error}): {remedy}"
        return ConvergenceError(why)

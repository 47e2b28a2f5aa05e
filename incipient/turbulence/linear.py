"""Iterative solution of the linear systems of flow and turbulence in 3-D."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
from petsc4py import PETSc

from ..errors import ConvergenceError
from ..fluid.solvers.direct import Direct, bytes_of_factors, fits
from ..fluid.solvers.options import defaults
from ..installed import return_freed_memory

log = logging.getLogger("incipient")

TOGETHER = "turbulent_"
MOST_TOGETHER = 150
ROUGH = 1e-2  # residual of a correction, relative to the right-hand side
# Iterations up to which factors of the flow serve on; with older ones residuals tell little.
PATIENCE = 10
# Relative size of what is left out of blocks, and MUMPS's numbers for blocks of low rank, what is left out, workspace
# in percent. With 78,000 unknowns past a sphere in its pocket factors take 9.8 s instead of 31.7, an iteration more or
# less; with 0.05 they take 7.7 s and 24 iterations instead of 5.
LEFT_OUT = 0.01
LOW_RANK, DROPPED, WORKSPACE, OUTCOME = 35, 7, 14, 1
# Memory over that of exact factors, at most: past a grain of a random bed, u* d/nu = 30, a process grew by 0.44 to 0.49
# of it at 100,000 unknowns, by 0.55 at 260,000 (benchmarks/natural_bed.py).
PART_OF_EXACT = 0.6


class CompressedFactors:
    """Block low-rank LU factorisation by MUMPS. Methods are collective.

    Without MUMPS it is PETSc's own, exact and for one rank. Amestoy, Buttari, L'Excellent & Mary (2019), ACM Trans.
    Math. Software 45, 2.
    """

    def __init__(self, matrix: Any):
        self._matrix = matrix
        self._factors: Any = None

    def assemble(self) -> None:
        self.destroy()
        self._factors = PETSc.PC().create(self._matrix.comm)
        self._factors.setOperators(self._matrix)
        self._factors.setType("lu")
        mumps = PETSc.Sys.hasExternalPackage("mumps")
        if mumps:
            self._factors.setFactorSolverType("mumps")
            self._factors.setFactorSetUpSolverType()
            made = self._factors.getFactorMatrix()
            made.setMumpsIcntl(LOW_RANK, 2)
            made.setMumpsCntl(DROPPED, LEFT_OUT)
            made.setMumpsIcntl(WORKSPACE, 200)
        self._factors.setUp()
        # PETSc else makes new factors by itself when the matrix has changed.
        self._factors.setReusePreconditioner(True)
        if mumps and made.getMumpsInfog(OUTCOME) < 0:
            raise ConvergenceError(
                "LU factorisation of the flow's matrix failed: use a larger numerics.mesh_size or more ranks"
            )

    def apply(self, right: Any, left: Any) -> None:
        self._factors.apply(right, left)

    def destroy(self) -> None:
        if self._factors is not None:
            self._factors.destroy()
            self._factors = None
            return_freed_memory()


class BlockByBlock:
    """GMRES for A x = b, A a nest of four blocks of flow and turbulence, with its lower triangle.

    The flow's approximate factorisation, reused up to 10 iterations, is applied first, then that of the turbulence's
    whole block: with one per quantity GMRES fails in long steps of k and epsilon. PETSc options with the prefix
    ``turbulent_`` take precedence.
    """

    def __init__(self, nest: Any):
        self.matrix = nest
        self._blocks = [[nest.getNestSubMatrix(i, j) for j in (0, 1)] for i in (0, 1)]
        flow = self._blocks[0][0]
        if not fits(flow, PART_OF_EXACT) and nest.comm.rank == 0:
            size = bytes_of_factors(flow, PART_OF_EXACT) / 1e9
            log.warning(
                f"LU factors of the flow's matrix take up to {size:.2g} GB, more than half of the free memory: "
                "use a larger numerics.mesh_size or more ranks"
            )
        self._of_flow = CompressedFactors(flow)
        self._aged = True
        self._flow = self._blocks[0][0].createVecs()
        self._turbulence = self._blocks[1][1].createVecs()
        self._factors = Direct(self._blocks[1][1])
        self._solver = PETSc.KSP().create(nest.comm)
        self._solver.setOptionsPrefix(TOGETHER)
        self._solver.setOperators(nest)
        self._solver.getPC().setType("python")
        self._solver.getPC().setPythonContext(self)
        chosen = {"ksp_type": "gmres", "ksp_pc_side": "right", "ksp_gmres_restart": MOST_TOGETHER}
        self._solver.setTolerances(rtol=ROUGH, atol=1e-50, max_it=MOST_TOGETHER)
        with defaults(TOGETHER, chosen):
            self._solver.setFromOptions()

    def prepare(self) -> None:
        """Take the present blocks of the matrix; the flow's factorisation may be of an earlier one. Collective."""
        if self._aged:
            self._of_flow.assemble()
        self._factors.prepare()

    def balance(self, right: tuple[Any, Any]) -> float:
        """Scale the turbulence's rows of A to a right-hand side as large as the flow's; returns the factor. Collective.

        Next to walls the logarithms' residuals are larger by orders of magnitude.
        """
        of_flow, of_fields = (one.norm() for one in right)
        factor = (
            float(of_flow / of_fields)
            if 0.0 < of_flow < np.inf and 0.0 < of_fields < np.inf
            else 1.0
        )
        for block in self._blocks[1]:
            block.scale(factor)
        return factor

    def approximate(self, b: Any, x: Any) -> None:
        """Solve A x = b to the accuracy of a Newton update; x is not finite if it fails. Collective."""
        solver = self._solver
        solver.setTolerances(max_it=MOST_TOGETHER if self._aged else PATIENCE)
        solver.solve(b, x)
        if solver.getConvergedReason() <= 0 and not self._aged:
            self._of_flow.assemble()
            solver.setTolerances(max_it=MOST_TOGETHER)
            solver.solve(b, x)
        failed = solver.getConvergedReason() <= 0
        self._aged = failed
        if failed:
            x.set(np.inf)

    def apply(self, _: Any, right: Any, left: Any) -> None:
        values, (flow, change) = right.array_r, self._flow
        left_fields, of_fields = self._turbulence
        number = flow.getLocalSize()
        flow.setArray(values[:number])
        self._of_flow.apply(flow, change)
        self._blocks[1][0].mult(change, of_fields)
        of_fields.setArray(values[number:] - of_fields.array_r)
        self._factors.approximate(of_fields, left_fields)
        left.setArray(np.concatenate([change.array_r, left_fields.array_r]))

    def destroy(self, _: Any = None) -> None:
        if self._solver is None:  # PETSc frees the context of a preconditioner as well
            return
        solver, self._solver = self._solver, None
        solver.destroy()
        self._of_flow.destroy()
        for held in (self._factors, *self._flow, *self._turbulence):
            held.destroy()

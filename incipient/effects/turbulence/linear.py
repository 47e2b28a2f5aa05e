"""Iterative solution of the linear systems of k and epsilon: for three dimensions."""

from __future__ import annotations

from typing import Any

from petsc4py import PETSc

from ...errors import ConvergenceError

PREFIX = "turbulence_"
RESTART, MOST_ITERATIONS = 100, 400


class Incomplete:
    """Solves A x = b by GMRES with incomplete factors of A, each rank those of its own part.

    Convection and sources outweigh diffusion, and pseudo-time adds to the diagonal: no multigrid is needed. PETSc
    options with the prefix ``turbulence_`` override everything.
    """

    def __init__(self, matrix: Any):
        self.matrix = matrix
        self._solver = PETSc.KSP().create(matrix.comm)
        self._solver.setOptionsPrefix(PREFIX)
        self._solver.setType("gmres")
        self._solver.setGMRESRestart(RESTART)
        self._solver.setPCSide(PETSc.PC.Side.RIGHT)
        self._solver.setOperators(matrix)
        self._solver.getPC().setType("bjacobi")
        self._solver.setFromOptions()

    def solve(self, b: Any, x: Any, rtol: float, fresh: bool = True) -> None:
        """Solve A x = b to a residual of `rtol` times b, with new factors. Collective.

        Raises:
            ConvergenceError: it was not solved.
        """
        self._solver.setTolerances(rtol=rtol, atol=1e-50, max_it=MOST_ITERATIONS)
        self._solver.setOperators(self.matrix)
        self._solver.solve(b, x)
        if self._solver.getConvergedReason() <= 0:
            raise ConvergenceError("the linear system of k and epsilon was not solved")

    def destroy(self) -> None:
        """Free PETSc's memory."""
        self._solver.destroy()

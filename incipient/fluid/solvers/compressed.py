"""Approximate factors of a flow's matrix in 3-D: what is far apart is compressed. A preconditioner."""

from __future__ import annotations

from typing import Any

from petsc4py import PETSc

from ...errors import ConvergenceError
from ...installed import return_freed_memory
from .direct import fits

# Relative size of what is left out of blocks, and MUMPS's numbers for blocks of low rank, what is left out, workspace
# in percent. With 78,000 unknowns past a sphere in its pocket factors take 9.8 s instead of 31.7, an iteration more or
# less; with 0.05 they take 7.7 s and 24 iterations instead of 5.
LEFT_OUT = 0.01
LOW_RANK, DROPPED, WORKSPACE, OUTCOME = 35, 7, 14, 1
# Memory over that of exact factors, at most: past a grain of a random bed, u* d/nu = 30, a process grew by 0.44 to 0.49
# of it at 100,000 unknowns, by 0.55 at 260,000 (benchmarks/natural_bed.py).
PART_OF_EXACT = 0.6


class CompressedFactors:
    """LU factors of a matrix whose blocks away from the diagonal are of low rank, by MUMPS. Methods are collective.

    Source: Amestoy, Buttari, L'Excellent & Mary (2019), ACM Trans. Math. Software 45, 2.
    """

    def __init__(self, matrix: Any):
        self._matrix = matrix
        self._factors: Any = None

    @staticmethod
    def serve(matrix: Any) -> bool:
        """Whether PETSc has MUMPS, and factors fit into the memory."""
        return bool(PETSc.Sys.hasExternalPackage("mumps")) and fits(matrix, PART_OF_EXACT)

    def assemble(self) -> None:
        """Make factors of the matrix as it is now.

        Raises:
            ConvergenceError: there are none.
        """
        self.destroy()
        self._factors = PETSc.PC().create(self._matrix.comm)
        self._factors.setOperators(self._matrix)
        self._factors.setType("lu")
        self._factors.setFactorSolverType("mumps")
        self._factors.setFactorSetUpSolverType()
        made = self._factors.getFactorMatrix()
        made.setMumpsIcntl(LOW_RANK, 2)
        made.setMumpsCntl(DROPPED, LEFT_OUT)
        made.setMumpsIcntl(WORKSPACE, 200)
        self._factors.setUp()
        # PETSc else makes new factors by itself when the matrix has changed.
        self._factors.setReusePreconditioner(True)
        if made.getMumpsInfog(OUTCOME) < 0:
            raise ConvergenceError(
                "LU factorisation of the flow's matrix failed: use a smaller numerics.mesh_size"
            )

    def apply(self, _: Any, right: Any, left: Any) -> None:
        """Solve approximately with the matrix that the factors are of."""
        self._factors.apply(right, left)

    def destroy(self, _: Any = None) -> None:
        """Free PETSc's memory."""
        if self._factors is not None:
            self._factors.destroy()
            self._factors = None
            return_freed_memory()

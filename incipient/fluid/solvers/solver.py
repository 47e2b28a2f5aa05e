"""What every solver of linear systems offers, and what it has done so far."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar


@dataclass
class LinearStatistics:
    """Counts of what a linear solver has done so far."""

    factorisations: int = 0
    solves: int = 0
    krylov_iterations: int = 0

    def add(self, other: LinearStatistics) -> None:
        """Count what another solver has done as well."""
        self.factorisations += other.factorisations
        self.solves += other.solves
        self.krylov_iterations += other.krylov_iterations


class LinearSolver(ABC):
    """Solves A x = b with the flow's Jacobian A. Methods are collective.

    matrix:     A, of PETSc, whose entries may be assembled anew at any time; None: A is known by its action alone
    statistics: what it has done so far
    regular:    whether A must be regular: `conditions.Constraints` then gives the pressure of a closed flow a level.
                Otherwise the solver itself deals with the constant pressures, the null space of A.
    """

    matrix: Any
    statistics: LinearStatistics
    regular: ClassVar[bool]

    def solve(self, b: Any, x: Any, rtol: float, fresh: bool = False) -> None:
        """Solve A x = b to a residual of `rtol` times b; `fresh` prepares first.

        Raises:
            UnsolvedError: A is singular or not finite, or the iteration did not converge.
            ConvergenceError: a factorisation failed for another reason.
        """
        if fresh:
            self.prepare()
        self._solve(b, x, rtol, transposed=False)

    def solve_transposed(self, b: Any, x: Any, rtol: float) -> None:
        """Solve A^T x = b to a residual of `rtol` times b. Raises as `solve` does."""
        self._solve(b, x, rtol, transposed=True)

    @abstractmethod
    def _solve(self, b: Any, x: Any, rtol: float, transposed: bool) -> None: ...

    @abstractmethod
    def prepare(self) -> None:
        """Make ready for the matrix as it is now, such as by factorising it. Raises ConvergenceError if it fails."""

    @abstractmethod
    def approximate(self, b: Any, x: Any) -> None:
        """Solve with the matrix as it was when last prepared, whatever it has become since: a step of the chord method.

        How good it is, the caller tells by how the steps contract.
        """

    @abstractmethod
    def destroy(self) -> None:
        """Free PETSc's memory."""

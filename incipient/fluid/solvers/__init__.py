"""Solution of the flow's linear systems: what every solver offers, and which ones there are by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Protocol

from .block import Block, Triangle
from .direct import Direct
from .equations import Equations
from .statistics import LinearStatistics
from .two_level import TwoLevel

__all__ = [
    "SOLVERS",
    "Block",
    "Direct",
    "Equations",
    "LinearSolver",
    "LinearStatistics",
    "Triangle",
    "TwoLevel",
]


class LinearSolver(Protocol):
    """Solves A x = b with the flow's Jacobian A, always assembled into one matrix. Methods are collective.

    matrix:     A, of PETSc
    statistics: what it has done so far
    regular:    whether A must be regular: `conditions.Constraints` then gives the pressure of a closed flow a level.
                Otherwise the solver itself deals with the constant pressures, the null space of A.
    """

    matrix: Any
    statistics: LinearStatistics
    regular: ClassVar[bool]

    def __init__(self, matrix: Any, equations: Equations):
        """A solver for a PETSc matrix whose entries may be assembled anew at any time, made of the equations."""
        ...

    def prepare(self) -> None:
        """Make ready for the matrix as it is now, such as by factorising it. Raises ConvergenceError if it fails."""
        ...

    def solve(self, b: Any, x: Any, rtol: float, fresh: bool = False) -> None:
        """Solve A x = b to a residual of `rtol` times b; `fresh` prepares first. Raises ConvergenceError."""
        ...

    def solve_transposed(self, b: Any, x: Any, rtol: float) -> None:
        """Solve A^T x = b to a residual of `rtol` times b. Raises ConvergenceError."""
        ...

    def approximate(self, b: Any, x: Any) -> None:
        """Solve with the matrix as it was when last prepared, whatever it has become since: a step of the chord method.

        How good it is, the caller tells by how the steps contract.
        """
        ...

    def destroy(self) -> None:
        """Free PETSc's memory."""
        ...


SOLVERS: Mapping[str, type[LinearSolver]] = {
    "direct": Direct,
    "block": Block,
}

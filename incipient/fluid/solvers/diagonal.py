"""The velocity block by its own diagonal blocks: for flows whose viscosity varies and whose walls resist."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from petsc4py import PETSc

from .equations import Equations
from .multigrid import PREFIX, component_rows
from .options import defaults, exact
from .split import Split

# Algebraic multigrid for operators with convection on stretched cells: incomplete factors, of each rank, are nearly
# exact across thin cells and along streamlines. Without fill
# they are not stable as a smoother (docs/contribute/defaults.md).
INCOMPLETE = {
    "pc_type": "gamg",
    "pc_gamg_threshold": 0.01,
    "mg_levels_ksp_type": "richardson",
    "mg_levels_ksp_max_it": 1,
    "mg_levels_pc_type": "bjacobi",
    "mg_levels_sub_pc_type": "ilu",
    "mg_levels_sub_pc_factor_levels": 1,
}


class DiagonalBlocks:
    """The diagonal blocks of the velocity block F: each component with itself, as in the Jacobian.

    So friction of walls, what holds the flow from crossing them, the varying viscosity's symmetric gradient and
    upwinding are in it. Each component takes one cycle of algebraic multigrid, smoothed by incomplete factors; on thin
    cells along walls, where that takes 2.5 times as many iterations, it is solved by factors.
    """

    def __init__(self, equations: Equations, split: Split):
        self._options = exact() if equations.thin else INCOMPLETE
        self._split, rows = split, component_rows(equations.space)[1]
        free = np.setdiff1d(split.velocities, split.held)
        self._rows = [np.intersect1d(one, free) for one in rows]
        self._sets = [split.index_set(one) for one in self._rows]
        self._matrices: list[Any] = [None] * len(rows)
        self._cycles: dict[bool, list[_Cycle]] = {}

    def assemble(self) -> None:
        """Take the blocks of the matrix as they are. Collective."""
        self._forget()
        self._matrices = [
            self._split.matrix.createSubMatrix(one, one, into)
            for one, into in zip(self._sets, self._matrices, strict=True)
        ]
        self._cycles[False] = [_Cycle(matrix, self._options) for matrix in self._matrices]

    def solve(self, right: np.ndarray, left: np.ndarray, transposed: bool = False) -> None:
        """Solve approximately with the velocity block or its transpose, both (owned rows of the mixed system,).

        Other rows of `left`, and those where conditions hold, stay as they are. Collective.
        """
        if transposed not in self._cycles:
            self._cycles[True] = [
                _Cycle(one.transpose(PETSc.Mat()), self._options) for one in self._matrices
            ]
        for rows, cycle in zip(self._rows, self._cycles[transposed], strict=True):
            left[rows] = cycle.solve(right[rows])

    def multiply(self, right: np.ndarray, transposed: bool = False) -> np.ndarray:
        """The blocks, or their transposes, times (owned rows of the mixed system,). Collective."""
        left = np.zeros_like(right)
        for rows, cycle in zip(self._rows, self._cycles[False], strict=True):
            left[rows] = cycle.multiply(right[rows], transposed)
        return left

    def diagonal(self) -> np.ndarray:
        """(owned rows of the mixed system,) the diagonal of the blocks, one where conditions hold."""
        found = np.ones(self._split.owned)
        for rows, cycle in zip(self._rows, self._cycles[False], strict=True):
            found[rows] = cycle.diagonal()
        return found

    def _forget(self) -> None:
        for transposed, cycles in self._cycles.items():
            for cycle in cycles:
                cycle.destroy(transposed)
        self._cycles = {}

    def destroy(self) -> None:
        """Free PETSc's memory."""
        self._forget()
        for held in (*self._matrices, *self._sets):
            if held is not None:
                held.destroy()


class _Cycle:
    """One cycle of multigrid for a matrix as it is, or its solution by factors, as options say. Collective."""

    def __init__(self, matrix: Any, options: Mapping[str, Any]):
        self._matrix, (self._right, self._left) = matrix, matrix.createVecs()
        self._cycle = PETSc.PC().create(matrix.comm)
        self._cycle.setOptionsPrefix(PREFIX)
        self._cycle.setOperators(matrix)
        with defaults(PREFIX, options):
            self._cycle.setFromOptions()
            self._cycle.setUp()

    def solve(self, right: np.ndarray) -> np.ndarray:
        """(owned rows,) the approximate solution, to be copied."""
        self._right.setArray(right)
        self._cycle.apply(self._right, self._left)
        return np.asarray(self._left.array_r)

    def multiply(self, right: np.ndarray, transposed: bool) -> np.ndarray:
        """(owned rows,) the matrix or its transpose times a vector, to be copied."""
        self._right.setArray(right)
        (self._matrix.multTranspose if transposed else self._matrix.mult)(self._right, self._left)
        return np.asarray(self._left.array_r)

    def diagonal(self) -> np.ndarray:
        """(owned rows,) the diagonal of the matrix, to be copied."""
        self._matrix.getDiagonal(self._left)
        return np.asarray(self._left.array_r)

    def destroy(self, matrix: bool) -> None:
        """Free PETSc's memory, that of the matrix as well or not."""
        for held in (self._cycle, self._right, self._left, *([self._matrix] if matrix else [])):
            held.destroy()

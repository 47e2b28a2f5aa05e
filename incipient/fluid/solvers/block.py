"""Iterative linear solver of 3-D flow, with separate preconditioners of velocity and pressure."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from petsc4py import PETSc

from ...errors import UnsolvedError
from ...parallel import Owner
from .direct import Direct, fits
from .equations import NOT_FINITE, Equations, LinearSolver
from .options import krylov
from .triangle import Triangle

# In steady and unsteady flow; in the latter a shorter step helps more than further iterations.
MOST_ITERATIONS, MOST_IN_TIME = 250, 200
RESTART = 100
# Iterations, relative to a new preconditioner, after which it is rebuilt, or abandoned within a solve.
AGED = 1.5
USELESS = 4.0
# Relative residual of chord-method updates in steady flow and, of the preconditioned system, in unsteady flow.
ROUGH, ROUGH_IN_TIME = 1e-3, 3e-2


class Block(LinearSolver):
    """GMRES with a block-triangular preconditioner (`triangle`), reused until iterations have grown by half.

    Rows of Dirichlet conditions are solved beforehand, constant pressures of closed domains projected out. A steady
    flow on which GMRES fails (cylinder_in_space on default cells) gets an LU factorisation, memory permitting. PETSc
    prefixes: ``fluid_``, ``fluid_velocity_``, ``fluid_pressure_``.
    """

    regular: ClassVar[bool] = False
    remedy: ClassVar[str] = (
        "use a smaller numerics.mesh_size, more memory for an LU factorisation or, with [time], a smaller time.step"
    )

    def __init__(self, matrix: Any, equations: Equations):
        super().__init__(matrix)
        self._equations, self._held = equations, np.flatnonzero(equations.owned_held())
        self._usual = np.inf  # iterations per decade of the residual with a new preconditioner
        self._direct: Direct | None = None
        steady = equations.rate is None
        self._may_factorise = steady and not equations.closed
        self._symmetric = equations.carrier is None and equations.surface is None
        self._null_space = None
        if equations.closed:
            self._null_space = self.holding(_constant_pressures(matrix, equations))
        self._rough = ROUGH if steady else ROUGH_IN_TIME
        self._options = {
            "ksp_type": "gmres",
            "ksp_pc_side": "right" if steady else "left",
            "ksp_gmres_restart": RESTART,
            "ksp_max_it": MOST_ITERATIONS if steady else MOST_IN_TIME,
            "pc_type": "python",
        }
        # By transposition; the solver of the transpose is built on demand.
        self._for_transpose = self.holding(Owner())
        self._solvers: dict[bool, tuple[Any, Triangle]] = {False: self._made(matrix, False)}
        self._most = self._solvers[False][0].getTolerances()[3]

    def _made(self, matrix: Any, transposed: bool) -> tuple[Any, Triangle]:
        owner = self._for_transpose if transposed else self
        triangle = Triangle(self.matrix, self._equations, transposed)
        return owner.holding(krylov(matrix, self._options, triangle)), triangle

    def prepare(self) -> None:
        if self._direct is not None:
            self._direct.prepare()
            return
        self._for_transpose.destroy()
        self._solvers = {False: self._solvers[False]}
        self._solvers[False][1].assemble()
        self.statistics.factorisations += 1
        self._aged, self._prepared, self._usual = False, self.matrix.stateGet(), np.inf

    def approximate(self, b: Any, x: Any) -> None:
        self.solve(b, x, self._rough)

    def solve(
        self, b: Any, x: Any, rtol: float, fresh: bool = False, transposed: bool = False
    ) -> None:
        transposed = transposed and not self._symmetric
        if self._direct is None:
            try:
                super().solve(b, x, rtol, fresh, transposed)
                return
            except UnsolvedError as error:
                if str(error) == NOT_FINITE or not (self._may_factorise and fits(self.matrix)):
                    raise
            self._direct = Direct(self.matrix)
            self._direct.statistics = self.statistics
        try:
            self._direct.solve(b, x, rtol, fresh, transposed)
        except UnsolvedError:  # specific to this state: the blocks may serve another
            self._direct.destroy()
            self._direct, self._prepared = None, -1
            raise

    def _is_slow(self, iterations: int, rtol: float) -> bool:
        needed = iterations / -np.log10(rtol)
        if self._current:
            self._usual = min(needed, self._usual)
            return False
        return bool(needed > AGED * self._usual)

    def _iterate(self, b: Any, x: Any, rtol: float, transposed: bool) -> int | None:
        if transposed not in self._solvers:
            matrix = self._for_transpose.holding(PETSc.Mat().createTranspose(self.matrix))
            self._solvers[True] = self._made(matrix, True)
            self._solvers[True][1].assemble()
        self._solver = self._solvers[transposed][0]
        right = b.copy()
        # Set as a whole: changes through a live view would not reset PETSc's cached norm.
        free = b.array_r.copy()
        prescribed, free[self._held] = free[self._held], 0.0
        right.setArray(free)
        if self._null_space is not None:
            self._null_space.remove(right)
        # An old preconditioner is replaced if it needs many iterations.
        expected = -USELESS * self._usual * np.log10(rtol)
        most = self._most if self._current else int(min(self._most, 1.0 + expected))
        self._solver.setTolerances(rtol=rtol, atol=1e-50, max_it=most)
        self._solver.solve(right, x)
        if self._null_space is not None:
            self._null_space.remove(x)
        free = x.array_r.copy()
        free[self._held] = prescribed
        x.setArray(free)
        right.destroy()
        return self._solver.getIterationNumber() if self._solver.getConvergedReason() > 0 else None

    def destroy(self) -> None:
        if self._direct is not None:
            self._direct.destroy()
        super().destroy()


def _constant_pressures(matrix: Any, equations: Equations) -> Any:
    vector = matrix.createVecRight()
    vector.setArray(equations.constant_pressures())
    return PETSc.NullSpace().create(vectors=[vector], comm=matrix.comm)

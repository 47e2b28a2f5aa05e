"""Iterative linear solver of 3-D flow, with separate preconditioners of velocity and pressure."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from petsc4py import PETSc

from ...errors import UnsolvedError
from ...parallel import Owner
from .direct import NOT_FINITE, Direct, fits
from .equations import Equations, LinearSolver, LinearStatistics
from .options import defaults
from .triangle import Triangle

PREFIX = "fluid_"
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
    flow on which GMRES fails gets an LU factorisation, memory permitting. PETSc prefixes: ``fluid_``,
    ``fluid_velocity_``, ``fluid_pressure_``.
    """

    regular: ClassVar[bool] = False

    def __init__(self, matrix: Any, equations: Equations):
        super().__init__()
        self.matrix, self._equations = matrix, equations
        self.statistics = LinearStatistics()
        self._held = np.flatnonzero(equations.owned_held())
        # Matrix state when last prepared (-1: never), and iterations per decade of the residual then.
        self._state, self._usual = -1, np.inf
        self._direct: Direct | None = None
        steady = equations.rate is None
        self._may_factorise = steady and not equations.closed
        self._symmetric = equations.carrier is None and equations.surface is None
        self._null_space = None
        if equations.closed:
            self._null_space = self.holding(_constant_pressures(matrix, equations))
        self._rough = ROUGH if steady else ROUGH_IN_TIME
        self._side, self._most = ("right", MOST_ITERATIONS) if steady else ("left", MOST_IN_TIME)
        # By transposition; the solver of the transpose is built on demand.
        self._for_transpose = self.holding(Owner())
        self._solvers: dict[bool, tuple[Any, Triangle]] = {False: self._made(matrix, False)}
        self._most = self._solvers[False][0].getTolerances()[3]

    def _made(self, matrix: Any, transposed: bool) -> tuple[Any, Triangle]:
        owner = self._for_transpose if transposed else self
        solver = owner.holding(PETSc.KSP().create(matrix.comm))
        triangle = Triangle(self.matrix, self._equations, transposed)
        solver.setOptionsPrefix(PREFIX)
        solver.setOperators(matrix)
        solver.getPC().setType("python")
        solver.getPC().setPythonContext(triangle)
        solver.setTolerances(atol=1e-50, max_it=self._most)
        chosen = {"ksp_type": "gmres", "ksp_pc_side": self._side, "ksp_gmres_restart": RESTART}
        with defaults(PREFIX, chosen):
            solver.setFromOptions()
        return solver, triangle

    def prepare(self) -> None:
        if self._direct is not None:
            self._direct.prepare()
            return
        self._for_transpose.destroy()
        self._solvers = {False: self._solvers[False]}
        self._solvers[False][1].assemble()
        self.statistics.factorisations += 1
        self._state, self._usual = self.matrix.stateGet(), np.inf

    def approximate(self, b: Any, x: Any) -> None:
        """Solve A x = b with the present matrix, to the accuracy of a chord-method update."""
        self._solve(b, x, self._rough, transposed=False)

    def _solve(self, b: Any, x: Any, rtol: float, transposed: bool) -> None:
        transposed = transposed and not self._symmetric
        if self._direct is None:
            self._by_blocks(b, x, rtol, transposed)
        if self._direct is None:
            return
        try:
            (self._direct.solve_transposed if transposed else self._direct.solve)(b, x, rtol)
        except UnsolvedError:  # specific to this state: the blocks may serve another
            self._direct.destroy()
            self._direct, self._state = None, -1
            raise

    def _by_blocks(self, b: Any, x: Any, rtol: float, transposed: bool) -> None:
        if self._state < 0:
            self.prepare()
        iterations = self._iterate(b, x, rtol, transposed)
        if iterations is None and not self._new:
            self.prepare()
            iterations = self._iterate(b, x, rtol, transposed)
        if iterations is None:
            why = self._why_not_solved(b, transposed)
            if not (why != NOT_FINITE and self._may_factorise and fits(self.matrix)):
                raise UnsolvedError(why)
            self._direct = Direct(self.matrix)
            self._direct.statistics = self.statistics
            return
        self.statistics.solves += 1
        self.statistics.krylov_iterations += iterations
        needed = iterations / -np.log10(rtol)
        if self._new:
            self._usual = min(needed, self._usual)
        elif needed > AGED * self._usual:
            self._state = -1

    @property
    def _new(self) -> bool:
        return bool(self.matrix.stateGet() == self._state)

    def _iterate(self, b: Any, x: Any, rtol: float, transposed: bool) -> int | None:
        if transposed not in self._solvers:
            matrix = self._for_transpose.holding(PETSc.Mat().createTranspose(self.matrix))
            self._solvers[True] = self._made(matrix, True)
            self._solvers[True][1].assemble()
        solver = self._solvers[transposed][0]
        right = b.copy()
        # Set as a whole: changes through a live view would not reset PETSc's cached norm.
        free = b.array_r.copy()
        prescribed, free[self._held] = free[self._held], 0.0
        right.setArray(free)
        if self._null_space is not None:
            self._null_space.remove(right)
        # An old preconditioner is replaced if it needs many iterations.
        expected = -USELESS * self._usual * np.log10(rtol)
        most = self._most if self._new else int(min(self._most, 1.0 + expected))
        solver.setTolerances(rtol=rtol, max_it=most)
        solver.solve(right, x)
        if self._null_space is not None:
            self._null_space.remove(x)
        free = x.array_r.copy()
        free[self._held] = prescribed
        x.setArray(free)
        right.destroy()
        return solver.getIterationNumber() if solver.getConvergedReason() > 0 else None

    def _why_not_solved(self, b: Any, transposed: bool) -> str:
        if not np.isfinite(b.norm()) or not np.isfinite(self.matrix.norm()):
            return NOT_FINITE
        solver = self._solvers[transposed][0]
        reason, count = solver.getConvergedReason(), solver.getIterationNumber()
        return (
            f"the linear system of the flow was not solved in {count} iterations (PETSc's reason {reason}): use a "
            "smaller numerics.mesh_size, more memory for an LU factorisation or, with [time], a smaller time.step"
        )

    def destroy(self) -> None:
        if self._direct is not None:
            self._direct.destroy()
        super().destroy()


def _constant_pressures(matrix: Any, equations: Equations) -> Any:
    vector = matrix.createVecRight()
    vector.setArray(equations.constant_pressures())
    return PETSc.NullSpace().create(vectors=[vector], comm=matrix.comm)

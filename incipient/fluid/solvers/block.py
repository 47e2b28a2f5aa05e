"""Iterative solution of the flow's linear systems, velocity and pressure preconditioned apart: for three dimensions."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from petsc4py import PETSc

from ...errors import UnsolvedError
from .diagonal import DiagonalBlocks
from .direct import NOT_FINITE, Direct, fits
from .equations import Equations
from .multigrid import Components
from .options import defaults
from .schur import schur_complement
from .solver import LinearSolver, LinearStatistics
from .split import Split

PREFIX = "fluid_"
# Steady; in time, where a shorter step does more than further iterations; and with a varying viscosity, where a
# larger one does.
MOST_ITERATIONS, MOST_IN_TIME, MOST_IF_VARYING = 250, 200, 150
RESTART = 100
# A preconditioner is made anew when it needs this many times the iterations that it needed when it was new.
AGED = 1.5
# An old one is given up after this many times the iterations that it needed when it was new.
USELESS = 4.0
# Residual, relative to the right-hand side, of a correction that is one of several, steady, in time, and with a varying
# viscosity: a step of the chord method. In time it is that of the preconditioned system, which is nearer to the error.
ROUGH, ROUGH_IN_TIME, ROUGH_IF_VARYING = 1e-3, 3e-2, 1e-2


class Block(LinearSolver):
    """Solves A x = b, A = [[F, B^T], [B, 0]], by GMRES with a block triangle as preconditioner.

    One application is z_p = -S^-1 r_p, z_v = F^-1 (r_v - B^T z_p), with one multigrid cycle a component for F
    (`multigrid`) and an approximate Schur complement S (`schur`); for A^T the same with F^T. The operators are those
    of the state when last prepared, and serve until they need half as many iterations again as when they were new.
    Where conditions hold the equations are those of the identity, solved beforehand. In closed domains the constant
    pressures are taken out of right-hand side and solution. A steady laminar flow that GMRES does not solve is solved
    by LU factors from then on, if the memory suffices. In time the blocks leave convection out, and the residual is
    that of the preconditioned system: of corrections as rough as serve there it tells more. PETSc options with the
    prefix ``fluid_`` are for GMRES, those with ``fluid_velocity_`` and ``fluid_pressure_`` for the blocks. See
    `LinearSolver`.
    """

    regular: ClassVar[bool] = False

    def __init__(self, matrix: Any, equations: Equations):
        self.matrix = matrix
        self.statistics = LinearStatistics()
        self._preconditioner = Triangle(matrix, equations)
        # The matrix's state when last prepared (-1: never), and the iterations a decade of the residual needed then.
        self._state, self._usual = -1, np.inf
        self._direct: Direct | None = None
        self._may_factorise = equations.rate is None and not (equations.closed or equations.varying)
        self._null_space = _constant_pressures(matrix, equations) if equations.closed else None
        self._rough, self._most = ROUGH, MOST_ITERATIONS
        if equations.rate is not None:
            self._rough, self._most = ROUGH_IN_TIME, MOST_IN_TIME
        elif equations.varying:
            self._rough, self._most = ROUGH_IF_VARYING, MOST_IF_VARYING
        self._solver = self._made(equations)
        self._most = self._solver.getTolerances()[3]

    def _made(self, equations: Equations) -> Any:
        solver = PETSc.KSP().create(self.matrix.comm)
        solver.setOptionsPrefix(PREFIX)
        solver.setOperators(self.matrix)
        preconditioner = solver.getPC()
        preconditioner.setType("python")
        preconditioner.setPythonContext(self._preconditioner)
        solver.setTolerances(atol=1e-50, max_it=self._most)
        side = "right" if equations.rate is None else "left"
        chosen = {"ksp_type": "gmres", "ksp_pc_side": side, "ksp_gmres_restart": RESTART}
        with defaults(PREFIX, chosen):
            solver.setFromOptions()
        return solver

    def prepare(self) -> None:
        """Take the operators of the preconditioner from the state as it is now. Collective."""
        if self._direct is not None:
            self._direct.prepare()
            return
        self._preconditioner.assemble()
        self.statistics.factorisations += 1
        self._state, self._usual = self.matrix.stateGet(), np.inf

    def approximate(self, b: Any, x: Any) -> None:
        """Solve A x = b with the matrix as it is, as well as one of several corrections can use. Collective."""
        self._solve(b, x, self._rough, transposed=False)

    def _solve(self, b: Any, x: Any, rtol: float, transposed: bool) -> None:
        if self._direct is None:
            self._by_blocks(b, x, rtol, transposed)
        if self._direct is None:
            return
        try:
            (self._direct.solve_transposed if transposed else self._direct.solve)(b, x, rtol)
        except UnsolvedError:  # because of this state: from another one the blocks may do
            self._direct.destroy()
            self._direct, self._state = None, -1
            raise

    def _by_blocks(self, b: Any, x: Any, rtol: float, transposed: bool) -> None:
        """Solve by GMRES; where it does not converge make the direct solver that is to do it. Collective."""
        if self._state < 0:
            self.prepare()
        iterations = self._iterate(b, x, rtol, transposed)
        if iterations is None and not self._new:
            self.prepare()
            iterations = self._iterate(b, x, rtol, transposed)
        if iterations is None:
            why = self._why_not_solved(b)
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
        """Whether the preconditioner is of the matrix as it is now."""
        return bool(self.matrix.stateGet() == self._state)

    def _iterate(self, b: Any, x: Any, rtol: float, transposed: bool) -> int | None:
        """Number of iterations, or None if GMRES does not converge."""
        right, held = b.copy(), self._preconditioner.split.held
        # Set whole: entries changed through a view that lives on would leave the norm that PETSc remembers.
        free = b.array_r.copy()
        prescribed, free[held] = free[held], 0.0
        right.setArray(free)
        if self._null_space is not None:
            self._null_space.remove(right)
        self._preconditioner.transposed = transposed
        self._solver.setTolerances(rtol=rtol, max_it=self._most_iterations(rtol))
        (self._solver.solveTranspose if transposed else self._solver.solve)(right, x)
        if self._null_space is not None:
            self._null_space.remove(x)
        free = x.array_r.copy()
        free[held] = prescribed
        x.setArray(free)
        right.destroy()
        return self._solver.getIterationNumber() if self._solver.getConvergedReason() > 0 else None

    def _most_iterations(self, rtol: float) -> int:
        """After how many iterations to give up: with an old preconditioner a new one is made then."""
        expected = -USELESS * self._usual * np.log10(rtol)
        return self._most if self._new else int(min(self._most, 1.0 + expected))

    def _why_not_solved(self, b: Any) -> str:
        """Why GMRES has not converged with a new preconditioner, from its reason. Collective."""
        if not np.isfinite(b.norm()) or not np.isfinite(self.matrix.norm()):
            return NOT_FINITE
        reason, count = self._solver.getConvergedReason(), self._solver.getIterationNumber()
        return (
            f"the linear system of the flow was not solved in {count} iterations (PETSc's reason {reason}): use a "
            "smaller numerics.mesh_size, more memory for an LU factorisation or, with [time], a smaller time.step"
        )

    def destroy(self) -> None:
        """Free PETSc's memory."""
        self._solver.destroy()  # and the preconditioner with it
        if self._direct is not None:
            self._direct.destroy()
        if self._null_space is not None:
            self._null_space.destroy()


class Triangle:
    """The preconditioner: a context of PETSc's `PCPYTHON`; `transposed` says whether that of the transpose."""

    def __init__(self, matrix: Any, equations: Equations):
        self.split, self.transposed = Split(matrix, equations), False
        self._velocity = (
            DiagonalBlocks(equations, self.split) if equations.varying else Components(equations)
        )
        self._pressure = schur_complement(equations, self.split, self._velocity)
        self._gradient: Any = None  # B^T, made when first assembled
        self._vectors: tuple[Any, ...] = ()

    def assemble(self) -> None:
        """Take the operators of the state, and B^T of the matrix, as they are. Collective."""
        self._velocity.assemble()
        self._pressure.assemble()
        self._gradient = self.split.gradient(self._gradient)
        self._vectors = self._vectors or self._gradient.createVecs()

    def apply(self, _: Any, right: Any, left: Any) -> None:
        """One application, to the matrix or its transpose."""
        split, (multiplier, product) = self.split, self._vectors
        r, z = right.array_r.copy(), np.zeros(self.split.owned)
        z[split.pressures] = -self._pressure.solve(r[split.pressures], self.transposed)
        multiplier.setArray(z[split.pressures[split.order]])
        self._gradient.mult(multiplier, product)
        r[split.velocities] -= product.array_r
        self._velocity.solve(r, z, self.transposed)
        z[split.held] = r[split.held]
        left.setArray(z)

    applyTranspose = apply  # `transposed` says which stands for A^T

    def destroy(self, _: Any) -> None:
        """Free PETSc's memory; called by PETSc."""
        self._velocity.destroy()
        self._pressure.destroy()
        self.split.destroy()
        for held in (self._gradient, *self._vectors):
            if held is not None:
                held.destroy()


def _constant_pressures(matrix: Any, equations: Equations) -> Any:
    vector = matrix.createVecRight()
    space = equations.space
    vector.getArray()[space.pressure_map[: space.pressure.dofmap.index_map.size_local]] = 1.0
    vector.normalize()
    return PETSc.NullSpace().create(vectors=[vector], comm=matrix.comm)

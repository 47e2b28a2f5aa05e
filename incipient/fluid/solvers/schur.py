"""Approximate inverses of the pressure's Schur complement S = B F^-1 B^T of the flow's Jacobian [[F, B^T], [B, 0]]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
import ufl
from petsc4py import PETSc

from ... import compat
from ...compat import petsc
from ...forms import preconditioning
from ..space import cell_size
from .diagonal import INCOMPLETE
from .equations import Equations
from .multigrid import algebraic, component_rows
from .options import defaults, exact
from .split import Split

PREFIX = "fluid_pressure_"
POISSON = "fluid_pressure_poisson_"
# The Laplacian of stretched cells: few entries of its matrix are strong.
STRETCHED = INCOMPLETE | {"pc_gamg_threshold": 0.2}
# Bounds of the eigenvalues of the mass matrix over its diagonal, those of the element matrices on straight cells
# (Wathen 1987), by the dimension and the order of the pressure.
BOUNDS = {
    (2, 1): (0.5, 2.0),
    (2, 2): (0.39, 2.06),
    (2, 3): (0.35, 1.96),
    (2, 4): (0.37, 2.08),
    (3, 1): (0.5, 2.5),
    (3, 2): (0.25, 4.35),
    (3, 3): (0.25, 3.25),
    (3, 4): (0.18, 3.92),
}


class Schur(Protocol):
    """An approximate inverse of S. Methods are collective."""

    def assemble(self) -> None:
        """Take the operators of the state as it is."""
        ...

    def solve(self, right: np.ndarray, transposed: bool) -> np.ndarray:
        """(owned pressures,) approximately S^-1, or S^-T, times the right-hand side; to be copied."""
        ...

    def destroy(self) -> None:
        """Free PETSc's memory."""
        ...


class VelocityBlock(Protocol):
    """Operators that stand for the velocity block. Methods are collective."""

    def multiply(self, right: np.ndarray, transposed: bool = False) -> np.ndarray:
        """The operators, or their transposes, times (owned rows of the mixed system,)."""
        ...

    def diagonal(self) -> np.ndarray:
        """(owned rows of the mixed system,) the diagonal of the operators."""
        ...


def schur_complement(equations: Equations, split: Split, velocity: VelocityBlock) -> Schur:
    """The approximation for the terms that there are. Collective."""
    if equations.varying and equations.level:
        return ConvectedPressure(equations, split)
    if equations.rate is not None:
        return CahouetChabard(equations)
    if equations.carrier is not None:
        return LeastSquaresCommutator(equations, split, velocity)
    return ScaledMass(equations)


class ScaledMass:
    """S^-1 = M^-1, M the mass matrix over the viscosity, by Chebyshev's iteration: for Stokes flow."""

    def __init__(self, equations: Equations):
        space = equations.space
        p, q = ufl.TrialFunction(space.pressure), ufl.TestFunction(space.pressure)
        integrand = preconditioning.pressure_mass(
            p, q, equations.viscosity, equations.reference_map
        )
        self._form = compat.form(integrand * _measure(equations))
        self._mass = petsc.create_matrix(self._form)
        self._right, self._left = self._mass.createVecLeft(), self._mass.createVecRight()
        self._solver = _chebyshev(self._mass, BOUNDS[space.gdim, space.order - 1])

    def assemble(self) -> None:
        """Take the viscosity of the state as it is. Collective."""
        self._mass.zeroEntries()
        petsc.assemble_matrix(self._mass, self._form)
        self._mass.assemble()
        self._solver.setOperators(self._mass)

    def diagonal(self) -> np.ndarray:
        """(owned pressures,) the diagonal of M, to be copied."""
        self._mass.getDiagonal(self._left)
        return self._left.array_r

    def solve(self, right: np.ndarray, transposed: bool) -> np.ndarray:
        """(owned pressures,) approximately S^-1 times the right-hand side. Collective."""
        self._right.setArray(right)
        self._solver.solve(self._right, self._left)
        return self._left.array_r

    def destroy(self) -> None:
        """Free PETSc's memory."""
        for held in (self._solver, self._mass, self._right, self._left):
            held.destroy()


class CahouetChabard:
    """S^-1 = M^-1 + a0 A^-1, a0 the coefficient of the velocity in its rate, A the Laplacian: for flow in time.

    Where fluid leaves freely the pressure vanishes weakly: the diagonal of A is doubled there, which unlike a condition
    leaves the preconditioner regular. A free surface adds what a pressure on it moves. Without viscosity there is no M.
    Source: Cahouet & Chabard (1988), Int. J. Numer. Methods Fluids 8, 869.
    """

    def __init__(self, equations: Equations):
        space, self._rate, self._coefficient = equations.space.pressure, equations.rate, 0.0
        self._mass = None if equations.viscosity is None else ScaledMass(equations)
        p, q = ufl.TrialFunction(space), ufl.TestFunction(space)
        integrand = preconditioning.pressure_laplacian(p, q, equations.reference_map)
        added = 0 if equations.surface is None else equations.surface.of_pressure(p, q)
        self._form = compat.form(integrand * _measure(equations) + added)
        self._open = equations.open[equations.open < space.dofmap.index_map.size_local]
        self._poisson = _Poisson(petsc.create_matrix(self._form), equations.closed)

    def assemble(self) -> None:
        """Take the rate's coefficient, the viscosity and the mesh as they are. Collective."""
        self._coefficient = float(self._rate.value)
        if self._mass is not None:
            self._mass.assemble()
        self._poisson.matrix.zeroEntries()
        petsc.assemble_matrix(self._poisson.matrix, self._form)
        self._poisson.matrix.assemble()
        diagonal = self._poisson.matrix.getDiagonal()
        entries = diagonal.array_r.copy()
        entries[self._open] *= 2.0
        diagonal.setArray(entries)
        self._poisson.matrix.setDiagonal(diagonal)
        diagonal.destroy()
        self._poisson.prepare()

    def solve(self, right: np.ndarray, transposed: bool) -> np.ndarray:
        """(owned pressures,) approximately S^-1 times the right-hand side. Collective."""
        found = self._coefficient * self._poisson.solve(right)
        return found if self._mass is None else found + self._mass.solve(right, transposed)

    def destroy(self) -> None:
        """Free PETSc's memory."""
        self._poisson.destroy()
        if self._mass is not None:
            self._mass.destroy()


class LeastSquaresCommutator:
    """S^-1 = L^-1 (B D^-1 F D^-1 G) L^-1, L = B D^-1 G: for steady flow with inertia.

    F are the operators of the velocity's components, or its diagonal blocks, and D their diagonals. G is the
    pressure's block in momentum, which is B^T and what upwinding adds to it: both it and F have the upwinded tests,
    so that these cancel in S = B F^-1 G. Rows where conditions hold are in none of them. Source: Elman, Howle, Shadid,
    Shuttleworth & Tuminaro (2006), SIAM J. Sci. Comput. 27, 1651; scaling and G are measured
    (docs/contribute/defaults.md).
    """

    def __init__(self, equations: Equations, split: Split, velocity: VelocityBlock):
        self._split, self._velocity = split, velocity
        self._poisson = _ScaledPoisson(equations.closed, exact() if equations.thin else None)
        self._divergence: Any = None
        self._gradient: Any = None
        self._scale = np.empty(0)
        self._vectors: tuple[Any, ...] = ()

    def assemble(self) -> None:
        """Take the operators of the velocity's components, which are assembled before, as they are. Collective."""
        self._divergence = self._split.divergence(self._divergence)
        self._gradient = self._split.gradient(self._gradient)
        self._vectors = self._vectors or self._divergence.createVecs()
        self._scale = 1.0 / np.abs(self._velocity.diagonal()[self._split.velocities])
        self._poisson.renew(self._divergence, self._gradient, self._scale)

    def solve(self, right: np.ndarray, transposed: bool) -> np.ndarray:
        """(owned pressures,) approximately S^-1, or S^-T, times the right-hand side. Collective."""
        order, (velocity, pressure) = self._split.order, self._vectors
        pressure.setArray(self._poisson.solve(right[order], transposed))
        if transposed:
            self._divergence.multTranspose(pressure, velocity)
        else:
            self._gradient.mult(pressure, velocity)
        whole = np.zeros(self._split.owned)
        whole[self._split.velocities] = self._scale * velocity.array_r
        carried = self._velocity.multiply(whole, transposed)[self._split.velocities]
        velocity.setArray(self._scale * carried)
        if transposed:
            self._gradient.multTranspose(velocity, pressure)
        else:
            self._divergence.mult(velocity, pressure)
        found = np.empty_like(right)
        found[order] = self._poisson.solve(pressure.array_r, transposed)
        return found

    def destroy(self) -> None:
        """Free PETSc's memory."""
        for held in (self._poisson, self._divergence, self._gradient, *self._vectors):
            if held is not None:
                held.destroy()


class ConvectedPressure:
    """S^-1 = N^-1 + L^-1 C M^-1, L = B D^-1 G: for steady flow of varying viscosity along level walls, stretched cells.

    N and M are the pressures' mass matrices over the viscosity and without, C convects pressures, D has the sums of the
    sizes in rows of the velocity's mass matrix, G is the pressure's block in momentum: what walls and upwinding do is
    in L. As of Cahouet & Chabard for the rate, diffusion is in N and convection in L; of pressure convection-diffusion
    (Kay, Loghin & Wathen 2002, SIAM J. Sci. Comput. 24, 237) the factors are in the other order. Order, D, and what
    happens where fluid enters are measured (docs/contribute/defaults.md).
    """

    def __init__(self, equations: Equations, split: Split):
        space, self._split = equations.space, split
        self._poisson = _ScaledPoisson(equations.closed, STRETCHED)
        self._mass, self._diffused = (
            ScaledMass(replace(equations, viscosity=1.0)),
            ScaledMass(equations),
        )
        p, q = ufl.TrialFunction(space.pressure), ufl.TestFunction(space.pressure)
        mesh, (scalar, self._rows) = space.mixed.mesh, component_rows(space)
        size = cell_size(mesh) / (space.order - 1)
        carried = (
            equations.viscosity,
            equations.carrier,
            size,
            _measure(equations),
            ufl.ds(domain=mesh),
        )
        self._carried = compat.form(preconditioning.pressure_convection(p, q, *carried))
        u, w = ufl.TrialFunction(scalar), ufl.TestFunction(scalar)
        self._weighed = compat.form(u * w * _measure(equations))
        self._convection = petsc.create_matrix(self._carried)
        self._vectors = self._convection.createVecs()
        self._blocks: list[Any] = [None, None]  # B and G

    def assemble(self) -> None:
        """Take the flow of the state, and B and G of the matrix, as they are. Collective."""
        self._mass.assemble()
        self._diffused.assemble()
        self._convection.zeroEntries()
        petsc.assemble_matrix(self._convection, self._carried)
        self._convection.assemble()
        divergence, gradient = self._blocks = [
            self._split.divergence(self._blocks[0]),
            self._split.gradient(self._blocks[1]),
        ]
        self._poisson.renew(divergence, gradient, 1.0 / self._sizes())

    def _sizes(self) -> np.ndarray:
        """(owned velocities, as in the blocks,) the diagonal D."""
        mass = petsc.assemble_matrix(self._weighed)
        mass.assemble()
        begins, _, values = mass.getValuesCSR()
        found, owned = np.empty(self._split.owned), len(begins) - 1
        found[self._rows[:, :owned]] = np.add.reduceat(np.abs(values), begins[:-1])
        mass.destroy()
        return np.asarray(found[self._split.velocities])

    def solve(self, right: np.ndarray, transposed: bool) -> np.ndarray:
        """(owned pressures,) approximately S^-1, or S^-T, times the right-hand side. Collective."""
        order, (before, after) = self._split.order, self._vectors
        found, diffused = np.empty_like(right), self._diffused.solve(right, transposed).copy()
        if transposed:
            found[order] = self._poisson.solve(right[order], transposed)
            before.setArray(found)
            self._convection.multTranspose(before, after)
            return diffused + self._mass.solve(after.array_r, transposed)
        before.setArray(self._mass.solve(right, transposed))
        self._convection.mult(before, after)
        found[order] = self._poisson.solve(after.array_r[order], transposed)
        return diffused + found

    def destroy(self) -> None:
        """Free PETSc's memory."""
        parts = (self._poisson, self._mass, self._diffused, self._convection)
        for held in (*parts, *self._blocks, *self._vectors):
            if held is not None:
                held.destroy()


class _ScaledPoisson:
    """Multigrid for L = B D^-1 G, and when first asked for it for the transpose. Every method is collective."""

    def __init__(self, closed: bool, options: Mapping[str, Any] | None = None):
        self._closed, self._options = closed, options
        self._cycles: dict[bool, _Poisson] = {}

    def renew(self, divergence: Any, gradient: Any, scale: np.ndarray) -> None:
        """Recompute L from B, G and the diagonal of D^-1 (owned velocities,)."""
        diagonal, scaled = divergence.createVecRight(), gradient.copy()
        diagonal.setArray(scale)
        scaled.diagonalScale(L=diagonal)
        self.destroy()
        self._prepare(divergence.matMult(scaled), transposed=False)
        diagonal.destroy()
        scaled.destroy()

    def solve(self, right: np.ndarray, transposed: bool) -> np.ndarray:
        """Approximately L^-1, or L^-T, times the right-hand side."""
        if transposed not in self._cycles:
            self._prepare(self._cycles[False].matrix.transpose(PETSc.Mat()), transposed)
        return self._cycles[transposed].solve(right)

    def _prepare(self, matrix: Any, transposed: bool) -> None:
        self._cycles[transposed] = _Poisson(matrix, self._closed, self._options)
        self._cycles[transposed].prepare()

    def destroy(self) -> None:
        """Free PETSc's memory."""
        for cycle in self._cycles.values():
            cycle.destroy()
        self._cycles = {}


class _Poisson:
    """One cycle of algebraic multigrid for a matrix that is held as its own; constants are taken out if `closed`."""

    def __init__(self, matrix: Any, closed: bool, options: Mapping[str, Any] | None = None):
        self.matrix, self._options = matrix, options
        self._right, self._left = matrix.createVecs()
        self._constant = (
            PETSc.NullSpace().create(constant=True, comm=matrix.comm) if closed else None
        )
        self._cycle: Any = None

    def prepare(self) -> None:
        """Set the cycle up for the matrix as it is now. Collective."""
        if self._cycle is not None:
            self._cycle.destroy()
        self._cycle = PETSc.PC().create(self.matrix.comm)
        self._cycle.setOptionsPrefix(POISSON)
        self._cycle.setOperators(self.matrix)
        with defaults(POISSON, self._options or algebraic()):
            self._cycle.setFromOptions()
            self._cycle.setUp()

    def solve(self, right: np.ndarray) -> np.ndarray:
        """(owned rows,) the approximate solution, to be copied. Collective."""
        self._right.setArray(right)
        if self._constant is not None:
            self._constant.remove(self._right)
        self._cycle.apply(self._right, self._left)
        if self._constant is not None:
            self._constant.remove(self._left)
        return self._left.array_r

    def destroy(self) -> None:
        """Free PETSc's memory."""
        for held in (self._cycle, self._right, self._left, self._constant, self.matrix):
            if held is not None:
                held.destroy()


def _measure(equations: Equations) -> Any:
    mesh = equations.space.mixed.mesh
    return ufl.dx(domain=mesh, metadata={"quadrature_degree": 2 * equations.space.order})


def _chebyshev(matrix: Any, bounds: tuple[float, float], steps: int = 4) -> Any:
    """Chebyshev's iteration with Jacobi's preconditioner and known bounds, a fixed number of steps."""
    solver = PETSc.KSP().create(matrix.comm)
    solver.setOptionsPrefix(PREFIX)
    solver.setOperators(matrix)
    solver.setType("chebyshev")
    solver.setNormType(PETSc.KSP.NormType.NONE)
    solver.setTolerances(max_it=steps)
    solver.getPC().setType("jacobi")
    with defaults(PREFIX, {"ksp_chebyshev_eigenvalues": f"{bounds[0]},{bounds[1]}"}):
        solver.setFromOptions()
    return solver

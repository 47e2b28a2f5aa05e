"""Approximate inverses of the pressure's Schur complement S = B F^-1 G of the Jacobian [[F, G], [B, 0]]."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import basix
import numpy as np
import ufl
from petsc4py import PETSc

from ... import compat
from ...forms import preconditioning
from ...mesh.cells import CELLS
from ...parallel import Owner
from .equations import Equations
from .options import algebraic, preconditioner

if TYPE_CHECKING:
    from .triangle import Triangle

MASS, POISSON = "fluid_pressure_", "fluid_pressure_poisson_"
CHEBYSHEV = {
    "pc_type": "ksp",
    "ksp_ksp_type": "chebyshev",
    "ksp_ksp_norm_type": "none",
    "ksp_ksp_max_it": 4,
    "ksp_pc_type": "jacobi",
}


class Inverse(Owner):
    """Preconditioner of a matrix (`options`); constants are projected out if `closed`. Methods are collective."""

    def __init__(self, prefix: str, chosen: dict[str, Any], closed: bool = False):
        super().__init__()
        self._prefix, self._chosen, self._closed = prefix, chosen, closed

    def prepare(self, matrix: Any) -> None:
        self.destroy()
        self._matrix = self.holding(matrix)
        self._right, self._left = map(self.holding, matrix.createVecs())
        constant = PETSc.NullSpace().create(constant=self._closed, comm=matrix.comm)
        self._constant = self.holding(constant)
        self._cycle = self.holding(preconditioner(matrix, self._prefix, self._chosen))

    def solve(self, right: np.ndarray) -> np.ndarray:
        self._right.setArray(right)
        self._constant.remove(self._right)
        self._cycle.apply(self._right, self._left)
        self._constant.remove(self._left)
        return np.asarray(self._left.array_r)


class PressureMass(Inverse):
    """S^-1 = M^-1, mass matrix over viscosity, by four Chebyshev steps, for Stokes flow. Methods are collective."""

    def __init__(self, equations: Equations, viscosity: Any):
        space = equations.space
        low, high = _bounds(space.pressure, space.order - 1)
        super().__init__(MASS, CHEBYSHEV | {"ksp_ksp_chebyshev_eigenvalues": f"{low},{high}"})
        p, q = ufl.TrialFunction(space.pressure), ufl.TestFunction(space.pressure)
        integrand = preconditioning.pressure_mass(p, q, viscosity, equations.reference_map)
        self._form = compat.form(integrand * equations.measure())

    def assemble(self, blocks: Triangle | None = None) -> None:
        self.prepare(compat.matrix_of(self._form))

    def diagonal(self) -> np.ndarray:
        self._matrix.getDiagonal(self._left)
        return np.asarray(self._left.array_r)


class CahouetChabard(Owner):
    """S^-1 = M^-1 + a0 A^-1 for unsteady flow, with the Laplacian A and rate coefficient a0.

    At free outflow the diagonal of A is doubled. Cahouet & Chabard (1988), Int. J. Numer. Methods Fluids 8, 869.
    """

    def __init__(self, equations: Equations):
        super().__init__()
        space, self._rate, self._coefficient = equations.space.pressure, equations.rate, 0.0
        self._mass = None
        if equations.viscosity is not None:
            self._mass = self.holding(PressureMass(equations, equations.viscosity))
        p, q = ufl.TrialFunction(space), ufl.TestFunction(space)
        integrand = preconditioning.pressure_laplacian(p, q, equations.reference_map)
        added = 0 if equations.surface is None else equations.surface.of_pressure(p, q)
        self._form = compat.form(integrand * equations.measure() + added)
        self._open = equations.open[equations.open < space.dofmap.index_map.size_local]
        self._poisson = self.holding(Inverse(POISSON, algebraic(), equations.closed))

    def assemble(self, blocks: Triangle) -> None:
        self._coefficient = float(self._rate.value)
        if self._mass is not None:
            self._mass.assemble()
        matrix = compat.matrix_of(self._form)
        diagonal = matrix.getDiagonal()
        entries = diagonal.array_r.copy()
        entries[self._open] *= 2.0
        diagonal.setArray(entries)
        matrix.setDiagonal(diagonal)
        diagonal.destroy()
        self._poisson.prepare(matrix)

    def solve(self, right: np.ndarray) -> np.ndarray:
        pressure = self._coefficient * self._poisson.solve(right)
        return np.asarray(pressure if self._mass is None else pressure + self._mass.solve(right))


class LeastSquaresCommutator(Owner):
    """S^-1 = L^-1 (B D^-1 F D^-1 G) L^-1, L = B D^-1 G, for steady flow with inertia.

    F is reduced to the diagonal blocks of the velocity components, with diagonals D. G includes
    upwinding. Elman, Howle, Shadid, Shuttleworth & Tuminaro (2006), SIAM J. Sci. Comput. 27, 1651;
    scaling and G are measured (docs/contribute/defaults.md).
    """

    def __init__(self, equations: Equations):
        super().__init__()
        self._order = np.argsort(equations.owned_pressures())
        self._poisson = self.holding(Inverse(POISSON, algebraic(), equations.closed))

    def assemble(self, blocks: Triangle) -> None:
        self._blocks, self._scale = blocks, 1.0 / np.abs(blocks.diagonal())
        diagonal, scaled = blocks.gradient.createVecLeft(), blocks.gradient.copy()
        diagonal.setArray(self._scale)
        scaled.diagonalScale(L=diagonal)
        self._poisson.prepare(blocks.divergence.matMult(scaled))
        diagonal.destroy()
        scaled.destroy()

    def solve(self, right: np.ndarray) -> np.ndarray:
        blocks, pressure = self._blocks, np.empty_like(right)
        forces = blocks.push(self._poisson.solve(right[self._order]))
        carried = blocks.carry(self._scale * forces)
        pressure[self._order] = self._poisson.solve(blocks.gather(self._scale * carried))
        return pressure


Schur = PressureMass | CahouetChabard | LeastSquaresCommutator


def schur_complement(equations: Equations) -> Schur:
    """Choose the approximation for the terms present. Collective."""
    if equations.rate is not None:
        return CahouetChabard(equations)
    if equations.carrier is not None:
        return LeastSquaresCommutator(equations)
    return PressureMass(equations, equations.viscosity)


def _bounds(space: Any, order: int) -> tuple[float, float]:
    """Bounds of the eigenvalues of the diagonally scaled mass matrix, from a straight cell (Wathen 1987)."""
    points, weights = basix.make_quadrature(CELLS[space.mesh.geometry.dim], 2 * order)
    values = compat.tabulate(space, points)
    mass = (values.T * weights) @ values
    scale = np.sqrt(mass.diagonal())
    eigenvalues = np.linalg.eigvalsh(mass / np.outer(scale, scale))
    return float(eigenvalues[0]), float(eigenvalues[-1])

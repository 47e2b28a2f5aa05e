"""Approximate inverses of the pressure's Schur complement S = B F^-1 B^T of the flow's Jacobian [[F, B^T], [B, 0]]."""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl
from petsc4py import PETSc

from ... import compat
from ...compat import petsc
from ...forms import preconditioning
from .equations import Equations
from .options import defaults

PREFIX = "fluid_pressure_"
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


class ScaledMass:
    """S^-1 = M^-1, M the mass matrix over the viscosity, by Chebyshev's iteration: for Stokes flow."""

    def __init__(self, equations: Equations):
        space = equations.space
        p, q = ufl.TrialFunction(space.pressure), ufl.TestFunction(space.pressure)
        integrand = preconditioning.pressure_mass(p, q, equations.viscosity, equations.reference_map)
        measure = ufl.dx(domain=space.mixed.mesh, metadata={"quadrature_degree": 2 * space.order})
        self._form = compat.form(integrand * measure)
        self._mass = petsc.create_matrix(self._form)
        self._right, self._left = self._mass.createVecLeft(), self._mass.createVecRight()
        self._solver = _chebyshev(self._mass, BOUNDS[space.gdim, space.order - 1])

    def assemble(self) -> None:
        """Take the viscosity of the state as it is. Collective."""
        self._mass.zeroEntries()
        petsc.assemble_matrix(self._mass, self._form)
        self._mass.assemble()
        self._solver.setOperators(self._mass)

    def solve(self, right: np.ndarray, transposed: bool = False) -> np.ndarray:
        """(owned pressures,) approximately S^-1 times the right-hand side. Collective."""
        self._right.setArray(right)
        self._solver.solve(self._right, self._left)
        return self._left.array_r

    def destroy(self) -> None:
        """Free PETSc's memory."""
        for held in (self._solver, self._mass, self._right, self._left):
            held.destroy()


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

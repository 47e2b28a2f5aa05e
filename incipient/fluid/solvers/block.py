"""Iterative linear solver of 3-D flow: GMRES with the upper block triangle of the Jacobian."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import basix
import numpy as np
import ufl
from petsc4py import PETSc

from ... import compat
from ...forms import terms
from ...mesh.domain import CELLS
from ...parallel import Owner
from ..space import cell_size
from .equations import Equations, LinearSolver, component_rows
from .options import CHEBYSHEV, COMPONENT, GMRES, algebraic, krylov, preconditioner

# Prefixes of PETSc's options.
VELOCITY, MASS, POISSON = "fluid_velocity_", "fluid_pressure_", "fluid_pressure_poisson_"
# In steady and unsteady flow; in the latter a shorter step helps more than further iterations.
MOST_ITERATIONS, MOST_IN_TIME = 250, 200
# Iterations, relative to a new preconditioner, after which it is rebuilt, or abandoned within a solve.
AGED = 1.5
USELESS = 4.0
# Relative residual of chord-method updates in steady flow and, of the preconditioned system, in unsteady flow.
ROUGH, ROUGH_IN_TIME = 1e-3, 3e-2
# Times p q over the size of a cell in the Laplacian at free outflow: the diagonal there about doubles.
AT_OUTFLOW = 3.0


class Block(LinearSolver):
    """GMRES with a block-triangular preconditioner, reused until iterations have grown by half.

    Constant pressures of closed domains are projected out.
    """

    regular: ClassVar[bool] = False
    remedy: ClassVar[str] = (
        'use a smaller numerics.mesh_size, numerics.stabilisation = "auto" or, with [time], a smaller time.step'
    )

    def __init__(self, matrix: Any, equations: Equations):
        super().__init__(matrix)
        self._equations, self._held = equations, equations.owned_held()
        self._usual = np.inf  # iterations per decade of the residual with a new preconditioner
        steady = equations.rate is None
        self._symmetric = equations.carrier is None and equations.surface is None
        self.rough = ROUGH if steady else ROUGH_IN_TIME
        self._options = GMRES | {
            "ksp_pc_side": "right" if steady else "left",
            "ksp_max_it": MOST_ITERATIONS if steady else MOST_IN_TIME,
        }
        self._parts = self.holding(Parts(equations))
        self._present = self.holding(Owner())
        self._solvers: dict[bool, Any] = {}  # by transposition

    def _solver_of(self, transposed: bool) -> Any:
        if transposed not in self._solvers:
            holding, matrix, equations = self._present.holding, self.matrix, self._equations
            triangle = Triangle(matrix, self._parts, equations, transposed)
            if transposed:
                matrix = holding(PETSc.Mat().createTranspose(matrix))
            if equations.closed:
                constant = holding(matrix.createVecRight())
                constant.setArray(equations.constant_pressures())
                null_space = PETSc.NullSpace().create(vectors=[constant], comm=matrix.comm)
                matrix.setNullSpace(holding(null_space))
                matrix.setTransposeNullSpace(null_space)
            self._solvers[transposed] = holding(krylov(matrix, self._options, triangle))
        return self._solvers[transposed]

    def prepare(self) -> None:
        self._present.destroy()
        self._solvers = {}
        self._most = self._solver_of(False).getTolerances()[3]
        self.statistics["factorisations"] += 1
        self._aged, self._prepared, self._usual = False, self.matrix.stateGet(), np.inf

    def _is_slow(self, iterations: int, rtol: float) -> bool:
        needed = iterations / -np.log10(rtol)
        if self._current:
            self._usual = min(needed, self._usual)
            return False
        return bool(needed > AGED * self._usual)

    def _iterate(self, b: Any, x: Any, rtol: float, transposed: bool) -> int | None:
        self._solver = self._solver_of(transposed and not self._symmetric)
        # An old preconditioner is replaced if it needs many iterations.
        expected = -USELESS * self._usual * np.log10(rtol)
        most = self._most if self._current else int(min(self._most, 1.0 + expected))
        self._solver.setTolerances(rtol=rtol, atol=1e-50, max_it=most)
        # Rows of Dirichlet conditions are identities, whose values count in no residual.
        x.setArray(np.where(self._held, b.array_r, 0.0))
        self._solver.solve(b, x)
        return self._solver.getIterationNumber() if self._solver.getConvergedReason() > 0 else None


class Parts(Owner):
    """Rows, forms and interpolation that a preconditioner needs for any state. Collective.

    rows: owned (gdim, nodes) of each velocity component; velocities: all these, ascending; places: of `rows` among
        `velocities`; pressures: owned ones
    sets: of the global rows of each component, of all components, and of the pressure
    mass, laplacian: compiled forms of M, in flow with viscosity but the commutator's, and A, in unsteady flow
    interpolation: from vertices to the nodes of a component; None: no viscosity
    """

    def __init__(self, equations: Equations):
        super().__init__()
        mixed, where = equations.space.mixed, equations.reference_map
        scalar, rows = component_rows(equations.space)
        self.rows = rows[:, : scalar.dofmap.index_map.size_local]
        # On several ranks PETSc requires ascending columns of blocks.
        self.velocities = np.sort(self.rows, axis=None)
        self.places = np.searchsorted(self.velocities, self.rows)
        self.pressures = equations.owned_pressures()
        start, comm = mixed.dofmap.index_map.local_range[0], mixed.mesh.comm
        self.sets = []
        for part in (*self.rows, self.velocities, self.pressures):
            numbers = (start + part).astype(PETSc.IntType)
            self.sets.append(self.holding(PETSc.IS().createGeneral(numbers, comm=comm)))
        p, q = (make(equations.space.pressure) for make in (ufl.TrialFunction, ufl.TestFunction))
        self.mass = self.laplacian = self.interpolation = None
        if equations.viscosity is not None and not equations.inertial:
            mass = terms.pressure_mass(p, q, equations.viscosity, where)
            self.mass = compat.form(mass * equations.measure())
        if equations.rate is not None:
            laplacian = terms.pressure_laplacian(p, q, where) * equations.measure()
            if equations.outflow is not None:
                laplacian += AT_OUTFLOW * p * q / cell_size(mixed.mesh) * equations.outflow
            if equations.surface is not None:
                laplacian += equations.surface.of_pressure(p, q)
            self.laplacian = compat.form(laplacian)
        if equations.viscosity is not None:
            vertices = compat.space(mixed.mesh, ("Lagrange", 1))
            self.interpolation = self.holding(compat.interpolation_matrix(vertices, scalar))


class Triangle(Owner):
    """Upper block triangle of [[F, G], [B, 0]], or of its transpose: a `PCPYTHON` context. Methods are collective.

    z_p = -S^-1 r_p, z_v = F^-1 (r_v - G z_p), with one multigrid V-cycle for each component's block of F. S is the
    mass over the viscosity M in Stokes flow. In unsteady flow S^-1 = M^-1 + a0 A^-1 with the Laplacian A, near
    zero at free outflow (Cahouet & Chabard 1988, Int. J. Numer. Methods Fluids 8, 869). In steady flow with inertia
    S^-1 = L^-1 (B D^-1 F D^-1 G) L^-1, L = B D^-1 G with the diagonal D of F, the least-squares commutator of Elman,
    Howle, Shadid, Shuttleworth & Tuminaro (2006, SIAM J. Sci. Comput. 27, 1651); F is reduced to the components'
    blocks, and G includes upwinding.
    """

    def __init__(self, matrix: Any, parts: Parts, equations: Equations, transposed: bool = False):
        super().__init__()
        self._matrix, self._parts, self._transposed = matrix, parts, transposed
        self._commutes = equations.inertial
        rate = 0.0 if equations.rate is None else float(equations.rate.value)
        *components, velocity, pressure = parts.sets
        self._momentum = [self._block(rows, rows) for rows in components]
        self._gradient = self._block(velocity, pressure)
        self._pressure = [self.holding(self._gradient.createVecRight()) for _ in range(3)]
        self._velocity = [self.holding(self._gradient.createVecLeft()) for _ in range(2)]
        self._component = [self.holding(vector) for vector in self._momentum[0].createVecs()]
        coarse = COMPONENT | algebraic("mg_coarse_")
        chosen = {"pc_type": "sor"} if parts.interpolation is None else coarse
        self._cycles = [
            self.holding(preconditioner(block, VELOCITY, chosen, parts.interpolation))
            for block in self._momentum
        ]
        self._constants = self.holding(
            PETSc.NullSpace().create(constant=equations.closed, comm=matrix.comm)
        )
        self._inverses = []
        if parts.mass is not None:
            mass = self.holding(compat.matrix_of(parts.mass))
            self._inverses.append(self.holding(preconditioner(mass, MASS, of_mass(equations))))
        laplacian = None
        if self._commutes:
            self._divergence = self._block(pressure, velocity)
            laplacian = self._scaled_laplacian()
        elif rate != 0.0:  # zero in the steady equations of an unsteady flow
            laplacian = self.holding(compat.matrix_of(parts.laplacian))
            laplacian.scale(1.0 / rate)
        if laplacian is not None:
            self._inverses.append(self.holding(preconditioner(laplacian, POISSON, algebraic())))

    def _block(self, rows: Any, columns: Any) -> Any:
        if not self._transposed:
            return self.holding(self._matrix.createSubMatrix(rows, columns))
        return self.holding(self._matrix.createSubMatrix(columns, rows)).transpose()

    def _scaled_laplacian(self) -> Any:
        """L; also sets the inverse diagonal D^-1."""
        diagonal, self._scale = self._matrix.getDiagonal(), self._velocity[0].duplicate()
        self.holding(self._scale).setArray(1.0 / np.abs(diagonal.array_r[self._parts.velocities]))
        diagonal.destroy()
        scaled = self._gradient.copy()
        scaled.diagonalScale(L=self._scale)
        laplacian = self.holding(self._divergence.matMult(scaled))
        scaled.destroy()
        return laplacian

    def apply(self, _: Any, right: Any, left: Any) -> None:
        r, z, (v, w), (p, q, _) = right.array_r, left.array, self._velocity, self._pressure
        q.setArray(r[self._parts.pressures])
        self._solve_schur(q, p)
        p.scale(-1.0)
        z[self._parts.pressures] = p.array_r
        self._gradient.mult(p, w)
        v.setArray(r[self._parts.velocities] - w.array_r)
        self._by_components([cycle.apply for cycle in self._cycles])
        z[self._parts.velocities] = w.array_r

    def _by_components(self, operators: Sequence[Callable[[Any, Any], None]]) -> None:
        """Apply an operator for each component to the first velocity, into the second."""
        (v, w), (right, left) = self._velocity, self._component
        for operator, places in zip(operators, self._parts.places, strict=True):
            right.setArray(v.array_r[places])
            operator(right, left)
            w.array[places] = left.array_r

    def _solve_schur(self, right: Any, left: Any) -> None:
        """S^-1 times a pressure, without constants in a closed domain; overwrites the right-hand side."""
        (v, w), work = self._velocity, self._pressure[2]
        if self._commutes:
            self._inverses[0].apply(right, left)
            self._gradient.mult(left, v)
            v.pointwiseMult(v, self._scale)
            self._by_components([momentum.mult for momentum in self._momentum])
            w.pointwiseMult(w, self._scale)
            self._divergence.mult(w, right)
        self._constants.remove(right)
        left.set(0.0)
        for inverse in self._inverses:
            inverse.apply(right, work)
            left.axpy(1.0, work)
        self._constants.remove(left)

    def destroy(self, _: Any = None) -> None:
        super().destroy()


def of_mass(equations: Equations) -> dict[str, Any]:
    """Options of four Chebyshev steps, bounds of eigenvalues being those of a straight cell (Wathen 1987)."""
    space, order = equations.space, equations.space.order - 1
    points, weights = basix.make_quadrature(CELLS[space.gdim], 2 * order)
    values = compat.tabulate(space.pressure, points)
    mass = (values.T * weights) @ values
    low, *_, high = np.linalg.eigvalsh(mass / np.sqrt(np.outer(mass.diagonal(), mass.diagonal())))
    return CHEBYSHEV | {"ksp_ksp_chebyshev_eigenvalues": f"{low},{high}"}

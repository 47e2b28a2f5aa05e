"""p-multigrid: smoothing in higher-order elements, coarse systems by the lower-order solver."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc

from ... import compat
from ...compat import petsc
from ...errors import UnsolvedError
from ...forms import preconditioning
from ...parallel import Owner
from ..space import TaylorHood
from .equations import Equations, LinearSolver, LinearStatistics, component_rows
from .options import preconditioner
from .pressure import PressureMass

# Smoothing steps per cycle, in creeping flow and with convection, and relative residual of the coarse system.
SMOOTHING, CONVECTED_SMOOTHING, COARSE = 4, 6, 0.2
MOST_CYCLES, MOST_DIRECTIONS = 40, 60
# Relative residual of error estimates in creeping flow and with convection: force and torque errors are then known to a
# sixth (docs/contribute/defaults.md). The improved drag of a free sphere at Re 100 is 0.4283 with 0.05, 0.4288 with
# 0.02 and 0.001.
ROUGH, CONVECTED_ROUGH = 0.05, 0.02
# Fraction of the upwind viscosity in the smoother's Schur complement. A sphere in shear with G d^2/nu = 400 (70,000
# unknowns) takes 95 iterations, otherwise more than 200.
UPWINDED = 0.15
RELAXED = "fluid_finer_velocity_"
SWEEPS = {"pc_type": "sor", "pc_sor_its": 2, "pc_sor_local_symmetric": None}


class TwoLevel(LinearSolver):
    """Matrix-free GCR for higher-order elements, with the flow in order k as coarse level.

    Search directions are smoothing steps (pressure mass over viscosity, symmetric relaxation of
    each velocity component), then a coarse solution. Residuals are measured in the dual of the
    energy norm. Eisenstat, Elman & Schultz (1983), SIAM J. Numer. Anal. 20, 345 (GCR).

    Args:
        times: product of A, or its transpose, with a vector (owned unknowns,).
        pressure_force: product with the pressure's part in momentum, transposed continuity's.
        coarse: solver of order k at about the same state, and its equations.
    """

    regular: ClassVar[bool] = False

    def __init__(
        self,
        times: Callable[[np.ndarray, bool], np.ndarray],
        pressure_force: PressureForce,
        equations: Equations,
        coarse: tuple[Any, Equations],
    ):
        super().__init__()
        self.matrix, self.statistics = None, LinearStatistics()
        self._times, self._pressure_force, self._held = (
            times,
            pressure_force,
            equations.owned_held(),
        )
        self._comm = equations.space.mixed.mesh.comm
        self._velocity = self.holding(Relaxation(equations))
        self._mass = self.holding(PressureMass(equations))
        self._pressure = self.holding(_smoothing_mass(equations))
        self._pressures, self._convected = (
            equations.owned_pressures(),
            equations.carrier is not None,
        )
        self._solver, self._transfer = coarse[0], self.holding(OrderTransfer(coarse[1], equations))
        self._constant = equations.constant_pressures() if equations.closed else None
        matrix = self._solver.matrix
        self._right = self.holding(matrix.createVecLeft())
        self._left = self.holding(matrix.createVecRight())
        self._scale: np.ndarray | None = None  # of residuals, set when first prepared

    def prepare(self) -> None:
        self._velocity.assemble()
        self._pressure.assemble()
        self._mass.assemble()
        self._pressure_force.renew()
        self.statistics.factorisations += 1
        weights = np.ones(len(self._held))
        weights[self._pressures] = self._mass.diagonal()
        self._velocity.weigh(weights)
        self._scale = 1.0 / weights

    def approximate(self, b: Any, x: Any) -> None:
        """Solve A x = b to the accuracy of an error estimate. Raises ConvergenceError."""
        self._solve(b, x, CONVECTED_ROUGH if self._convected else ROUGH, transposed=False)

    def _solve(self, b: Any, x: Any, rtol: float, transposed: bool) -> None:
        if self._scale is None:
            self.prepare()
        right = b.array_r.copy()
        solution = self._free(self._reduced(self._free(right), rtol, transposed))
        # Constrained rows are identities.
        x.setArray(np.where(self._held, right, solution))
        self.statistics.solves += 1

    def _reduced(self, residual: np.ndarray, rtol: float, transposed: bool) -> np.ndarray:
        """Solution to a relative residual of `rtol`; overwrites the residual."""
        solution, size = np.zeros_like(residual), self._size(residual)
        if size == 0.0:
            return solution
        directions: list[tuple[np.ndarray, np.ndarray]] = []
        smoothing = CONVECTED_SMOOTHING if self._convected else SMOOTHING
        for step in range(MOST_CYCLES * (smoothing + 1)):
            is_last = step % (smoothing + 1) == smoothing
            z = (self._coarsely_solved if is_last else self._smoothed)(residual, transposed)
            z = np.where(self._held, 0.0, z)
            q = self._free(self._times(z, transposed))
            for past, product in directions:
                along = self._inner(q, product)
                z -= along * past
                q -= along * product
            norm = self._size(q)
            if norm == 0.0 or not np.isfinite(norm):
                break
            z, q = z / norm, q / norm
            directions = [*directions[1 - MOST_DIRECTIONS :], (z, q)]
            length = self._inner(residual, q)
            solution += length * z
            residual -= length * q
            self.statistics.krylov_iterations += 1
            if is_last and step > smoothing and self._size(residual) <= rtol * size:
                return solution
        raise UnsolvedError(
            f"the correction in elements of a higher order did not converge in {step + 1} iterations: "
            "use a smaller numerics.mesh_size, or numerics.error_bars = false"
        )

    def _smoothed(self, residual: np.ndarray, transposed: bool) -> np.ndarray:
        z, pressure = np.zeros_like(residual), np.zeros_like(residual)
        pressure[self._pressures] = -self._pressure.solve(residual[self._pressures])
        if self._convected:
            residual = residual - np.where(
                self._held, 0.0, self._pressure_force.times(pressure, transposed)
            )
        self._velocity.solve(residual, z, transposed)
        z[self._pressures] = pressure[self._pressures]
        return z

    def _coarsely_solved(self, residual: np.ndarray, transposed: bool) -> np.ndarray:
        self._right.setArray(self._transfer.restricted(residual))
        if self._right.norm() == 0.0:
            return np.zeros_like(residual)
        if transposed:
            self._solver.solve_transposed(self._right, self._left, COARSE)
        else:
            self._solver.solve(self._right, self._left, COARSE)
        return self._transfer.prolonged(self._left.array_r)

    def _inner(self, one: np.ndarray, other: np.ndarray) -> float:
        return float(self._comm.allreduce(float(np.dot(one * self._scale, other)), op=MPI.SUM))

    def _size(self, residual: np.ndarray) -> float:
        return float(np.sqrt(self._inner(residual, residual)))

    def _free(self, values: np.ndarray) -> np.ndarray:
        values = np.where(self._held, 0.0, values)
        if self._constant is None:
            return values
        return values - self._comm.allreduce(float(self._constant @ values)) * self._constant


class Relaxation(Owner):
    """Two sweeps of rank-wise symmetric relaxation of each velocity component's operator. Collective."""

    def __init__(self, equations: Equations):
        super().__init__()
        scalar, rows = component_rows(equations.space)
        self._rows = rows[:, : scalar.dofmap.index_map.size_local]
        self._held = equations.held()[rows]
        self._alike = _alike(self._held, scalar.mesh.comm)
        self._convected = equations.carrier is not None
        u, w = ufl.TrialFunction(scalar), ufl.TestFunction(scalar)
        terms = (equations.viscosity, equations.rate, equations.carrier, equations.upwind_size)
        integrand = preconditioning.component(u, w, equations.reference_map, *terms)
        self._form = compat.form(integrand * equations.measure())
        zero = dolfinx.fem.Function(scalar)
        self._conditions = {
            k: [dolfinx.fem.dirichletbc(zero, np.flatnonzero(self._held[k]).astype(np.int32))]
            for k in sorted(set(self._alike))
        }
        self._matrices = {
            k: self.holding(petsc.create_matrix(self._form)) for k in self._conditions
        }
        self._right, self._left = map(self.holding, self._matrices[self._alike[0]].createVecs())
        self._present = self.holding(Owner())
        self._sweeps: dict[bool, dict[int, Any]] = {}  # by transposition

    def assemble(self) -> None:
        self._present.destroy()
        for k, matrix in self._matrices.items():
            compat.matrix_of(self._form, self._conditions[k], matrix)
        self._sweeps = {False: {k: self._swept(matrix) for k, matrix in self._matrices.items()}}

    def solve(self, right: np.ndarray, left: np.ndarray, transposed: bool) -> None:
        transposed = transposed and self._convected
        if transposed not in self._sweeps:
            self._sweeps[True] = {
                k: self._swept(self._present.holding(matrix.transpose(PETSc.Mat())))
                for k, matrix in self._matrices.items()
            }
        for rows, k in zip(self._rows, self._alike, strict=True):
            self._right.setArray(right[rows])
            self._sweeps[transposed][k].apply(self._right, self._left)
            left[rows] = self._left.array_r

    def weigh(self, weights: np.ndarray) -> None:
        """Write the operators' diagonal magnitudes into free rows (owned rows of the mixed system,)."""
        for rows, held, k in zip(self._rows, self._held, self._alike, strict=True):
            self._matrices[k].getDiagonal(self._left)
            free = ~held[: len(rows)]
            weights[rows[free]] = np.abs(self._left.array_r[free])

    def _swept(self, matrix: Any) -> Any:
        return self._present.holding(preconditioner(matrix, RELAXED, SWEEPS))


def _alike(held: np.ndarray, comm: MPI.Comm) -> list[int]:
    same = np.array([[np.array_equal(one, other) for other in held] for one in held], dtype=int)
    comm.Allreduce(MPI.IN_PLACE, same, op=MPI.MIN)
    return [int(number) for number in same.argmax(axis=1)]


class OrderTransfer(Owner):
    """Transfer of (owned unknowns,), zero where constrained, between two orders on one mesh. Collective."""

    def __init__(self, coarse: Equations, fine: Equations):
        super().__init__()
        self._held = [equations.owned_held() for equations in (coarse, fine)]
        (one, mine), (other, theirs) = (
            component_rows(equations.space) for equations in (coarse, fine)
        )
        spaces = (one, other), (coarse.space.pressure, fine.space.pressure)
        velocity, pressure = (self.holding(compat.interpolation_matrix(*pair)) for pair in spaces)
        pressures = [equations.owned_pressures() for equations in (coarse, fine)]
        owned = [space.dofmap.index_map.size_local for space in (one, other)]
        velocities = list(zip(mine[:, : owned[0]], theirs[:, : owned[1]], strict=True))
        self._parts = [*((velocity, *rows) for rows in velocities), (pressure, *pressures)]
        self._vectors = {
            id(m): [self.holding(one) for one in m.createVecs()] for m in (velocity, pressure)
        }

    def prolonged(self, values: np.ndarray) -> np.ndarray:
        fine_values = np.zeros(len(self._held[1]))
        for matrix, coarse, fine in self._parts:
            one, other = self._vectors[id(matrix)]
            one.setArray(values[coarse])
            matrix.mult(one, other)
            fine_values[fine] = other.array_r
        return np.where(self._held[1], 0.0, fine_values)

    def restricted(self, values: np.ndarray) -> np.ndarray:
        values, coarse_values = np.where(self._held[1], 0.0, values), np.zeros(len(self._held[0]))
        for matrix, coarse, fine in self._parts:
            one, other = self._vectors[id(matrix)]
            other.setArray(values[fine])
            matrix.multTranspose(other, one)
            coarse_values[coarse] = one.array_r
        return np.where(self._held[0], 0.0, coarse_values)


def _smoothing_mass(equations: Equations) -> PressureMass:
    carrier = equations.carrier
    if carrier is None:
        return PressureMass(equations)
    viscosity = preconditioning.upwinded_viscosity(
        equations.viscosity, carrier, equations.upwind_size, UPWINDED
    )
    return PressureMass(equations, viscosity)


class Action(Owner):
    """Jacobian of the present state, or its transpose, as an action; identity where `held`. Collective.

    From third order on tetrahedra, one application costs about three of a matrix, which takes twenty
    to assemble and 1.5 kB per unknown.
    """

    def __init__(self, state: Any, residual: Callable[[Any, Any], Any], held: np.ndarray):
        super().__init__()
        self._state, self._residual, self._held = state, residual, held
        self._direction = dolfinx.fem.Function(state.function_space)
        self._forms: dict[bool, Any] = {}
        self._vector: Any = None

    def times(self, values: np.ndarray, transposed: bool = False) -> np.ndarray:
        form = self._form(transposed)
        owned = len(values)
        self._direction.x.array[:owned] = np.where(self._held, 0.0, values)
        self._direction.x.scatter_forward()
        if self._vector is None:
            self._vector = self.holding(compat.create_vector(form, self._state.function_space))
        compat.vector_of(form, self._vector)
        return np.where(self._held, values, self._vector.array_r)

    def _form(self, transposed: bool) -> Any:
        if transposed not in self._forms:
            tests = ufl.TestFunction(self._state.function_space)
            tested, change = (self._direction, tests) if transposed else (tests, self._direction)
            residual = self._residual(*ufl.split(tested))
            self._forms[transposed] = compat.form(ufl.derivative(residual, self._state, change))
        return self._forms[transposed]


class PressureForce(Owner):
    """Matrix of momentum's pressure part, or of continuity without upwinding (transposed). Collective.

    It saves 198 of 430 actions for two updates and two dual solutions of a sphere in shear (30,000 unknowns,
    second order).
    """

    def __init__(self, space: TaylorHood, form: Callable[[bool], Any]):
        super().__init__()
        self._form = form
        velocities = space.velocity.dofmap.index_map.size_local * space.gdim
        pressures = space.pressure.dofmap.index_map.size_local
        self._velocities, self._pressures = (
            space.velocity_map[:velocities],
            space.pressure_map[:pressures],
        )
        self._made: dict[
            bool, tuple[Any, Any, Any, Any]
        ] = {}  # form, matrix and vectors, by whether transposed
        self._fresh: set[bool] = set()

    def renew(self) -> None:
        self._fresh = set()

    def times(self, values: np.ndarray, transposed: bool = False) -> np.ndarray:
        if transposed not in self._made:
            form = compat.form(self._form(not transposed))
            matrix = self.holding(petsc.create_matrix(form))
            self._made[transposed] = form, matrix, *map(self.holding, matrix.createVecs())
        form, matrix, right, left = self._made[transposed]
        if transposed not in self._fresh:
            compat.matrix_of(form, matrix=matrix)
            self._fresh.add(transposed)
        right.setArray(values[self._pressures])
        matrix.mult(right, left)
        forces = np.zeros_like(values)
        forces[self._velocities] = left.array_r
        return forces

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
from ...forms import terms
from ...parallel import Owner
from .block import of_mass
from .equations import Equations, LinearSolver, component_rows
from .options import preconditioner

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
RELAXED, MASS = "fluid_finer_velocity_", "fluid_finer_pressure_"
SWEEPS = {"pc_type": "sor", "pc_sor_its": 2, "pc_sor_local_symmetric": None}


class TwoLevel(LinearSolver):
    """Matrix-free GCR for higher-order elements, with the flow in order k as coarse level.

    Search directions are smoothing steps (pressure mass over viscosity, symmetric relaxation of
    each velocity component), then a coarse solution. Residuals are measured in the dual of the
    energy norm. Eisenstat, Elman & Schultz (1983), SIAM J. Numer. Anal. 20, 345 (GCR).

    Args:
        times: product of A, or its transpose, with a vector (owned unknowns,).
        coarse: solver of order k at about the same state, and its equations.
    """

    regular: ClassVar[bool] = False

    def __init__(
        self,
        times: Callable[[np.ndarray, bool], np.ndarray],
        equations: Equations,
        coarse: tuple[Any, Equations],
    ):
        super().__init__(None)
        self._times, self._held, self._space = times, equations.owned_held(), equations.space
        w, p = ufl.TestFunction(self._space.velocity), ufl.TrialFunction(self._space.pressure)
        # Without upwinding; it saves an action a smoothing step.
        gradient = terms.continuity(w, p, equations.reference_map) * equations.measure()
        self._gradient = self.holding(compat.matrix_of(compat.form(gradient)))
        self._pushes = [self.holding(vector) for vector in self._gradient.createVecs()]
        self._comm = equations.space.mixed.mesh.comm
        self._velocity = self.holding(Relaxation(equations))
        self._pressures, carrier = equations.owned_pressures(), equations.carrier
        self._convected, viscosity = carrier is not None, equations.viscosity
        self.rough = CONVECTED_ROUGH if self._convected else ROUGH
        if self._convected:
            size = equations.upwind_size
            viscosity = terms.upwinded_viscosity(viscosity, carrier, size, UPWINDED)
        q = ufl.TestFunction(self._space.pressure)
        mass = terms.pressure_mass(p, q, viscosity, equations.reference_map)
        self._mass, self._mass_options = compat.form(mass * equations.measure()), of_mass(equations)
        self._present = self.holding(Owner())
        self._solver, self._transfer = coarse[0], self.holding(OrderTransfer(coarse[1], equations))
        self._constant = equations.constant_pressures() if equations.closed else None
        self._left, self._right = map(self.holding, self._solver.matrix.createVecs())
        self._scale = np.empty(0)  # of residuals, set when prepared

    def prepare(self) -> None:
        self._present.destroy()
        mass, holding = self._present.holding(compat.matrix_of(self._mass)), self._present.holding
        self._masses = [holding(vector) for vector in mass.createVecs()]
        self._inverse_mass = holding(preconditioner(mass, MASS, self._mass_options))
        self.statistics["factorisations"] += 1
        weights = np.ones(len(self._held))
        mass.getDiagonal(self._masses[0])
        weights[self._pressures] = self._masses[0].array_r
        self._velocity.prepare(weights)
        self._scale, self._aged = 1.0 / weights, False

    @property
    def _current(self) -> bool:
        return not self._aged

    def _iterate(self, b: Any, x: Any, rtol: float, transposed: bool) -> int | None:
        right = b.array_r.copy()
        residual, solution = self._free(right), np.zeros_like(right)
        directions, products = np.empty((2, MOST_DIRECTIONS, len(right)))
        size = self._size(residual)
        step, solved = 0, size == 0.0
        smoothing = CONVECTED_SMOOTHING if self._convected else SMOOTHING
        while not solved and step < MOST_CYCLES * (smoothing + 1):
            kept, newest = min(step, MOST_DIRECTIONS), step % MOST_DIRECTIONS
            step += 1
            is_last = step % (smoothing + 1) == 0
            z = (self._coarsely_solved if is_last else self._smoothed)(residual, transposed)
            z = np.where(self._held, 0.0, z)
            q = self._free(self._times(z, transposed))
            along = self._inner(products[:kept], q)
            z -= along @ directions[:kept]
            q -= along @ products[:kept]
            norm = self._size(q)
            if norm == 0.0 or not np.isfinite(norm):
                break
            directions[newest], products[newest] = z / norm, q / norm
            length = self._inner(products[newest], residual)
            solution += length * directions[newest]
            residual -= length * products[newest]
            if is_last and step > smoothing + 1:
                solved = self._size(residual) <= rtol * size
        # Constrained rows are identities.
        x.setArray(np.where(self._held, right, self._free(solution)))
        self._steps = step
        return step if solved else None

    def _why_not_solved(self, b: Any) -> str:
        return (
            f"the correction in elements of a higher order did not converge in {self._steps} iterations: "
            "use a smaller numerics.mesh_size, or numerics.error_bars = false"
        )

    def _smoothed(self, residual: np.ndarray, transposed: bool) -> np.ndarray:
        z, pressure = np.zeros_like(residual), np.zeros_like(residual)
        right, left = self._masses
        right.setArray(residual[self._pressures])
        self._inverse_mass.apply(right, left)
        pressure[self._pressures] = -left.array_r
        if self._convected:
            residual = np.where(self._held, 0.0, residual - self._pushed(pressure))
        self._velocity.solve(residual, z, transposed)
        z[self._pressures] = pressure[self._pressures]
        return z

    def _pushed(self, pressures: np.ndarray) -> np.ndarray:
        right, left = self._pushes
        right.setArray(pressures[self._space.pressure_map[: right.getLocalSize()]])
        self._gradient.mult(right, left)
        forces = np.zeros_like(pressures)
        forces[self._space.velocity_map[: left.getLocalSize()]] = left.array_r
        return forces

    def _coarsely_solved(self, residual: np.ndarray, transposed: bool) -> np.ndarray:
        self._right.setArray(self._transfer.restricted(residual))
        if self._right.norm() == 0.0:
            return np.zeros_like(residual)
        self._solver.solve(self._right, self._left, COARSE, transposed=transposed)
        return self._transfer.prolonged(self._left.array_r)

    def _inner(self, first: np.ndarray, second: np.ndarray) -> Any:
        """Scalar product of a vector (owned unknowns,), or of each of several (n, owned unknowns), with another."""
        return self._comm.allreduce(first @ (self._scale * second), op=MPI.SUM)

    def _size(self, residual: np.ndarray) -> float:
        return float(np.sqrt(self._inner(residual, residual)))

    def _free(self, values: np.ndarray) -> np.ndarray:
        values = np.where(self._held, 0.0, values)
        if self._constant is None:
            return values
        return values - self._comm.allreduce(float(self._constant @ values)) * self._constant


class Relaxation(Owner):
    """Two sweeps of rank-wise symmetric relaxation of one velocity component's operator. Collective.

    It is zero where all components are constrained; where some are, callers drop their values.
    """

    def __init__(self, equations: Equations):
        super().__init__()
        scalar, rows = component_rows(equations.space)
        self._rows = rows[:, : scalar.dofmap.index_map.size_local]
        held = np.flatnonzero(equations.held()[rows].all(axis=0)).astype(np.int32)
        self._conditions = [dolfinx.fem.dirichletbc(dolfinx.fem.Function(scalar), held)]
        u, w = ufl.TrialFunction(scalar), ufl.TestFunction(scalar)
        coefficients = (
            equations.viscosity,
            equations.rate,
            equations.carrier,
            equations.upwind_size,
        )
        integrand = terms.velocity_component(u, w, equations.reference_map, *coefficients)
        self._form = compat.form(integrand * equations.measure())
        self._convected = equations.carrier is not None
        self._present = self.holding(Owner())

    def prepare(self, weights: np.ndarray) -> None:
        """Assemble, and write the diagonal's magnitudes into each component (owned rows of the mixed system,)."""
        self._present.destroy()
        self._matrix = self._present.holding(compat.matrix_of(self._form, self._conditions))
        self._right, self._left = map(self._present.holding, self._matrix.createVecs())
        self._sweeps: dict[bool, Any] = {}  # by transposition
        self._matrix.getDiagonal(self._left)
        weights[self._rows] = np.abs(self._left.array_r)

    def solve(self, right: np.ndarray, left: np.ndarray, transposed: bool) -> None:
        transposed, holding = transposed and self._convected, self._present.holding
        if transposed not in self._sweeps:
            matrix = self._matrix
            if transposed:
                matrix = holding(matrix.transpose(PETSc.Mat()))
            self._sweeps[transposed] = holding(preconditioner(matrix, RELAXED, SWEEPS))
        for rows in self._rows:
            self._right.setArray(right[rows])
            self._sweeps[transposed].apply(self._right, self._left)
            left[rows] = self._left.array_r


class OrderTransfer(Owner):
    """Transfer of (owned unknowns,) between two orders on one mesh, zero where constrained below. Collective."""

    def __init__(self, coarse: Equations, fine: Equations):
        super().__init__()
        self._held, self._size = coarse.owned_held(), len(fine.owned_held())
        self._parts = []
        parts = zip(coarse.space.parts, fine.space.parts, strict=True)
        for (coarser, coarse_rows), (finer, fine_rows) in parts:
            matrix = self.holding(compat.interpolation_matrix(coarser, finer))
            lower, upper = map(self.holding, matrix.createVecs())
            rows = coarse_rows[: lower.getLocalSize()], fine_rows[: upper.getLocalSize()]
            self._parts.append((matrix, lower, upper, *rows))

    def prolonged(self, values: np.ndarray) -> np.ndarray:
        fine_values = np.zeros(self._size)
        for matrix, lower, upper, coarse, fine in self._parts:
            lower.setArray(values[coarse])
            matrix.mult(lower, upper)
            fine_values[fine] = upper.array_r
        return fine_values

    def restricted(self, values: np.ndarray) -> np.ndarray:
        coarse_values = np.zeros(len(self._held))
        for matrix, lower, upper, coarse, fine in self._parts:
            upper.setArray(values[fine])
            matrix.multTranspose(upper, lower)
            coarse_values[coarse] = lower.array_r
        return np.where(self._held, 0.0, coarse_values)

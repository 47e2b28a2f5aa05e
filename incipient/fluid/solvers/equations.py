"""The data of the flow's Jacobian, and the interface of the solvers of linear systems."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import ufl

from ... import compat
from ...forms import ReferenceMap
from ..space import TaylorHood

if TYPE_CHECKING:
    from ..surface import SurfaceLoad


@dataclass(frozen=True)
class Equations:
    """The terms of the Jacobian [[F, G], [B, 0]], as UFL expressions that follow the state.

    space:         of velocity and pressure
    dirichlet:     the conditions that hold, of dolfinx
    open:          local pressure nodes where fluid leaves freely; none at all: known up to a constant
    viscosity:     kinematic; None: no stresses, as in the projection onto velocities free of divergence
    reference_map: of the flow
    rate:          coefficient a0 of the velocity in its rate of change, a constant of dolfinx; None: steady
    carrier:       convecting velocity relative to the mesh; None: no convection
    upwind_size:   size of cells over the order of the elements that upwinding is that of
    surface:       what a free surface adds; None: there is none
    """

    space: TaylorHood
    dirichlet: Sequence[Any]
    open: np.ndarray
    viscosity: Any
    reference_map: ReferenceMap
    rate: Any = None
    carrier: Any = None
    upwind_size: Any = None
    surface: SurfaceLoad | None = None

    def held(self) -> np.ndarray:
        """(local unknowns of the mixed space,) whether a condition holds there."""
        index_map = self.space.mixed.dofmap.index_map
        is_held = np.zeros(index_map.size_local + index_map.num_ghosts, dtype=bool)
        for condition in self.dirichlet:
            is_held[condition.dof_indices()[0]] = True
        return is_held

    def owned_held(self) -> np.ndarray:
        """(owned unknowns of the mixed space,) whether a condition holds there."""
        return self.held()[: self.space.mixed.dofmap.index_map.size_local]

    def measure(self) -> Any:
        """The measure of the cells for operators that stand for blocks of the Jacobian."""
        degree = {"quadrature_degree": 2 * self.space.order}
        return ufl.dx(domain=self.space.mixed.mesh, metadata=degree)

    def owned_pressures(self) -> np.ndarray:
        """Numbers in the mixed system of the owned pressures, in the order of their own space."""
        return self.space.pressure_map[: self.space.pressure.dofmap.index_map.size_local]

    def constant_pressures(self) -> np.ndarray:
        """(owned unknowns,) the constant pressures, of length one over all ranks. Collective."""
        constant = np.zeros(self.space.mixed.dofmap.index_map.size_local)
        constant[self.owned_pressures()] = 1.0
        return constant / np.sqrt(self.space.mixed.mesh.comm.allreduce(float(constant.sum())))

    @property
    def closed(self) -> bool:
        """Whether neither fluid leaves freely nor a surface is free: pressure is known up to a constant. Collective."""
        return self.surface is None and self.space.mixed.mesh.comm.allreduce(len(self.open)) == 0


@dataclass
class LinearStatistics:
    """Statistics of a linear solver."""

    factorisations: int = 0
    solves: int = 0
    krylov_iterations: int = 0

    def add(self, other: LinearStatistics) -> None:
        """Count what another solver has done as well."""
        self.factorisations += other.factorisations
        self.solves += other.solves
        self.krylov_iterations += other.krylov_iterations


class LinearSolver(ABC):
    """Solves A x = b with the flow's Jacobian A. Methods are collective.

    matrix:     A, of PETSc, whose entries may be reassembled at any time; None: A is known by its action alone
    statistics: counts so far
    regular:    whether A must be regular: `conditions.Constraints` then gives the pressure of a closed flow a level.
                Otherwise the solver itself deals with the constant pressures, the null space of A.
    """

    matrix: Any
    statistics: LinearStatistics
    regular: ClassVar[bool]

    def solve(self, b: Any, x: Any, rtol: float, fresh: bool = False) -> None:
        """Solve A x = b to a residual of `rtol` times b; `fresh` prepares first.

        Raises:
            UnsolvedError: A is singular or not finite, or the iteration did not converge.
            ConvergenceError: a factorisation failed for another reason.
        """
        if fresh:
            self.prepare()
        self._solve(b, x, rtol, transposed=False)

    def solve_transposed(self, b: Any, x: Any, rtol: float) -> None:
        """Solve A^T x = b to a residual of `rtol` times b. Raises as `solve` does."""
        self._solve(b, x, rtol, transposed=True)

    @abstractmethod
    def _solve(self, b: Any, x: Any, rtol: float, transposed: bool) -> None: ...

    @abstractmethod
    def prepare(self) -> None:
        """Prepare for the present matrix, for example factorise it. Raises ConvergenceError if that fails."""

    @abstractmethod
    def approximate(self, b: Any, x: Any) -> None:
        """Solve with the matrix as last prepared, even if it has changed: a step of the chord method.

        The contraction of the steps tells the caller how good it is.
        """

    @abstractmethod
    def destroy(self) -> None:
        """Free PETSc's memory."""


def component_rows(space: TaylorHood) -> tuple[Any, np.ndarray]:
    """The space of one velocity component, and (gdim, local nodes) the rows of the mixed system of each."""
    scalar = compat.space(space.mixed.mesh, ("Lagrange", space.order))
    nodes = np.empty(len(space.unknowns_at_nodes), dtype=np.int64)
    nodes[compat.cell_dofs(scalar)] = compat.cell_dofs(space.velocity)
    return scalar, space.unknowns_at_nodes[nodes].T
